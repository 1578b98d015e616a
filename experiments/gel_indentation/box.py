"""Boxes in the gel whose faces move as was measured: geometry, settings, scene and registration."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints
from validate.errors import RegistrationError, UsageError
from validate.fem.assembly.locate import Rows
from validate.parameters import known, quantity
from validate.pipeline.experiment.tree import Built, Tree
from validate.recording.types import Recording
from validate.register.markers.displacements import DisplacementObservation
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import grid, member
from validate.scene.mesh import Kind, Mesh
from validate.scene.places import Labelled, nodes_of
from validate.scene.scene import DriveShape, Scene

from .particle_linking import best_neighbours, local_fit, noise
from .particles import files, linked_pair, motion, side_of

Which = Literal["lower", "upper"]

_X, _Y, _Z = (Labelled(f"{axis}0") | Labelled(f"{axis}1") for axis in "xyz")
FACES = (_X | _Y | _Z).faces
_SIZES = ("x", "y", "side", "bottom", "middle", "top")
_FEWEST = 50  # particles to compare
_SMALL, _LARGE = 0.06, 0.2  # strain norms a spacing below the tops of the boxes
_COUNTS = (40, 80, 160, 320, 640)  # neighbours tried at the faces
_SMOOTH = 80  # neighbours of the affine fit that a strain is read from
_WIDE, _FLOOR = 0.5, 2.0  # side of a box over the volume's; spacings from the volume's bottom
_DENSE, _ROOM = 0.6, 2.5  # share of the height with few links lost; spacings that a box is high
_DEEPEST = 0.03  # share of the discs whose middle is the axis


@dataclass(frozen=True)
class GelBoxes:
    """The geometry of a scene: one of two boxes, lower and upper, that a square column is cut into.

    Its mesh begins at the origin, with the sides x0, x1, y0, y1, z0, z1 as facet sets.
    """

    which: Which = quantity("upper", "1", "the box that is predicted")
    x: float | None = quantity(None, "m", "axis of the column; none: where the gel sinks most")
    y: float | None = quantity(None, "m", "as x")
    side: float | None = quantity(None, "m", "of the column; none: half of the volume's")
    bottom: float | None = quantity(
        None, "m", "of the lower box; none: 2 spacings above the lowest"
    )
    middle: float | None = quantity(
        None, "m", "between the boxes; none: a spacing above a strain of .06, or half"
    )
    top: float | None = quantity(None, "m", "of the upper one; none: a spacing above .2")
    clear: float = quantity(
        1.0, "1", "distance from the faces, in spacings, from which particles are compared"
    )
    cells: tuple[int, int] = quantity((8, 4), "1", "cells along a horizontal edge, and upwards")
    element: Kind = quantity("hex27", "1", "hex27 or hex8")

    def resolved(self, folder: Path) -> Mesh:
        low, high = self.ends()
        along, up = self.cells
        mesh = grid(tuple((high - low).tolist()), (along, along, up))
        return mesh.quadratic() if self.element == "hex27" else mesh

    def scaled(self, share: float) -> "GelBoxes":
        along, up = member(self.cells, share)
        return replace(self, cells=(along, up))

    def ends(self) -> tuple[Floats, Floats]:
        """Corners (3,) m of the box; raises `UsageError` for one without volume."""
        x, y, side, bottom, middle, top = (
            known(getattr(self, name), f"body.{name}") for name in _SIZES
        )
        z = (bottom, middle) if self.which == "lower" else (middle, top)
        low = np.array([x - side / 2, y - side / 2, z[0]])
        high = np.array([x + side / 2, y + side / 2, z[1]])
        if (high <= low).any():
            um = [f"{1e6 * v:.1f}" for v in (side, bottom, middle, top)]
            raise UsageError(
                f"the {self.which} box has no volume: side {um[0]} um, heights "
                f"{', '.join(um[1:])} um; they must rise: --set body.middle=50um"
            )
        return low, high


@dataclass(frozen=True)
class GelFaces:
    neighbours: int | None = quantity(
        None, "1", "of the local quadratic at a node; none: those that predict particles left out"
    )
    smoothing: float = quantity(1.0, "1", "times as many of these neighbours")
    first: float = quantity(0.0, "1", "standard deviations of noise added before, a first draw")
    second: float = quantity(0.0, "1", "as first, a second draw")
    third: float = quantity(0.0, "1", "as first, a third draw")

    @property
    def draws(self) -> tuple[float, ...]:
        return self.first, self.second, self.third


@dataclass(frozen=True)
class GelIndentation:
    """`data` is a folder with a pair of MATLAB files; none: the data set's own."""

    faces: GelFaces = GelFaces()
    between: float = quantity(
        0.0, "1", "standard deviation of nu between boxes; 0: found by fitting it in several"
    )
    data: str | None = quantity(None, "1", "folder of the pair; none: VALIDATE_SHARED_DATA")
    before: str | None = quantity(None, "1", "its file before; none: the first of two")
    after: str | None = quantity(None, "1", "its file after; none: the second of two")
    voxel: float | None = quantity(None, "m", "side of a pixel; none: as the data's source says")


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The linked particles of the whole volume."""
    p: GelIndentation = tree.settings
    before, after = files(p.data, (p.before, p.after), folder)
    return (linked_pair(before, after, side_of(p.voxel, before)),)


def stated(recording: Recording) -> Mapping[str, float]:
    """The boxes that the particles suggest, by path.

    Raises `RegistrationError` where strain or links leave no room for two boxes.
    """
    x, u = motion(recording)
    low, size = x.min(axis=0), np.ptp(x, axis=0)
    spacing = float(recording.record("linking")["spacing_m"])
    side = _WIDE * float(size[:2].min())
    room = side / 2 + 2 * spacing
    axis = _axis(x, u, low + room, low + size - room, side / 4)
    bottom = float(low[2]) + _FLOOR * spacing
    within = (np.abs(x[:, :2] - axis) < side / 2).all(axis=1) & (x[:, 2] > bottom)
    highest = float(x[:, 2].max()) - spacing
    middle, top = (
        min(spacing + _height(x, u, np.flatnonzero(within), spacing, strain), highest)
        for strain in (_SMALL, _LARGE)
    )
    if top - middle < _ROOM * spacing:
        middle = (bottom + top) / 2
    if middle - bottom < _ROOM * spacing:
        raise RegistrationError(
            f"heights of {1e6 * bottom:.1f} to {1e6 * top:.1f} um, where the strain norm reaches "
            f"{_LARGE:g}: no room for two boxes of {_ROOM:g} spacings of {1e6 * spacing:.1f} um; "
            "set body.bottom, body.middle and body.top"
        )
    names = {"x": float(axis[0]), "y": float(axis[1]), "side": side}
    names |= {"bottom": bottom, "middle": middle, "top": top}
    return {f"body.{name}": value for name, value in names.items()}


def _axis(x: Floats, u: Floats, low: Floats, high: Floats, reach: float) -> Floats:
    """Middle of the discs of radius `reach` that sink most, of the lower part, where few links are
    lost; a column about it lies inside. Wide discs: a smaller contact beside the indenter, however
    deep, does not draw the axis."""
    dense = x[:, 2] < x[:, 2].min() + _DENSE * np.ptp(x[:, 2])
    plane, sinks = x[dense, :2], u[dense, 2]
    at = plane[((plane >= low[:2]) & (plane <= high[:2])).all(axis=1)]
    around = cKDTree(plane).query_ball_point(at, reach)
    means = np.array([sinks[rows].mean() for rows in around])
    return np.asarray(np.median(at[means <= np.quantile(means, _DEEPEST)], axis=0))


def _height(x: Floats, u: Floats, rows: Ints, spacing: float, strain: float) -> float:
    """The height m up to which 95 % of strain norms stay below `strain`, layer by layer."""
    norms = strain_norms(local_fit(x, u, x[rows], _SMOOTH, 1).slopes)
    z = x[rows, 2]
    heights = np.arange(z.min() + spacing, z.max(), spacing / 4)
    for height in heights:
        layer = norms[(z > height - spacing / 2) & (z < height + spacing / 2)]
        if len(layer) < 5 or np.quantile(layer, 0.95) > strain:
            return float(height)
    return float(heights[-1])


def strain_norms(slopes: Floats) -> Floats:
    """Frobenius norms (k,) of the small strains of displacement gradients (k, 3, 3)."""
    return np.asarray(np.linalg.norm((slopes + slopes.swapaxes(1, 2)) / 2, axis=(1, 2)))


def build(recording: Recording, tree: Tree, changes: Mapping[str, Any] | None) -> Scene:
    """The declared scene; all faces of the box move as the particles there."""
    scene = Built()(recording, tree, changes)
    moved = faces_of(Same(recording), _meshed(tree, scene), tree.settings.faces)
    shape = DriveShape(moved / float(np.abs(moved).max()))
    return replace(scene, drives=tuple(replace(drive, shape=shape) for drive in scene.drives))


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """The faces' largest motion drives; the particles inside are compared, under the box's name."""
    box, end, whose = _meshed(tree, scene), np.array([1.0]), Same(recording)
    moved = faces_of(whose, box, tree.settings.faces)
    most = np.array([[float(np.abs(moved).max())]])
    faces = SignalObservation("faces", "drives", end, most, "m", 0.0)
    seen = inside_of(whose, box)
    hold = Selection(box.which, end, "after indentation")
    told = (_links(recording), _corners(box, tree.settings.faces, whose))
    return Registered((faces, seen), (hold,), findings=told)


def _meshed(tree: Tree, scene: Scene) -> GelBoxes:
    """The box with the elements of a method's scene."""
    box: GelBoxes = tree.scene.body
    return replace(box, element=scene.mesh.kind)


