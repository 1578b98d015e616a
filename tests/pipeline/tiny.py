"""A block of 27 boxes that is pulled: over time by a force, or at three holds by its top."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.estimate.reduced.reduced_kf import ReducedKf
from validate.fem.system import System, build
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Case, Experiment, Twin
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.experiment.variation import change_of
from validate.pipeline.run.method_run import Truth
from validate.pipeline.run.twin_record import stamped
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation, holds_at
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Drive, Load, Probe, Scene, Support
from validate.solve.dynamic.newmark import Newmark
from validate.solve.fluid.cavities import NoFluid
from validate.solve.march import march, output_frames
from validate.solve.types import Ending, State, Stepper
from validate.twin.tracker import Camera, Origin, Reading, points_of

DT, STEPS, SIDE = 0.002, 30, 0.01
PROBES = {"node_A": (SIDE, SIDE, SIDE), "node_B": (0.0, SIDE, 2 * SIDE / 3)}
FIDUCIALS = {"f1": (0.0, 0.0, 0.0), "f2": (SIDE, 0.0, 0.0), "f3": (0.0, SIDE, 0.0)}


@dataclass(frozen=True)
class TinyTwin:
    stiffness: float = quantity(1.0, "1", "its modulus over the models'")
    missing: float = quantity(0.0, "1", "share of looks without a marker")


@dataclass(frozen=True)
class TinySettings:
    sd: float = quantity(1e-5, "m", "noise")
    twin: TinyTwin = field(default_factory=TinyTwin)


SCENE = Scene(
    Box((SIDE, SIDE, SIDE), (3, 3, 3)),
    Material(10e3, 0.3, "linear", 1000.0, stiffness_damping=0.05),
    (Support("z0"),),
    loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    probes=tuple(Probe(name, at) for name, at in PROBES.items()),
)
DECLARED = Tree(scene=SCENE, settings=TinySettings())


def true_scene(tree: Tree) -> Scene:
    """That of the twin, on its own mesh whatever the models'."""
    changes = {"material.E": f"x {tree.settings.twin.stiffness!r}", "body.cells": (3, 3, 3)}
    return Built()(None, tree, changes)


def true_run(tree: Tree, frames: int = 200) -> tuple[Scene, Any]:
    true = true_scene(tree)
    t = DT * np.arange(1, STEPS + 1)
    force = 0.05 * np.minimum(t / 0.02, 1.0)[:, None]
    stepper = Newmark(DT).prepare(build(true))
    return true, march("twin", stepper, t, force, output_frames(STEPS, frames), 0.0)


def record(tree: Tree, progress: Callable[[str], None]) -> Recording:
    true, run = true_run(tree)
    return Origin("tiny", 3, True).record(
        points_of(run, true),
        {k: np.array(v) for k, v in FIDUCIALS.items()},
        Camera(tree.settings.sd, 1, tree.settings.twin.missing, still=10_000),
        {"pull": Reading(run.traces["pull.force"].y, "N")},
    )


def truth(tree: Tree, seen: Registered) -> Truth:
    true, run = true_run(tree)
    return Truth.of(run, true)


@dataclass(frozen=True)
class Breaking:
    """Steps as another stepper until one fails."""

    inner: Stepper
    at: int
    failure: tuple[Ending, str]

    @property
    def scene(self) -> Scene:
        return self.inner.scene

    def rest(self) -> State:
        return self.inner.rest()

    def step(self, state: State, drives: Floats) -> State:
        stepped = self.inner.step(state, drives)
        return replace(stepped, failure=self.failure) if stepped.k == self.at else stepped

    def field(self, state: State) -> Floats:
        return self.inner.field(state)

    @property
    def units(self) -> Mapping[str, str]:
        return self.inner.units


@dataclass(frozen=True)
class Breaks:
    """A scheme whose step `at` fails."""

    dt: float = quantity(DT, "s", "time step")
    at: int = quantity(1, "1", "step that fails")
    ending: str = quantity("refused", "1", "its ending")
    inner: Any = quantity(None, "1", "the scheme that fails; none: Newmark")

    def prepare(self, system: System) -> Stepper:
        ending: Any = self.ending
        inner = self.inner or Newmark(self.dt)
        return Breaking(inner.prepare(system), self.at, (ending, "told so"))


