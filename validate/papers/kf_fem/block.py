"""The block of paper 001 under traction: parameters, scene, twin and registration.

4 x 4 x 7 cells of 1 mm (200 nodes, 672 tetrahedra), held below, pulled on its upper face.
Places are given on that grid, whatever cells the block has.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.parameters import quantity
from validate.recording.types import Recording
from validate.register.fitting import MarkerFit
from validate.register.follow import follow_signal
from validate.register.markers import MarkerObservation
from validate.register.registered import Registered
from validate.register.sensing import PoseShift
from validate.replay.cards import DampedTissue, TimeSteps, TrackedTwin
from validate.replay.experiment import Progress
from validate.replay.followed import Truth, truth_of
from validate.scene.box import box, centroids
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Foundation, Load, Probe, Scene, Support
from validate.solve.excitation import StartName
from validate.solve.march import output_frames
from validate.solve.newmark import Newmark
from validate.twin.stepped import SteppedTwin
from validate.twin.tracked import Camera, Origin, Reading

NODES = {"node_A": (2, 2, 7), "node_B": (2, 2, 5), "corner": (0, 0, 7)}  # in cells
FIDUCIALS = {"f1": (0, 0, 0), "f2": (4, 0, 0), "f3": (0, 4, 0), "f4": (4, 4, 0)}


@dataclass(frozen=True)
class BlockCells:
    cell: float = quantity(1e-3, "m", "edge of a cell")
    across: int = quantity(4, "1", "cells across")
    high: int = quantity(7, "1", "cells high")

    @property
    def mesh(self) -> Mesh:
        cells = (self.across, self.across, self.high)
        return box(tuple(n * self.cell for n in cells), cells)

    def places(self, which: Mapping[str, tuple[int, int, int]]) -> dict[str, tuple[float, ...]]:
        """Points m from places on the 4 x 4 x 7 grid."""
        across = self.across / 4 * self.cell
        unit = (across, across, self.high / 7 * self.cell)
        return {k: tuple(i * u for i, u in zip(ijk, unit, strict=True)) for k, ijk in which.items()}


@dataclass(frozen=True)
class Traction:
    traction: float = quantity(3000.0, "Pa", "on the top face, upward")
    spread: Literal["consistent", "nodal"] = quantity("consistent", "1", "nodal: equal forces")
    a0: StartName = quantity("equilibrium", "1", "first acceleration: M^-1 f, or zero")
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
class BlockModel:
    """What a method's scene has besides: a region of the body's own material, or springs."""

    layer: bool = quantity(False, "1", "the middle rows of cells are a region, 'layer'")
    springs: float = quantity(0.0, "N/m^3", "of an elastic support below; 0: held")


@dataclass(frozen=True)
class PulledBlock:
    """Parameters; `recording` is a path."""

    material: DampedTissue = DampedTissue(rho=1068.0, stiffness_damping=0.1)
    body: BlockCells = BlockCells()
    loading: Traction = Traction()
    clock: TimeSteps = TimeSteps(0.002, 500)
    twin: LayeredTwin = LayeredTwin()
    registration: MarkerFit = MarkerFit()
    camera: PoseShift = field(default_factory=PoseShift)
    recording: str = quantity("", "1", "the recording")


def build(recording: Recording, p: PulledBlock, model: BlockModel | None) -> Scene:
    model = model or BlockModel()
    scene = _scene(p, p.material.material, model.springs)
    if not model.layer:
        return scene
    layer = Region("layer", _stiff_cells(scene.mesh, "layer"), scene.material)
    return replace(scene, regions=(layer,))


def _scene(p: PulledBlock, material: Material, springs: float) -> Scene:
    """On springs N/m^3, or held below."""
    every = (0, 1, 2)
    return Scene(
        p.body.mesh,
        material,
        () if springs else (Support("z0", every),),
        foundations=(Foundation("z0", every, springs),) if springs else (),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0), p.loading.spread),),
        probes=tuple(Probe(name, at) for name, at in p.body.places(NODES).items()),
    )


def place(recording: Recording, p: PulledBlock, scene: Scene) -> Registered:
    seen = follow_signal(recording, scene.mesh, "pull", "N", p.registration)
    pull, markers = seen.observations
    assert isinstance(markers, MarkerObservation)
    return replace(seen, observations=(pull, p.camera.of(markers)))


def sets(p: PulledBlock, seen: Registered) -> Mapping[str, Any]:
    return {"dt": p.clock.dt, "a0": p.loading.a0}


# --- the twin -------------------------------------------------------------------------------------


def twin_of(p: PulledBlock) -> SteppedTwin:
    return SteppedTwin(
        _true_scene(p),
        lambda dt: Newmark(dt, a0=p.loading.a0),
        lambda t: _force(p, t),
        p.clock.dt,
        p.clock.steps,
        p.twin.finer,
    )


def _true_scene(p: PulledBlock) -> Scene:
    twin = p.twin
    scene = _scene(p, twin.true(p.material.material), twin.springs)
    if twin.inside == "nothing":
        return scene
    stiff = replace(scene.material, E=twin.contrast * scene.material.E)
    return replace(
        scene, regions=(Region(twin.inside, _stiff_cells(scene.mesh, twin.inside), stiff),)
    )


def _stiff_cells(mesh: Mesh, inside: str) -> Ints:
    """The middle two rows of seven, or the upper middle half of the block."""
    share = centroids(mesh) / mesh.nodes.max(axis=0)
    layer = (share[:, 2] > 2.99 / 7) & (share[:, 2] < 5.01 / 7)
    if inside == "layer":
        return np.flatnonzero(layer)
    middle = np.abs(share[:, :2] - 0.5).max(axis=1) < 0.2501
    return np.flatnonzero(layer & middle)


def _force(p: PulledBlock, t: Floats) -> Floats:
    """The traction's total force (nt,) N at the ends of the twin's steps, (nt,) s."""
    dt, side = p.clock.dt / p.twin.finer, p.body.across * p.body.cell
    on = np.where((p.loading.off > 0) & (t > p.loading.off + dt / 2), 0.0, 1.0)
    return np.asarray(p.loading.traction * side**2 * on)


def record(p: PulledBlock, progress: Progress) -> Recording:
    made, twin = twin_of(p), p.twin
    mesh = made.scene.mesh
    declared = {
        "element": f"P1 tetrahedra, {len(mesh.nodes)} nodes, {len(mesh.cells)} cells",
        "law": "linear elasticity, Rayleigh damping, average acceleration",
        "inside": twin.inside,
    }
    same = twin == replace(LayeredTwin(), seed=twin.seed, noise=twin.noise)
    return made.record(
        Origin("kf_cube", twin.seed, same, declared),
        p.body.places(FIDUCIALS),
        twin.camera,
        lambda run: {"pull": Reading(run.traces["pull.force"].y, "N")},
        progress,
    )


def truth(p: PulledBlock, seen: Registered) -> Truth:
    """The twin's displacements at the steps, and its fields at 200 of them."""
    made = twin_of(p)
    return truth_of(made.run(output_frames(p.clock.steps, 200)), made.scene)
