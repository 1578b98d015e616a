"""Our side of the random bodies: measured bodies as `validate new` writes them, at full load."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from bodies_drawn import Drawn, E

from validate.arrays import rms
from validate.commands.questions.scene import geometry_of
from validate.compare.convergence import GridConvergence
from validate.pipeline.bodies.choices import MeasuredBody, SeenOf
from validate.pipeline.bodies.measured import measured_body, solid
from validate.pipeline.checks.checks import Refined
from validate.pipeline.experiment.experiment import Experiment, Variant
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.runs import ExperimentRuns
from validate.recording.types import Markers, Recording, Signal, Source
from validate.register.markers.markers import MarkerObservation, Together
from validate.register.markers.quality import as_declared
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.material import Material
from validate.scene.scene import Drive, Load, Scene, Support

_T = np.array([0.0, 1.0])
_TOGETHER = (Together("marker", (0, 1, 2), "displacement of the markers"),)


@dataclass(frozen=True)
class Judged:
    """The true error of the nominal mesh (rms, N or m) and what is found of it without the truth;
    `answer` is the rms of the true answer."""

    error: float
    answer: float
    found: GridConvergence

    @property
    def covered(self) -> bool:
        return self.error <= 2 * self.found.u

    @property
    def ratio(self) -> float:
        return 2 * self.found.u / self.error


def parameters(body: Drawn) -> Tree:
    """The body as a user would declare it."""
    low, high = (f"{'xyz'[body.axis]}{end}" for end in ("min", "max"))
    round_, slides = body.kind == "cylinder", body.support == "slipping"
    sides = (body.size[0], body.size[2]) if round_ else body.size
    shape = "cylinder" if round_ else "block"
    answers = {"body.shape": shape, f"body.{shape}": ",".join(map(str, sides))}
    answers |= {"held.slides": low} if slides else {}
    axis = np.eye(3)[body.along]
    along, place = tuple(axis.tolist()), f"{high}"
    across = tuple(int(c) for c in np.flatnonzero(axis == 0))
    held = Support(low, (body.axis,), rests=True) if slides else Support(low)
    parts: dict[str, Any] = {"loads": (Load("load", place, along),)}
    if body.moves:
        parts = {"drives": (Drive("load", place, along),)}
    return Tree(
        "",
        Scene(
            geometry_of(answers, body.cells, 2), Material(E, body.nu),
            (held, *((Support(place, across),) if body.moves else ())),
            dilatation="by_element", **parts,
        ),
        MeasuredBody(SeenOf(force="force" if body.moves else None)),
    )  # fmt: skip


def experiment(body: Drawn, truth: list[float]) -> Experiment:
    """One load step, compared with the converged answer in place of a measurement."""
    p = parameters(body)
    method = solid("quadratic cells", body.law)
    made = measured_body("body", "body", "drawn", p, {"solid": method}, ("solid",), (), Path())

    def place(recording: Recording, p: Tree, scene: Any) -> Registered:
        load = recording.signals["load"]
        drive = SignalObservation("load", "drives", _T[1:], load.y[1:], load.unit, 0.0)
        if body.moves:
            force = SignalObservation("force", "validates", _T[1:], np.array([truth]), "N", 0.0,
                                      "force", "load.force")  # fmt: skip
            return Registered((drive, force))
        rest = np.array(body.markers)
        names = tuple(f"m{i}" for i in range(len(rest)))
        x = np.stack([rest, rest + np.reshape(truth, (-1, 3))])
        seen = MarkerObservation.of(
            Markers(_T, names, x, 0.0, "body"), dict(zip(names, rest, strict=True)), scene.mesh,
            stands=np.inf, registration=as_declared(names, rest, 0.0), together=_TOGETHER,
        )  # fmt: skip
        return Registered((drive, replace(seen, t=_T[1:], x=x[1:])))

    return replace(made, place=place)


def recording(body: Drawn) -> Recording:
    amount = body.amount if body.moves else body.amount * body.section
    y = np.array([[0.0], [amount]])
    signals = {"load": Signal(_T, y, "m" if body.moves else "N", 0.0, "x")}
    return Recording("body", Source("x", "", 0, "x"), 0, signals=signals)


def judged(body: Drawn, truth: list[float]) -> Judged:
    """The error of the nominal mesh, and what the family of meshes says of it."""
    made = experiment(body, truth)
    runs = ExperimentRuns(made, made.methods, made.parameters, None, quick=True)
    runs.recordings = (recording(body),)
    assert made.uncertainty is not None
    (residual,) = runs.varied(Variant("solid")).residuals.values()
    found = Refined(runs, made.uncertainty, "solid").of(residual, np.inf)["mesh"]
    assert found is not None
    answer = np.reshape(truth, (-1, residual.values.shape[1]))
    return Judged(rms(residual.values), rms(answer), found)