@dataclass(frozen=True)
class Same:
    """A recording that is known again by its hash: what depends on it and the box alone is found
    once, not for every Poisson ratio."""

    recording: Recording = field(compare=False)
    sha256: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sha256", self.recording.source.sha256)


@lru_cache(maxsize=8)
def faces_of(whose: Same, box: GelBoxes, faces: GelFaces) -> Floats:
    """Displacements (k, 3) m of the nodes of the box's faces: local quadratics of the particles
    around."""
    x, u = motion(whose.recording)
    if any(faces.draws):
        _, sd = noise(x, u)
        for seed, share in enumerate(faces.draws, 1):
            u = u + share * sd * np.random.default_rng(seed).standard_normal(u.shape)
    mesh, (low, _) = box.resolved(Path()), box.ends()
    at = mesh.nodes[nodes_of(mesh, FACES)] + low
    count = round((faces.neighbours or neighbours_of(whose, box)) * faces.smoothing)
    return local_fit(x, u, at, count, robust=True).values


@lru_cache(maxsize=32)
def neighbours_of(whose: Same, box: GelBoxes) -> int:
    """Neighbours whose local quadratics predict the particles of the box best that are left out."""
    x, u = motion(whose.recording)
    low, high = box.ends()
    inside = np.flatnonzero(((x > low) & (x < high)).all(axis=1))
    _require(len(inside), box, 0.0)
    return best_neighbours(x, u, inside, _COUNTS)


