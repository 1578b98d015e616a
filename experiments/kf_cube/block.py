"""The block of paper 001 under traction: its twin and its registration.

Held below, pulled on its upper face.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Built, TimeSteps, TrackedTwin, Tree
from validate.pipeline.run.method_run import Truth
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.markers.quality import MarkerFit
from validate.register.registration import Registered
from validate.register.sensing import PoseShift
from validate.scene.material import Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Foundation, Scene
from validate.solve.dynamic.newmark import Newmark
from validate.solve.march import output_frames
from validate.twin.tracker import Camera, Origin, Reading, SteppedTwin

_EVERY = (0, 1, 2)


def on_springs(stiffness: float | str) -> dict[str, Any]:
    """The block on springs (N/m^3) in place of its support, as a method's change of the scene."""
    return {"supports": (), "foundations": (Foundation("z0", _EVERY, stiffness),)}


@dataclass(frozen=True)
class Traction:
    traction: float = quantity(3000.0, "Pa", "on the top face, upward")
    a0: Literal["equilibrium", "zero"] = quantity(
        "equilibrium", "1", "first acceleration: M^-1 f, or zero"
    )
    off: float = quantity(0.0, "s", "time at which the traction is released; 0: never")


@dataclass(frozen=True)
class LayeredTwin(TrackedTwin):
    """A twin that may hold what the models do not, step finer, and look carelessly."""

    inside: Literal["nothing", "layer", "inclusion"] = quantity(
        "nothing", "1", "stiff layer at mid-height, or stiff inclusion"
    )
    contrast: float = quantity(5.0, "1", "modulus of layer or inclusion over the rest")
    finer: int = quantity(1, "1", "its steps in one of the models'")
    springs: float = quantity(0.0, "N/m^3", "of an elastic support below it; 0: held")
    outliers: float = quantity(0.0, "1", "share of samples in which a marker is an outlier")
    astray: float = quantity(1e-3, "m", "size of an outlier, in a random direction")
    late: float = quantity(0.0, "s", "sd of a sample's time stamp, as its clock declares")

    @property
    def camera(self) -> Camera:
        return replace(super().camera, outliers=self.outliers, astray=self.astray, late=self.late)


@dataclass(frozen=True)
class PulledBlock:
    """What the scene does not hold: the traction, the models' steps, the twin, the camera."""

    loading: Traction = Traction()
    clock: TimeSteps = TimeSteps(0.002, 500)
    twin: LayeredTwin = LayeredTwin()
    registration: MarkerFit = MarkerFit()
    camera: PoseShift = field(default_factory=PoseShift)


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    own: PulledBlock = tree.settings
    seen = Registered.following(recording, scene.mesh, "pull", "N", own.registration)
    pull, markers = seen.observations
    assert isinstance(markers, MarkerObservation)
    return replace(seen, observations=(pull, own.camera.of(markers)))


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    return {"dt": tree.settings.clock.dt, "a0": tree.settings.loading.a0}


# --- the twin -------------------------------------------------------------------------------------


def twin_of(tree: Tree) -> SteppedTwin:
    own: PulledBlock = tree.settings
    return SteppedTwin(
        _true_scene(tree),
        lambda dt: Newmark(dt, a0=own.loading.a0),
        lambda t: _force(tree, t),
        own.clock.dt,
        own.clock.steps,
        own.twin.finer,
    )


def _true_scene(tree: Tree) -> Scene:
    twin: LayeredTwin = tree.settings.twin
    scene = Built()(None, tree, on_springs(twin.springs) if twin.springs else None)
    scene = replace(scene, material=twin.true(scene.material))
    if twin.inside == "nothing":
        return scene
    stiff = replace(scene.material, E=twin.contrast * scene.material.E)
    return replace(
        scene, regions=(Region(twin.inside, _stiff_cells(scene.mesh, twin.inside), stiff),)
    )


def _stiff_cells(mesh: Mesh, inside: str) -> Ints:
    """The middle two rows of seven, or the upper middle half of the block."""
    share = mesh.nodes[mesh.corners].mean(axis=1) / mesh.nodes.max(axis=0)
    layer = (share[:, 2] > 2.99 / 7) & (share[:, 2] < 5.01 / 7)
    if inside == "layer":
        return np.flatnonzero(layer)
    middle = np.abs(share[:, :2] - 0.5).max(axis=1) < 0.2501
    return np.flatnonzero(layer & middle)


def _force(tree: Tree, t: Floats) -> Floats:
    """The traction's total force (nt,) N at the ends of the twin's steps, (nt,) s."""
    own: PulledBlock = tree.settings
    dt, (width, depth, _) = own.clock.dt / own.twin.finer, tree.scene.body.size
    on = np.where((own.loading.off > 0) & (t > own.loading.off + dt / 2), 0.0, 1.0)
    return np.asarray(own.loading.traction * width * depth * on)


def record(tree: Tree, progress: Progress) -> Recording:
    made, twin = twin_of(tree), tree.settings.twin
    mesh = made.scene.mesh
    width, depth, _ = tree.scene.body.size
    corners = {"f1": (0.0, 0.0), "f2": (width, 0.0), "f3": (0.0, depth), "f4": (width, depth)}
    declared = {
        "element": f"P1 tetrahedra, {len(mesh.nodes)} nodes, {len(mesh.cells)} cells",
        "law": "linear elasticity, Rayleigh damping, average acceleration",
        "inside": twin.inside,
    }
    same = twin == replace(LayeredTwin(), seed=twin.seed, noise=twin.noise)
    return made.record(
        Origin("kf_cube", twin.seed, same, declared),
        {name: (*corner, 0.0) for name, corner in corners.items()},
        twin.camera,
        lambda run: {"pull": Reading(run.traces["pull.force"].y, "N")},
        progress,
    )


def truth(tree: Tree, seen: Registered) -> Truth:
    """The twin's displacements at the steps, and its fields at 200 of them."""
    made = twin_of(tree)
    return Truth.of(made.run(output_frames(tree.settings.clock.steps, 200)), made.scene)
