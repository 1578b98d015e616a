"""Block with an inclusion-shaped hole: cells inside are removed, the wall is projected.

The construction of paper 000, section 4.4: a regular mesh of the block, elements with a node in
the inclusion removed, the nodes of the hole moved onto the measured shape. Departures: the grid
lines are graded so that the inclusion's centre keeps its place in the grid wherever it lies in the
block (a centred one gives the regular grid); cells that the projection would flatten or invert are
removed with the inclusion, where the paper does not say what became of them.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Protocol

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import map_coordinates

from validate.arrays import Floats, Ints, checked
from validate.errors import SceneError
from validate.scene.mesh import Mesh, boundary_facets, kuhn_cells, require_positive_cells

# --- Shapes a block can hold: what the mesh asks of any of them, and one made of parallel
# slices.

_TABLE = 400  # places along the axis of the surface's table
_HALVINGS = 45  # of the ray that is cut with the surface


class InclusionShape(Protocol):
    """A closed surface in scene coordinates, m."""

    @property
    def centre(self) -> tuple[float, float, float]:
        """Middle of its bounding box."""

    @property
    def axis(self) -> int:
        """The coordinate axis 0, 1 or 2 nearest to its own."""

    @property
    def reach(self) -> Floats:
        """Half extents (3,) of its bounding box."""

    @property
    def radius(self) -> float:
        """Radius of the circle of its largest section's area."""

    @property
    def volume(self) -> float:
        """m^3."""

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) of points (n, 3), negative inside."""

    def project(self, points: Floats) -> Floats:
        """Points (n, 3) moved onto the surface."""


@dataclass(frozen=True)
class SlicedShape:
    """An inclusion between parallel sections: T_scene_from_stack (4, 4), stack z along the axis.

    positions (n,) m along z, growing; centres (n, 2) m; radii (n, a) m of each section at a equally
    spaced polar angles from x on; ends (2,) m where the inclusion vanishes. Between the sections
    the centre moves linearly and the squared radius as a monotone cubic that is 0 at the ends:
    exact for cylinders, ends of spheres within h^2 / 4 of the squared radius. Every section must be
    star-shaped about its centre. Raises `SceneError` for sections out of order or not positive.
    """

    pose: Floats
    positions: Floats
    centres: Floats
    radii: Floats
    ends: Floats

    def __post_init__(self) -> None:
        n = len(self.positions)
        shapes = {"pose": (4, 4), "positions": (n,), "centres": (n, 2), "ends": (2,)}
        for name, shape in [*shapes.items(), ("radii", (n, None))]:
            value = checked(getattr(self, name), f"slices: {name}", shape, error=SceneError)
            object.__setattr__(self, name, value)
        along = np.concatenate([self.ends[:1], self.positions, self.ends[1:]])
        if n < 2 or (np.diff(along) <= 0).any():
            raise SceneError(
                f"{n} slices between {1e3 * self.ends[0]:.2f} and {1e3 * self.ends[1]:.2f} mm: "
                "expected two or more with increasing positions between the ends"
            )
        if (self.radii <= 0).any() or self.radii.shape[1] < 8:
            raise SceneError(
                f"slices: radii {self.radii.shape}, smallest {1e3 * self.radii.min():.3g} mm; "
                "expected positive radii at 8 or more angles"
            )

    @cached_property
    def _squares(self) -> Floats:
        """Squared radii (_TABLE, a) m^2 at equal steps between the ends."""
        zero = np.zeros((1, self.radii.shape[1]))
        along = np.concatenate([self.ends[:1], self.positions, self.ends[1:]])
        squares = PchipInterpolator(along, np.concatenate([zero, self.radii**2, zero]))
        return np.asarray(np.maximum(squares(np.linspace(self.ends[0], self.ends[1], _TABLE)), 0.0))

    @cached_property
    def volume(self) -> float:
        """m^3 of the surface that `distance` and `project` use."""
        areas = np.pi * self._squares.mean(axis=1)
        return float(np.trapezoid(areas, np.linspace(self.ends[0], self.ends[1], _TABLE)))

    @cached_property
    def radius(self) -> float:
        return float(np.sqrt(self._squares.mean(axis=1).max()))

    @cached_property
    def _box(self) -> Floats:
        points = self.surface()
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @property
    def centre(self) -> tuple[float, float, float]:
        x, y, z = self._box.mean(axis=0).tolist()
        return x, y, z

    @property
    def axis(self) -> int:
        return int(np.argmax(np.abs(self.pose[:3, 2])))

    @property
    def reach(self) -> Floats:
        return np.asarray(np.diff(self._box, axis=0)[0] / 2)

    def surface(self, along: int = 60, around: int = 72) -> Floats:
        """Points (along * around, 3) m of the surface in scene coordinates, denser at the ends."""
        middle, half = self.ends.mean(), np.diff(self.ends)[0] / 2
        z = middle - half * np.cos(np.linspace(0, np.pi, along))
        angle = np.arange(around) * (2 * np.pi / around)
        z, angle = (a.ravel() for a in np.meshgrid(z, angle, indexing="ij"))
        r = self._radius(z, angle)
        xy = self._axis(z) + r[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.column_stack([xy, z]) @ self.pose[:3, :3].T + self.pose[:3, 3]

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) m along the ray from the axis through each point."""
        local, foot = self._with_foot(points)
        away = np.linalg.norm(local - foot, axis=1)
        return np.asarray(away - self._cut(foot, local - foot))

    def project(self, points: Floats) -> Floats:
        """Points (n, 3) moved onto the surface along rays from the axis."""
        local, foot = self._with_foot(points)
        away = local - foot
        length = np.linalg.norm(away, axis=1, keepdims=True)
        moved = foot + self._cut(foot, away)[:, None] * away / np.maximum(length, 1e-300)
        return np.asarray(moved @ self.pose[:3, :3].T + self.pose[:3, 3])

    def _with_foot(self, points: Floats) -> tuple[Floats, Floats]:
        """Points in stack coordinates and the axis point that each belongs to, both (n, 3)."""
        local = (points - self.pose[:3, 3]) @ self.pose[:3, :3]
        cap = min(self.radius, float(np.diff(self.ends)[0]) / 2)
        z = np.clip(local[:, 2], self.ends[0] + cap, self.ends[1] - cap)
        return local, np.column_stack([self._axis(z), z])

    def _axis(self, z: Floats) -> Floats:
        """Centres (n, 2) at z (n,), the outer slices' slope continued beyond them."""
        x = [self._extended(z, self.centres[:, i]) for i in (0, 1)]
        return np.stack(x, axis=1)

    def _extended(self, z: Floats, values: Floats) -> Floats:
        p = self.positions
        i = np.clip(np.searchsorted(p, z) - 1, 0, len(p) - 2)
        return np.asarray(values[i] + (z - p[i]) * (values[i + 1] - values[i]) / (p[i + 1] - p[i]))

    def _radius(self, z: Floats, angle: Floats) -> Floats:
        """Radius (n,) of the surface at z and polar angle; 0 beyond the ends."""
        low, high = self.ends
        count = self.radii.shape[1]
        rows = (z - low) / (high - low) * (_TABLE - 1)
        columns = np.mod(angle, 2 * np.pi) / (2 * np.pi) * count
        table = np.concatenate([self._squares, self._squares[:, :1]], axis=1)
        squares = map_coordinates(table, [rows, columns], order=1, mode="constant", cval=0.0)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    def _inside(self, local: Floats) -> Floats:
        away = local[:, :2] - self._axis(local[:, 2])
        radius = self._radius(local[:, 2], np.arctan2(away[:, 1], away[:, 0]))
        return np.asarray(np.linalg.norm(away, axis=1) < radius)

    def _cut(self, foot: Floats, away: Floats) -> Floats:
        """Distance (n,) from the foot to the surface along `away` (n, 3)."""
        length = np.linalg.norm(away, axis=1, keepdims=True)
        ray = away / np.maximum(length, 1e-300)
        low = np.zeros(len(foot))
        high = np.full(len(foot), 2 * float(self.radii.max()) + float(np.diff(self.ends)[0]))
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            inside = self._inside(foot + middle[:, None] * ray)
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return np.asarray((low + high) / 2)