def sets(tree: Tree, seen: Registered) -> dict[str, Any]:
    return {"dt": DT}


A = ("node_A",)
METHODS = {
    "fem": Method("FEM", Newmark()),
    "timed": Method("FEM, timed", Newmark(), steps=5),
    "slow": Method("FEM, long steps", Newmark(), stride=3),
    "kf": Method("filter", ReducedKf(modes=5, load_start=0.02, load_walk=0.05), markers=A),
    "refused": Method("refused", Breaks()),
    "diverged": Method("diverged", Breaks(at=8, ending="diverged")),
}


stiffer = change_of({"twin.stiffness": 1.25})
missed = change_of({"twin.missing": 0.4})

TINY = Experiment(
    name="tiny",
    title="tiny",
    source="this test",
    scene=SCENE,
    settings=TinySettings(),
    methods=METHODS,
    accepted=("fem",),
    accept=(Accept("node_B", 1e-4, "ours"),),
    load=lambda tree, folder: (stamped(record(tree, print), tree),),
    place=lambda recording, tree, its: Registered.following(recording, its.mesh, "pull", "N"),
    sets=sets,
    axis="z",
    reference="fem",
    cases=(
        Case("stiff", "25 % stiffer", stiffer),
        Case("missing", "looks are missing", missed, methods=("kf", "diverged")),
    ),
    twin=Twin(record, truth, kind="same model"),
    path=Path(__file__),
)


# --- the same block at holds ------------------------------------------------------------------


LOADS = (1e-4, 2e-4, 3e-4)  # m


#: The block with its top moved upward.
MOVED = replace(SCENE, loads=(), drives=(Drive("stage", "z1", (0.0, 0.0, 1.0)),))


def moved_run(tree: Tree) -> tuple[Scene, Any]:
    true = true_scene(tree)
    y = np.linspace(0, LOADS[-1], STEPS + 1)[1:, None]
    t = np.arange(1.0, STEPS + 1)
    stepper = NoFluid().prepare(build(true))
    return true, march("twin", stepper, t, y, output_frames(STEPS, 2), 0.0)


def record_moved(tree: Tree, progress: Callable[[str], None]) -> Recording:
    true, run = moved_run(tree)
    stage = np.linspace(0, LOADS[-1], STEPS + 1)[1:]
    readings = {
        "stage": Reading(stage, "m"),
        "cell": Reading(run.traces["stage.force"].y, "N", 1e-4),
    }
    at = {k: np.array(v) for k, v in FIDUCIALS.items()}
    camera = Camera(tree.settings.sd, 1, tree.settings.twin.missing, still=10_000)
    return Origin("moved", 3, True).record(points_of(run, true), at, camera, readings)


def moved_truth(tree: Tree, seen: Registered) -> Truth:
    """The twin's motion at the recorded samples, rest first."""
    true, run = moved_run(tree)
    probes = Truth.of(run, true).probes
    return Truth({name: np.vstack([np.zeros((1, 3)), u]) for name, u in probes.items()})


def place_moved(recording: Recording, tree: Tree, its: Scene) -> Registered:
    stage = SignalObservation.driving(recording, "stage", "m")
    cell = SignalObservation.validating(
        recording, "cell", "N", quantity="force", trace="stage.force"
    )
    markers = MarkerObservation.placed(recording, its.mesh)
    rest, *holds = holds_at(stage, stage.t, LOADS, 1e-6)
    return Registered((stage, markers, cell), tuple(holds), rest)


AT_HOLDS = replace(
    TINY,
    parameters=Tree(scene=MOVED, settings=TinySettings()),
    methods={"fem": Method("FEM", NoFluid())},
    accept=(Accept("node_B", 1e-4, "ours"), Accept("force", 0.1, "ours")),
    load=lambda tree, folder: (stamped(record_moved(tree, print), tree),),
    place=place_moved,
    sets=lambda tree, seen: {},
    cases=(Case("stiff", "25 % stiffer", stiffer),),
    twin=Twin(record_moved, moved_truth, kind="same model"),
)
