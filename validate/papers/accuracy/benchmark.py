"""A benchmark of solvers (paper 002): the implicit run is the truth, every method is held to it.

What its two experiments share: the twin, which is `Newmark` with consistent mass and full damping
on the models' own mesh and step (as in the paper) or on finer ones, its recording by a tracker, and
the methods' inputs. An experiment gives the scene, the input and the places of the fiducials.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.system import build as build_system
from validate.papers.accuracy.needle import STEP
from validate.parameters import quantity
from validate.recording.mcap.read import read_recording
from validate.recording.types import Recording
from validate.register.follow import follow_signal
from validate.register.registered import Registered
from validate.replay.experiment import Change, Progress, Twin
from validate.replay.followed import Truth, truth_of
from validate.replay.method import Method
from validate.scene.scene import Material, PlaneState, Scene
from validate.solve.explicit_linear import ExplicitLinear
from validate.solve.march import march, output_frames
from validate.solve.newmark import Newmark
from validate.solve.quasi_static import QuasiStatic
from validate.solve.types import Run
from validate.twin.tracked import Camera, Origin, Reading, points_of, record_tracked

FRAMES = 300  # all steps of 10 s: errors are drawn over time
IMPLICIT = Newmark(STEP, drive_rates="given")
EXPLICIT = ExplicitLinear(STEP, "consistent", "full", drive_rates="given")


@dataclass(frozen=True)
class MaterialCard:
    E: float = quantity(200.0, "Pa", "Young's modulus")
    nu: float = quantity(0.47, "1", "Poisson ratio")
    rho: float = quantity(2000.0, "kg/m3", "density")
    mass_damping: float = quantity(1.0, "1/s", "Rayleigh alpha")
    stiffness_damping: float = quantity(0.1, "s", "Rayleigh beta")

    @property
    def material(self) -> Material:
        return Material(
            self.E,
            self.nu,
            rho=self.rho,
            mass_damping=self.mass_damping,
            stiffness_damping=self.stiffness_damping,
        )


def card(m: Material) -> MaterialCard:
    """A material as parameters; raises `SceneError`'s kin for none: the benchmarks have density."""
    assert m.rho is not None
    return MaterialCard(m.E, m.nu, m.rho, m.mass_damping, m.stiffness_damping)


@dataclass(frozen=True)
class Body:
    cells: int = quantity(20, "1", "cells across")
    plane: PlaneState = quantity("strain", "1", "strain or stress, in 2-D")


@dataclass(frozen=True)
class Clock:
    dt: float = quantity(STEP, "s", "time step")
    steps: int = quantity(300, "1", "steps")


@dataclass(frozen=True)
class TwinCard:
    """What made the recording; the models do not know it."""

    seed: int = quantity(1, "1", "seed of the noise")
    noise: float = quantity(1e-4, "m", "standard deviation of a marker per axis")
    refined: int = quantity(1, "1", "its cells across in one of the models'")
    finer: int = quantity(1, "1", "its steps in one of the models'")


@dataclass(frozen=True)
class Parameters:
    """Of one benchmark; `recording` is a path."""

    material: MaterialCard
    body: Body
    clock: Clock
    twin: TwinCard
    recording: str = quantity("", "1", "the recording")


