"""A block with an inclusion-shaped hole: tetrahedra inside are removed, the wall is projected.

The construction of paper 000, section 4.4: a regular mesh of the block, elements with a node in
the inclusion removed, the nodes of the hole moved onto the measured shape. Departures: the grid
lines are graded so that the inclusion's centre keeps its place in the grid wherever it lies in the
block (a centred one gives the regular grid); cells that the projection would flatten or invert are
removed with the inclusion, where the paper does not say what became of them.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.inclusion_shape import InclusionShape
from validate.scene.mesh import (
    Mesh,
    boundary_facets,
    cell_volumes,
    kuhn_cells,
    require_positive_cells,
)

_MOST_NODES = 100_000  # before memory is taken: P2 has 8 times as many
_ROUNDS = 6  # of removing flattened cells and projecting again
_FLAT = 1e-3  # a cell smaller than this share of the median one counts as flattened
SIDES = ("x0", "x1", "y0", "y1", "z0", "z1")  # as of `scene.box`


@dataclass(frozen=True)
class Block:
    """A box from the origin; sizes in m."""

    size_x: float
    size_y: float
    size_z: float

    @property
    def sizes(self) -> Floats:
        return np.array([self.size_x, self.size_y, self.size_z])


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
        """The nearest point of the axis segment for every point (n, 3)."""
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


def block_with_inclusion(block: Block, grid: tuple[int, int, int], shape: InclusionShape) -> Mesh:
    """Linear tetrahedra around the inclusion; `grid` counts the nodes along x, y, z.

    Facet sets: the six sides as of `scene.box` and "cavity". Raises `SceneError` when the inclusion
    touches a face, is smaller than an element, or when the projection inverts a cell.
    """
    if min(grid) < 4:
        raise SceneError(f"mesh of {grid} nodes: expected at least 4 along each side")
    if int(np.prod(grid)) > _MOST_NODES:
        raise SceneError(
            f"mesh of {grid} nodes: {int(np.prod(grid))} in total; expected at most "
            f"{_MOST_NODES}: use a coarser mesh"
        )
    _require_inside(block, shape)
    _require_resolved(block, grid, shape)
    nodes = _graded_grid(block, grid, shape)
    cells = kuhn_cells(grid)
    removed = (shape.distance(nodes)[cells] < -1e-9).any(axis=1)
    if not removed.any():
        raise SceneError(
            f"no node of the {grid} mesh lies inside the inclusion of radius "
            f"{1e3 * shape.radius:g} mm; refine the mesh"
        )
    mesh = _projected(nodes, cells[~removed], block, grid, shape)
    require_positive_cells(mesh)
    return mesh


def _projected(
    nodes: Floats, cells: Ints, block: Block, grid: tuple[int, int, int], shape: InclusionShape
) -> Mesh:
    """The cells with their wall on the shape; cells that the move would flatten are removed."""
    for _ in range(_ROUNDS):
        facets = _named_facets(nodes, cells, block, grid)
        wall = np.unique(facets["cavity"])
        moved = nodes.copy()
        moved[wall] = shape.project(nodes[wall])
        mesh = _compact(moved, cells, facets)
        flat = cell_volumes(mesh) <= _FLAT * np.median(cell_volumes(mesh))
        if not flat.any():
            break
        cells = cells[~flat]
    return mesh


def _require_inside(block: Block, shape: InclusionShape) -> None:
    centre = np.array(shape.centre)
    gaps = np.concatenate([centre - shape.reach, block.sizes - centre - shape.reach])
    faces = [f"{axis} = {end}" for end in ("0", "max") for axis in "xyz"]
    if gaps.min() <= 0:
        raise SceneError(
            f"the inclusion reaches {-1e3 * gaps.min():.3g} mm beyond or touches the face "
            f"{faces[int(gaps.argmin())]} of the block; move or shrink it"
        )


def _require_resolved(block: Block, grid: tuple[int, int, int], shape: InclusionShape) -> None:
    centre = np.array(shape.centre)
    spacing = np.maximum(centre, block.sizes - centre) * 2 / (np.array(grid) - 1)
    h = float(np.delete(spacing, shape.axis).max())
    if 2 * shape.radius < h:
        raise SceneError(
            f"the inclusion's diameter {2e3 * shape.radius:.3g} mm is smaller than an element of "
            f"{1e3 * h:.3g} mm; refine the mesh"
        )


def _graded_grid(block: Block, grid: tuple[int, int, int], shape: InclusionShape) -> Floats:
    lines = []
    for count, size, centre in zip(grid, block.sizes, shape.centre, strict=True):
        s = np.linspace(0, 1, count)
        lines.append(np.where(s <= 0.5, 2 * s * centre, centre + (2 * s - 1) * (size - centre)))
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)


def _named_facets(
    nodes: Floats, cells: Ints, block: Block, grid: tuple[int, int, int]
) -> dict[str, Ints]:
    outside = boundary_facets(cells, 3)
    place = np.stack(np.unravel_index(np.arange(len(nodes)), grid), axis=-1)
    last = np.array(grid) - 1
    named, taken = {}, np.zeros(len(outside), dtype=bool)
    for name, (axis, end) in zip(SIDES, product(range(3), (0, 1)), strict=True):
        on = (place[outside, axis] == last[axis] * end).all(axis=1)
        named[name], taken = outside[on], taken | on
    named["cavity"] = outside[~taken]
    _require_apart(named, place, last)
    return named


def _require_apart(named: dict[str, Ints], place: Ints, last: Ints) -> None:
    wall = np.unique(named["cavity"])
    on_face = ((place[wall] == 0) | (place[wall] == last)).any(axis=1)
    if on_face.any():
        raise SceneError(
            f"the removed inclusion shares {int(on_face.sum())} nodes with the outer faces; "
            "refine the mesh or move the inclusion inward"
        )


def _compact(nodes: Floats, cells: Ints, facets: dict[str, Ints]) -> Mesh:
    used = np.unique(cells)
    number = np.full(len(nodes), -1)
    number[used] = np.arange(len(used))
    return Mesh(nodes[used], number[cells], "tet4", {k: number[f] for k, f in facets.items()})