# -------------------------------------------------------------------------------------------------

_MOST_NODES = 100_000  # before memory is taken: P2 has 8 times as many
_ROUNDS = 6  # of removing flattened cells and projecting again
_FLAT = 1e-3  # a cell smaller than this share of the median one counts as flattened
SIDES = ("x0", "x1", "y0", "y1", "z0", "z1")  # as of `scene.geometries.box`


@dataclass(frozen=True)
class Block:
    """A box from the origin; sizes in m."""

    size_x: float
    size_y: float
    size_z: float

    @property
    def sizes(self) -> Floats:
        return np.array([self.size_x, self.size_y, self.size_z])

    def around(self, grid: tuple[int, int, int], shape: InclusionShape) -> Mesh:
        """Mesh linear tetrahedra around the inclusion; `grid` counts the nodes along x, y, z.

        Facet sets: the six sides as of `scene.geometries.box` and "cavity". Raises `SceneError`
        when the inclusion touches a face, is smaller than an element, or when the projection
        inverts a cell.
        """
        if min(grid) < 4:
            raise SceneError(f"mesh of {grid} nodes: expected at least 4 along each side")
        if int(np.prod(grid)) > _MOST_NODES:
            raise SceneError(
                f"mesh of {grid} nodes: {int(np.prod(grid))} in total; expected at most "
                f"{_MOST_NODES}: use a coarser mesh"
            )
        centre = np.array(shape.centre)
        gaps = np.concatenate([centre - shape.reach, self.sizes - centre - shape.reach])
        faces = [f"{axis} = {end}" for end in ("0", "max") for axis in "xyz"]
        if gaps.min() <= 0:
            raise SceneError(
                f"the inclusion reaches {-1e3 * gaps.min():.3g} mm beyond or touches the face "
                f"{faces[int(gaps.argmin())]} of the block; move or shrink it"
            )
        spacing = np.maximum(centre, self.sizes - centre) * 2 / (np.array(grid) - 1)
        h = float(np.delete(spacing, shape.axis).max())
        if 2 * shape.radius < h:
            raise SceneError(
                f"the inclusion's diameter {2e3 * shape.radius:.3g} mm is smaller than an element "
                f"of {1e3 * h:.3g} mm; refine the mesh"
            )
        lines = []
        for count, size, middle in zip(grid, self.sizes, shape.centre, strict=True):
            s = np.linspace(0, 1, count)
            lines.append(np.where(s <= 0.5, 2 * s * middle, middle + (2 * s - 1) * (size - middle)))
        nodes = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
        cells = kuhn_cells(grid)
        removed = (shape.distance(nodes)[cells] < -1e-9).any(axis=1)
        if not removed.any():
            raise SceneError(
                f"no node of the {grid} mesh lies inside the inclusion of radius "
                f"{1e3 * shape.radius:g} mm; refine the mesh"
            )
        mesh = _projected(nodes, cells[~removed], self, grid, shape)
        require_positive_cells(mesh)
        return mesh


