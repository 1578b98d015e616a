"""The hand and the twin of paper 003's liver under a tool at 1 kHz (section 3.5); registration.

The paper's device, tool path and coupling are not printed. Here a synthetic hand pushes, slides,
lets go and pokes at the middle of the liver's top, through the spring of a probe. The recording is
the same body's, simulated at every tick: it says what a slower simulation loses, and can only
repeat itself about the body.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.errors import RecordingError, SceneError
from validate.fem.system import build as build_system
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Experiment, Progress
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.live import RecordedPath, as_given
from validate.recording.types import Recording, Signal, Source
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.contact import Needle
from validate.scene.mesh import Mesh
from validate.scene.scene import Probe, Scene
from validate.solve.haptic.loop import HapticLoop
from validate.solve.haptic.rates import RealTime
from validate.solve.march import march
from validate.twin.sensors import LoadCell, signal, streams
from validate.twin.tracker import Origin

from ..ekf_liver.body import of_its_body, watched
from ..needle_pocket.hand import moved, tremor

TOOL, AXES = "tool", "xyz"
FOLDER = Path(__file__).parent
SHIPPED = "../../recordings/haptic_liver.mcap"  # of the generated body
EACH_TICK = HapticLoop(every=1, late=0, extrapolation="hold")
_BUILT = Built(FOLDER)
_DOWN = (0.0, 0.0, -1.0)
_FRAME = "liver"
#: Stops of the hand: time s, depth and way sideways in units of the path's depth. Approach, push,
#: slide, leave, a quick poke, leave.
STOPS: tuple[tuple[float, float, float], ...] = (
    (0.0, -0.5, 0.0),
    (0.25, -0.15, 0.0),
    (0.75, 1.0, 0.0),
    (1.0, 1.0, 0.4),
    (1.3, 0.7, 0.1),
    (1.5, -0.5, 0.0),
    (1.6, -0.3, 0.0),
    (1.7, 0.6, 0.0),
    (1.85, -0.6, 0.0),
    (2.0, -0.5, 0.0),
)


@dataclass(frozen=True)
class ToolSpring:
    """The coupling of the hand to the body, of every method."""

    spring: float = quantity(1000.0, "N/m", "between tool and contact (virtual coupling)")
    reach: float = quantity(1e-3, "m", "distance at which the tool makes contact")
    pad: float = quantity(
        0.02, "m", "distance from the contact within which surface nodes share the spring"
    )
    grip: float | None = quantity(0.0, "N", "pulling force at which contact ends; none: never")
    limit: float = quantity(5.0, "N", "largest force on the hand")


@dataclass(frozen=True)
class ToolPath:
    depth: float = quantity(0.006, "m", "depth of the hand below the resting surface")
    rate: float = quantity(RealTime.haptic_hz, "1/s", "samples a second")
    tremor: float = quantity(2e-5, "m", "of the hand, rms along every axis")
    seed: int = quantity(3, "1", "seed of the tremor")
    seconds: float = quantity(STOPS[-1][0], "s", "part of the path that is used")


_CELL = LoadCell(seed=35, noise=5e-3, every=5)


@dataclass(frozen=True)
class TouchedLiver:
    """What no scene holds; `path` and `twin` are what made the recording."""

    hand: ToolSpring = ToolSpring()
    path: ToolPath = ToolPath()
    twin: LoadCell = _CELL


def touchable(mesh: Mesh) -> Mesh:
    """The body with the facet set "surface": all that is not held."""
    held = set(map(tuple, np.sort(mesh.facets["held"], axis=1).tolist()))
    free = [tuple(f) not in held for f in np.sort(mesh.surface, axis=1).tolist()]
    return replace(mesh, facets={**mesh.facets, "surface": mesh.surface[free]})


def touched_place(mesh: Mesh) -> Floats:
    """Where the hand goes to (d,) m: the free surface node in the middle of the body's top."""
    return np.array(mesh.nodes[watched(mesh)["node_B"]])


def way(p: ToolPath, above: Floats) -> tuple[Floats, Floats]:
    """t (nt,) s and the tip's places (nt, 3) m over a place (3,) m of the surface."""
    if not (p.depth > 0 and p.rate > 0 and p.tremor >= 0 and 0 < p.seconds <= STOPS[-1][0]):
        raise SceneError(
            f"tool path {1e3 * p.depth:g} mm deep at {p.rate:g} Hz for {p.seconds:g} s: depth and "
            f"rate above 0, at most {STOPS[-1][0]:g} s"
        )
    t = np.arange(round(STOPS[-1][0] * p.rate) + 1) / p.rate
    arrive = np.array([s[0] for s in STOPS])
    places = np.array([(0.7 * side, 0.7 * side, -deep) for _, deep, side in STOPS])
    x = above + p.depth * moved(t, arrive, places) + tremor(t, 3, p.tremor, p.seed)
    walked = t <= p.seconds * (1 + 1e-9)
    return np.round(t[walked], 9), np.round(x[walked], 9)  # a nanometre: short files