@dataclass(frozen=True)
class Benchmark:
    """`scene(material, body)` and its one input (nt,) in `unit` at times (nt,) s.

    `fiducials` (d,) m are points that do not move.
    """

    name: str
    scene: Callable[[Material, Body], Scene]
    input: str
    unit: str
    values: Callable[[Floats], Floats]
    fiducials: Mapping[str, tuple[float, ...]]

    # --- the road ---------------------------------------------------------------------------------

    def load(self, p: Parameters, folder: Path) -> tuple[Recording, ...]:
        return (read_recording(Path(p.recording)),)

    def build(self, recording: Recording, p: Parameters, model: None) -> Scene:
        return self.scene(p.material.material, p.body)

    def place(self, recording: Recording, p: Parameters, scene: Scene) -> Registered:
        return follow_signal(recording, scene.mesh, self.input, self.unit)

    def sets(self, p: Parameters, seen: Registered) -> Mapping[str, Any]:
        return {"dt": p.clock.dt}

    # --- the twin ---------------------------------------------------------------------------------

    def twin(self, p: Parameters, at: Ints) -> tuple[Scene, Run]:
        """The twin's run, at the ends of the models' steps; fields at those `at`."""
        f = p.twin.finer
        body = replace(p.body, cells=p.body.cells * p.twin.refined)
        scene = self.scene(p.material.material, body)
        t: Floats = p.clock.dt / f * np.arange(1, p.clock.steps * f + 1, dtype=np.float64)
        stepper = replace(IMPLICIT, dt=p.clock.dt / f).prepare(build_system(scene))
        run = march("twin", stepper, t, self.values(t)[:, None], (at + 1) * f - 1, 0.0)
        traces = {name: replace(trace, y=trace.y[f - 1 :: f]) for name, trace in run.traces.items()}
        return scene, replace(run, t=run.t[f - 1 :: f], at=at, traces=traces)

    def made(self, notice: str) -> Twin:
        """The experiment's twin, with what its report says of it."""
        prefixes = ("body.", "clock.", "twin.")
        return Twin(self.record, self.truth, prefixes, True, TwinCard().seed, notice)

    def record(self, p: Parameters, progress: Progress) -> Recording:
        progress("simulate")
        scene, run = self.twin(p, np.array([0]))
        progress("measure")
        twin = p.twin
        declared = {
            "element": f"{scene.mesh.kind}, {len(scene.mesh.nodes)} nodes",
            "law": "linear elasticity, Rayleigh damping, average acceleration, consistent mass",
            "E_Pa": repr(p.material.E),
            "nu": repr(p.material.nu),
            "plane": scene.plane if scene.mesh.dimension == 2 else "",
        }
        flat = 3 - scene.mesh.dimension
        return record_tracked(
            Origin(self.name, twin.seed, twin.refined == twin.finer == 1, declared),
            points_of(run, scene),
            {k: np.array([*v, *[0.0] * flat]) for k, v in self.fiducials.items()},
            Camera(twin.noise),
            {self.input: Reading(self.values(run.t), self.unit)},
        )

    def truth(self, p: Parameters, seen: Registered) -> Truth:
        """The twin's displacements at the steps, and its fields at the frames."""
        scene, run = self.twin(p, output_frames(p.clock.steps, FRAMES))
        return truth_of(run, scene)


# --- methods and cases ----------------------------------------------------------------------------

#: The paper's five; its "lumped" restricts the damping to alpha M as well.
FIVE: Mapping[str, Method] = {
    "implicit": Method("implicit", IMPLICIT),
    "implicit_lumped": Method(
        "implicit, lumped M, C = αM", replace(IMPLICIT, mass="lumped", damping_terms="mass")
    ),
    "explicit": Method("explicit", EXPLICIT),
    "explicit_lumped": Method(
        "explicit, lumped M, C = αM", replace(EXPLICIT, mass="lumped", damping_terms="mass")
    ),
    "quasi_static": Method("quasi-static", QuasiStatic()),
}
#: Lumping and the restriction of C one at a time.
SWITCHES: Mapping[str, Method] = {
    "implicit_lumped_full": Method("implicit, lumped M, full C", replace(IMPLICIT, mass="lumped")),
    "implicit_restricted": Method(
        "implicit, consistent M, C = αM", replace(IMPLICIT, damping_terms="mass")
    ),
    "explicit_lumped_full": Method("explicit, lumped M, full C", replace(EXPLICIT, mass="lumped")),
    "explicit_restricted": Method(
        "explicit, consistent M, C = αM", replace(EXPLICIT, damping_terms="mass")
    ),
    "explicit_lagged": Method(
        "explicit, lumped M, lagged full C", replace(EXPLICIT, mass="lumped", update="lagged")
    ),
}


def changed(part: str, **values: Any) -> Change:
    """A change of one part of the parameters."""

    def change(p: Parameters) -> Parameters:
        return replace(p, **{part: replace(getattr(p, part), **values)})

    return change


def solvers() -> dict[str, Method]:
    """The linear solvers of the implicit step, and the update as misprinted."""
    return {
        "gauss_seidel": Method(
            "implicit by Gauss-Seidel", replace(IMPLICIT, solver="gauss_seidel")
        ),
        "cg": Method("implicit by conjugate gradients", replace(IMPLICIT, solver="cg")),
        "dense_inverse": Method(
            "implicit by a dense inverse", replace(IMPLICIT, solver="dense_inverse")
        ),
        "misprinted": Method(
            "implicit, update as misprinted", replace(IMPLICIT, update="misprinted")
        ),
    }
