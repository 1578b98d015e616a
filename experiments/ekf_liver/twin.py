"""The twin of paper 003's liver and its registration; what its scene does not hold.

Node A is measured among the loaded ones, node B is free and not measured: where they lie follows
from the mesh.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Experiment, Progress
from validate.pipeline.experiment.tree import Built, TimeSteps, TrackedTwin, Tree
from validate.pipeline.run.method_run import Truth
from validate.recording.types import Recording
from validate.register.markers.quality import MarkerFit
from validate.register.registration import Registered
from validate.scene.geometries.refinement import refined
from validate.scene.mesh import Mesh
from validate.scene.scene import Probe, Scene
from validate.solve.explicit.central import CentralDifference
from validate.solve.march import output_frames
from validate.twin.tracker import Origin, Reading, SteppedTwin

from .body import of_its_body, watched
from .published import LIVER_FIGURES

FOLDER = Path(__file__).parent
SHIPPED = "../../recordings/ekf_liver.mcap"  # of the generated body
_BUILT = Built(FOLDER)
_FIDUCIALS = 4


@dataclass(frozen=True)
class LiverTwin(TrackedTwin):
    halved: int = quantity(
        0, "1", "number of divisions of its cells into eight; 0 is the mesh of the models"
    )
    finer: int = quantity(1, "1", "its steps in one of the models'")


@dataclass(frozen=True)
class Force:
    force: float = quantity(0.5, "N", "at the end of the ramp")


@dataclass(frozen=True)
class PulledLiver:
    """The step is the printed one; 0.15 s are those of the cube, as "the other parameters" are."""

    loading: Force = Force()
    clock: TimeSteps = TimeSteps(1e-4, 1500)
    twin: LiverTwin = LiverTwin(seed=2021)
    registration: MarkerFit = MarkerFit()


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    return of_its_body(tree, folder, SHIPPED, record)


def build(
    recording: Recording | None, tree: Tree, changes: Mapping[str, Any] | None = None
) -> Scene:
    """The declared scene, observed at A and B."""
    scene = _BUILT(recording, tree, changes)
    nodes = watched(scene.mesh)
    probes = tuple(Probe(name, _place(scene.mesh, node)) for name, node in nodes.items())
    return replace(scene, probes=(*scene.probes, *probes))


def fiducials(mesh: Mesh) -> dict[str, tuple[float, ...]]:
    """Four held nodes, each as far as can be from those before it (m)."""
    x = mesh.nodes[mesh.facet_nodes("held")]
    chosen = [int(np.argmax(x[:, 0]))]
    while len(chosen) < _FIDUCIALS:
        away = np.linalg.norm(x[:, None] - x[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(away)))
    return {f"f{i}": tuple(x[at].tolist()) for i, at in enumerate(chosen, start=1)}


def _place(mesh: Mesh, node: int) -> tuple[float, ...]:
    return tuple(mesh.nodes[node].tolist())


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    return Registered.following(recording, scene.mesh, "pull", "N", tree.settings.registration)


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    return {"dt": tree.settings.clock.dt}


def twin_of(tree: Tree) -> SteppedTwin:
    own: PulledLiver = tree.settings
    scene = build(None, tree)
    scene = replace(scene, material=own.twin.true(scene.material))
    for _ in range(own.twin.halved):
        scene = refined(scene)
    return SteppedTwin(
        scene,
        CentralDifference,
        lambda t: own.loading.force * t / t[-1],
        own.clock.dt,
        own.clock.steps,
        own.twin.finer,
    )


def same_model(twin: LiverTwin) -> bool:
    """Whether the twin is the models' own."""
    return twin == replace(twin, stiffness=1.0, nu=None, halved=0, finer=1)


def record(tree: Tree, progress: Progress) -> Recording:
    made, twin = twin_of(tree), tree.settings.twin
    mesh = made.scene.mesh
    declared = {
        "body": tree.scene.body.which(FOLDER),
        "element": f"P1 tetrahedra, {len(mesh.nodes)} nodes, {len(mesh.cells)} cells",
        "law": f"{made.scene.material.law}, central difference, lumped mass",
    }
    return made.record(
        Origin("ekf_liver", twin.seed, same_model(twin), declared),
        fiducials(mesh),
        twin.camera,
        lambda run: {"pull": Reading(run.traces["pull.force"].y, "N")},
        progress,
    )


def truth(tree: Tree, seen: Registered) -> Truth:
    """The twin's displacements at the steps; its fields at 200 of them where it has our mesh."""
    own, made = tree.settings, twin_of(tree)
    found = Truth.of(made.run(output_frames(own.clock.steps, 200)), made.scene)
    return found if own.twin.halved == 0 else Truth(found.probes)


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """The experiment with the figures of the body that stands for the liver."""
    return replace(experiment, published=LIVER_FIGURES[tree.scene.body.which(FOLDER)])