def under(scene: Scene, tip: Floats) -> Scene:
    """The liver and the tool with its tip at (3,) m, observed where it is touched."""
    return replace(
        scene,
        body=touchable(scene.mesh),
        tools=(Needle(TOOL, "surface", tuple(tip.tolist()), _DOWN),),
        probes=(Probe("touched", tuple(touched_place(scene.mesh).tolist())),),
    )


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    return of_its_body(tree, folder, SHIPPED, record)


def record(tree: Tree, progress: Progress) -> Recording:
    """The path at every tick, and the force on the hand with a load cell's noise."""
    progress("simulate")
    p: TouchedLiver = tree.settings
    liver = _BUILT(None, tree)
    t, x = way(p.path, touched_place(liver.mesh))
    scene = under(liver, x[0])
    hand = {name: getattr(p.hand, name) for name in ("spring", "reach", "pad", "grip", "limit")}
    loop = replace(EACH_TICK, dt=1 / p.path.rate, **hand)
    run = march("twin", loop.prepare(build_system(scene)), t, x - x[0], np.array([len(t) - 1]), 0.0)
    if not run.finished:
        raise SceneError(f"the twin: {run.outcome.why}")
    rng, some = streams(p.twin.seed, ("force",))["force"], slice(None, None, p.twin.every)
    signals = {}
    for c, a in enumerate(AXES):
        signals[f"tip.{a}"] = Signal(t, x[:, [c]], "m", 0.0, _FRAME)
        force = run.traces[f"{TOOL}.force.{a}"].y[some]
        signals[f"force.{a}"] = signal(t[some], force, "N", p.twin.noise, _FRAME, rng)
    provenance = {
        "kind": "twin", "same_model": "true", "body": tree.scene.body.which(FOLDER),
        "seed": str(p.twin.seed),
        "law": f"{scene.material.law}, central difference at every tick, the mesh of the models",
        "element": f"P1 tetrahedra, {len(scene.mesh.nodes)} nodes, {len(scene.mesh.cells)} cells",
        "hand": "minimum-jerk moves with tremor, synthetic",
    }  # fmt: skip
    return Recording(
        "haptic_liver", Source("haptic_liver", "", 0, "made in memory"), Origin.start_ns,
        signals=signals, metadata={"provenance": provenance},
    )  # fmt: skip


def build(recording: Recording, tree: Tree, changes: Mapping[str, Any] | None = None) -> Scene:
    return under(_BUILT(recording, tree, changes), _walkable(recording)[1][0])


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """The tip drives; what was recorded or given of the force is compared."""
    t, x, sd, findings = _walkable(recording)
    gone = x - np.array(scene.tools[0].tip)
    drives = tuple(
        SignalObservation(f"tip.{a}", "drives", t, gone[:, [c]], "m", sd)
        for c, a in enumerate(AXES)
    )
    seen = tuple(
        SignalObservation.validating(
            recording, f"{kind}.{a}", "N", quantity=f"{kind}.{a}", trace=f"{TOOL}.force.{a}"
        )
        for kind in ("force", "given")
        for a in AXES
        if f"{kind}.{a}" in recording.signals
    )
    return Registered((*drives, *seen), findings=findings)


def _walkable(recording: Recording) -> tuple[Floats, Floats, float, tuple[str, ...]]:
    """The path's seen samples: t (nt,) s, x (nt, 3) m, sd m; what was left out, in words."""
    path = RecordedPath.of(recording, 3)
    t, x = path.t, path.x
    seen = np.isfinite(x).all(axis=1)
    if seen.sum() < 2:
        raise RecordingError(
            f"{recording.name}: {int(seen.sum())} of {len(t)} samples of the tip are visible; "
            "a path needs at least 2"
        )
    steps, findings = np.diff(t[seen]), []
    if not seen.all():
        findings.append(
            f"the tip of {int((~seen).sum())} of {len(t)} samples is not visible and is omitted"
        )
    if steps.max() > 1.5 * np.median(steps):
        findings.append(
            f"the path's longest step is {steps.max():.3g} s, its median one "
            f"{np.median(steps):.3g} s: every sample is taken as one tick"
        )
    return t[seen], x[seen], path.sd, tuple(findings)


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    """The tick is the recording's own."""
    h: ToolSpring = tree.settings.hand
    return {
        "dt": round(float(np.median(np.diff(seen.t))), 9), "spring": h.spring, "reach": h.reach,
        "pad": h.pad, "grip": h.grip, "limit": h.limit,
    }  # fmt: skip


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """The experiment as its recording has it: a live loop's own force, or a user's path."""
    recording, twin = recordings[0], experiment.twin
    if recording.made_with or twin is None:
        return experiment
    if given := as_given(experiment, recording):
        return given
    there: tuple[Accept, ...] = tuple(
        a for a in experiment.accept if a.quantity in recording.signals
    )
    return replace(experiment, accept=there, twin=replace(twin, remake=()))
