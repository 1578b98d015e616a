"""The twin of paper 003's cube and its registration; what its scene does not hold."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Built, TimeSteps, TrackedTwin, Tree
from validate.pipeline.run.method_run import Truth
from validate.recording.types import Recording
from validate.register.markers.quality import MarkerFit
from validate.register.registration import Registered
from validate.scene.scene import Scene
from validate.solve.explicit.central import CentralDifference
from validate.solve.march import output_frames
from validate.twin.tracker import Origin, Reading, SteppedTwin

_BUILT = Built(Path(__file__).parent)
_FIDUCIALS = {
    "f1": (0.0, 0.0, 0.0),
    "f2": (0.1, 0.0, 0.0),
    "f3": (0.0, 0.1, 0.0),
    "f4": (0.1, 0.1, 0.0),
}


@dataclass(frozen=True)
class Force:
    force: float = quantity(0.5, "N", "at the end of the ramp")


@dataclass(frozen=True)
class PushedCube:
    """The step is sound; the paper prints 1 ms. 0.15 s are the 150 steps of its tables."""

    loading: Force = Force()
    clock: TimeSteps = TimeSteps(2e-4, 750)
    twin: TrackedTwin = TrackedTwin(seed=2020)
    registration: MarkerFit = MarkerFit()


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    return Registered.following(recording, scene.mesh, "push", "N", tree.settings.registration)


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    return {"dt": tree.settings.clock.dt}


def twin_of(tree: Tree) -> SteppedTwin:
    own: PushedCube = tree.settings
    scene = _BUILT(None, tree)
    return SteppedTwin(
        replace(scene, material=own.twin.true(scene.material)),
        CentralDifference,
        lambda t: own.loading.force * t / t[-1],
        own.clock.dt,
        own.clock.steps,
    )


def record(tree: Tree, progress: Progress) -> Recording:
    made, twin = twin_of(tree), tree.settings.twin
    mesh = made.scene.mesh
    declared = {
        "element": f"P1 tetrahedra, {len(mesh.nodes)} nodes, {len(mesh.cells)} cells",
        "law": f"{made.scene.material.law}, central difference, lumped mass",
    }
    same = twin.stiffness == 1 and twin.nu is None
    return made.record(
        Origin("ekf_cube", twin.seed, same, declared),
        _FIDUCIALS,
        twin.camera,
        lambda run: {"push": Reading(run.traces["push.force"].y, "N")},
        progress,
    )


def truth(tree: Tree, seen: Registered) -> Truth:
    """The twin's displacements at the steps, and its fields at 200 of them."""
    made = twin_of(tree)
    return Truth.of(made.run(output_frames(tree.settings.clock.steps, 200)), made.scene)