@dataclass(frozen=True)
class Capsule:
    """Cylinder with half-spheres at its ends: centre (3,) m, radius m, length m.

    `axis` 0, 1 or 2: along x, y or z.
    """

    centre: tuple[float, float, float]
    radius: float
    length: float
    axis: int = 1

    def __post_init__(self) -> None:
        if not (self.radius > 0 and self.length >= 2 * self.radius):
            raise SceneError(
                f"inclusion: radius {1e3 * self.radius:g} mm, length {1e3 * self.length:g} mm; "
                "the radius must be positive and the length at least two radii"
            )

    def foot(self, points: Floats) -> Floats:
        """Return the nearest point of the axis segment for every point (n, 3)."""
        half = self.length / 2 - self.radius
        foot = np.tile(np.array(self.centre), (len(points), 1))
        i = self.axis
        foot[:, i] += np.clip(points[:, i] - self.centre[i], -half, half)
        return foot

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) m, negative inside."""
        return np.asarray(np.linalg.norm(points - self.foot(points), axis=1) - self.radius)

    def project(self, points: Floats) -> Floats:
        """Points (n, 3) moved radially onto the surface."""
        foot = self.foot(points)
        away = points - foot
        return np.asarray(foot + self.radius * away / np.linalg.norm(away, axis=1, keepdims=True))

    @property
    def reach(self) -> Floats:
        """Half extents (3,) m."""
        half = np.full(3, self.radius)
        half[self.axis] = self.length / 2
        return half

    @property
    def volume(self) -> float:
        cylinder = np.pi * self.radius**2 * (self.length - 2 * self.radius)
        return float(cylinder + 4 / 3 * np.pi * self.radius**3)


def _projected(
    nodes: Floats, cells: Ints, block: Block, grid: tuple[int, int, int], shape: InclusionShape
) -> Mesh:
    """The cells with their wall on the shape; cells that the move would flatten are removed."""
    for _ in range(_ROUNDS):
        outside = boundary_facets(cells, 3)
        place = np.stack(np.unravel_index(np.arange(len(nodes)), grid), axis=-1)
        last = np.array(grid) - 1
        named, taken = {}, np.zeros(len(outside), dtype=bool)
        for name, (axis, end) in zip(SIDES, product(range(3), (0, 1)), strict=True):
            on = (place[outside, axis] == last[axis] * end).all(axis=1)
            named[name], taken = outside[on], taken | on
        named["cavity"] = outside[~taken]
        wall = np.unique(named["cavity"])
        on_face = ((place[wall] == 0) | (place[wall] == last)).any(axis=1)
        if on_face.any():
            raise SceneError(
                f"the removed inclusion shares {int(on_face.sum())} nodes with the outer faces; "
                "refine the mesh or move the inclusion inward"
            )
        facets = named
        wall = np.unique(facets["cavity"])
        moved = nodes.copy()
        moved[wall] = shape.project(nodes[wall])
        used = np.unique(cells)
        number = np.full(len(moved), -1)
        number[used] = np.arange(len(used))
        mesh = Mesh(moved[used], number[cells], "tet4", {k: number[f] for k, f in facets.items()})
        flat = mesh.cell_volumes() <= _FLAT * np.median(mesh.cell_volumes())
        if not flat.any():
            break
        cells = cells[~flat]
    return mesh