@lru_cache(maxsize=8)
def inside_of(whose: Same, box: GelBoxes) -> DisplacementObservation:
    """The linked particles in the box, as far off its faces as is asked for.

    Raises `RegistrationError` for too few.
    """
    x, u = motion(whose.recording)
    low, high = box.ends()
    clear = box.clear * float(whose.recording.record("linking")["spacing_m"])
    inside = ((x > low + clear) & (x < high - clear)).all(axis=1)
    _require(int(inside.sum()), box, clear)
    at, mesh = x[inside] - low, box.resolved(Path())
    _, sd = noise(x[inside], u[inside])
    return DisplacementObservation(
        "particles", "validates", np.array([1.0]), at, u[inside], Rows.barycentric(mesh, at), sd,
        "inside",
    )  # fmt: skip


def _require(count: int, box: GelBoxes, clear: float) -> None:
    if count < _FEWEST:
        raise RegistrationError(
            f"{count} linked particles in the {box.which} box more than {1e6 * clear:.1f} um off "
            f"its faces, {_FEWEST} are needed; make it larger: --set body.side=200um"
        )


def _links(recording: Recording) -> str:
    told = recording.record("linking")
    return (
        f"{told['linked']} of {told['before']} particles before are linked with one of the "
        f"{told['after']} after, {told['outliers_cut']} links were cut as outliers; mean spacing "
        f"{1e6 * float(told['spacing_m']):.2f} µm, voxel {1e6 * float(told['voxel_m']):.3g} µm."
    )


def _corners(box: GelBoxes, faces: GelFaces, whose: Same) -> str:
    ends = ", ".join(
        f"{axis} {1e6 * a:.1f} to {1e6 * b:.1f}"
        for axis, a, b in zip("xyz", *box.ends(), strict=True)
    )
    count = faces.neighbours or neighbours_of(whose, box)
    return f"The {box.which} box: {ends} µm; its faces are fitted with {count} neighbours."
