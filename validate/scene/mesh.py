"""Meshes: nodes, cells and named facet sets, linear or quadratic.

Conventions: cells are positively oriented; facets are oriented outward from the solid; quadratic
meshes list the vertices first, then one node per edge at its midpoint (straight edges), in the
local order of `EDGES`; hex27 has nodes in the middles of faces and cells, too (`LATTICE`).
Corners of quad4, hex8 and hex27 run as in `scene.shape_functions`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import permutations
from types import MappingProxyType
from typing import Literal

import numpy as np

from validate.arrays import Floats, Ints, checked, checked_indices
from validate.display import brief
from validate.errors import SceneError
from validate.memory import require_memory
from validate.scene.shape_functions import (
    CORNERS,
    EDGES,
    LATTICE,
    brick_rule,
    brick_values,
    gauss_points,
)

_NODE_BYTES = {1: 1e3, 2: 1e3, 3: 4e3}  # at the peak while a grid is made: 712, 3 400 to 3 700
Kind = Literal["tri3", "tri6", "tet4", "tet10", "quad4", "hex8", "hex27"]
DIMENSION: Mapping[str, int] = {
    "tri3": 2, "tri6": 2, "tet4": 3, "tet10": 3, "quad4": 2, "hex8": 3, "hex27": 3,
}  # fmt: skip
ORDER: Mapping[str, int] = {
    "tri3": 1, "tri6": 2, "tet4": 1, "tet10": 2, "quad4": 1, "hex8": 1, "hex27": 2,
}  # fmt: skip
# Nodes of a cell and of a facet.
_NODES: Mapping[str, tuple[int, int]] = {
    "tri3": (3, 2), "tri6": (6, 3), "tet4": (4, 3), "tet10": (10, 6), "quad4": (4, 2),
    "hex8": (8, 4), "hex27": (27, 9),
}  # fmt: skip
# Outward facets by dimension and nodes of a cell.
_FACETS: dict[tuple[int, int], tuple[tuple[int, ...], ...]] = {
    (2, 3): ((0, 1), (1, 2), (2, 0)),
    (2, 4): ((0, 1), (1, 2), (2, 3), (3, 0)),
    (3, 4): ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
    (3, 8): (
        (0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)
    ),
}  # fmt: skip


def _lattice_facet(corners: tuple[int, ...]) -> tuple[int, ...]:
    """The nodes of a quadratic hexahedron on the face between those corners."""
    on_face = brick_values(LATTICE[2]) @ CORNERS[3][list(corners)]
    places = LATTICE[3].tolist()
    return tuple(places.index(place) for place in on_face.tolist())


_FACETS[3, 27] = tuple(_lattice_facet(f) for f in _FACETS[3, 8])
# Kuhn's split of a brick along its diagonal, positively oriented, by dimension.
_SIMPLICES: Mapping[int, tuple[tuple[int, ...], ...]] = {
    2: ((0, 1, 2), (0, 2, 3)),
    3: (
        (0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Mesh:
    """nodes (n, d) m, cells (e, k), facets by set name (f, m)."""

    nodes: Floats
    cells: Ints
    kind: Kind
    facets: Mapping[str, Ints] = field(default_factory=dict)

    __repr__ = brief

    def __post_init__(self) -> None:
        d, (per_cell, per_facet) = DIMENSION[self.kind], _NODES[self.kind]
        nodes = checked(self.nodes, "mesh nodes [m]", (None, d), error=SceneError)
        n = len(nodes)
        cells = checked_indices(self.cells, "cells", (None, per_cell), n, error=SceneError)
        facets = {
            name: checked_indices(f, f"facets '{name}'", (None, per_facet), n, error=SceneError)
            for name, f in self.facets.items()
        }
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "facets", MappingProxyType(facets))

    @property
    def dimension(self) -> int:
        return DIMENSION[self.kind]

    @property
    def order(self) -> int:
        return ORDER[self.kind]

    @property
    def bricks(self) -> bool:
        """Whether the cells are quadrilaterals or hexahedra rather than simplices."""
        return self.kind in ("quad4", "hex8", "hex27")

    @property
    def corners(self) -> Ints:
        """The vertices of every cell (e, d + 1), of bricks (e, 2^d)."""
        return self.cells[:, : 2**self.dimension if self.bricks else self.dimension + 1]

    @property
    def simplices(self) -> Ints:
        """The vertices of simplices (s, d + 1) that fill the mesh: bricks split, for drawing.

        Neighbouring hexahedra meet along the same diagonals only in meshes of one orientation, as
        `scene.geometries.box.grid` makes them.
        """
        if not self.bricks:
            return self.corners
        split = np.array(_SIMPLICES[self.dimension])
        return self.cells[:, split].reshape(-1, self.dimension + 1)

    @cached_property
    def surface(self) -> Ints:
        """Facets (f, m) that belong to one cell only, oriented outward, middles included."""
        if self.order == 1 or self.bricks:
            return boundary_facets(self.cells, self.dimension)
        outside = boundary_facets(self.corners, self.dimension)
        d, n = self.dimension, len(self.nodes)
        ends = np.sort(self.cells[:, list(EDGES[d])], axis=2)
        key, first = np.unique(ends[..., 0] * n + ends[..., 1], return_index=True)
        middle = self.cells[:, d + 1 :].ravel()[first]
        around = np.sort(outside[:, list(EDGES[d - 1])], axis=2)
        found = np.searchsorted(key, around[..., 0] * n + around[..., 1])
        return np.hstack([outside, middle[found]])

    def facet_nodes(self, name: str) -> Ints:
        """Sorted node numbers of a facet set; raises `SceneError` when it is absent or empty."""
        facets = self.facets.get(name)
        if facets is None or len(facets) == 0:
            raise SceneError(f"mesh has no facets '{name}'; it has {sorted(self.facets)}")
        return np.unique(facets)

    def nearest_node(self, point: Floats) -> int:
        return int(np.argmin(np.linalg.norm(self.nodes - point, axis=1)))

    def cell_volumes(self) -> Floats:
        """Return the signed volume (area in 2-D) of every cell (e,), from its vertices; bricks by
        quadrature."""
        x = self.nodes[self.corners]
        if self.bricks:
            rule = brick_rule(*gauss_points(self.dimension, 2))
            return np.asarray(np.linalg.det(rule.jacobians(x)) @ rule.weights)
        size = {2: 2.0, 3: 6.0}[self.dimension]
        return np.asarray(np.linalg.det(x[:, 1:] - x[:, :1]) / size)

    def quadratic(self) -> "Mesh":
        """Return the mesh with a node in the middle of every edge (tri3 -> tri6, tet4 -> tet10), of
        hexahedra also of every face and cell (hex8 -> hex27). `SceneError` for quadrilaterals."""
        if self.order == 2:
            return self
        if self.kind == "quad4":
            raise SceneError("elements of kind quad4 have no quadratic form; use simplices")
        if self.bricks:
            # Every new node once: it is known by the corners of the edge, face or cell it is in.
            n, keys = len(self.nodes), _middle_keys(self.cells, 3)
            known, first, number = np.unique(
                keys.reshape(-1, 8), axis=0, return_index=True, return_inverse=True
            )
            shares = brick_values(LATTICE[3][8:])
            nodes = np.einsum("ma,eai->emi", shares, self.nodes[self.cells]).reshape(-1, 3)[first]
            cells = np.hstack([self.cells, n + number.reshape(len(self.cells), -1)])
            at = {tuple(key): n + i for i, key in enumerate(known.tolist())}
            facets = {name: _with_all_middles(f, at) for name, f in self.facets.items()}
            return Mesh(np.vstack([self.nodes, nodes]), cells, "hex27", facets)
        d, n = self.dimension, len(self.nodes)
        ends = np.sort(self.cells[:, list(EDGES[d])].reshape(-1, 2), axis=1)
        edges, number = np.unique(ends, axis=0, return_inverse=True)
        middle = self.nodes[edges].mean(axis=1)
        cells = np.hstack([self.cells, n + number.reshape(len(self.cells), -1)])
        key = edges[:, 0] * n + edges[:, 1]
        facets = {name: _with_middles(f, key, n) for name, f in self.facets.items()}
        kind: Kind = "tri6" if d == 2 else "tet10"
        return Mesh(np.vstack([self.nodes, middle]), cells, kind, facets)


def require_positive_cells(
    mesh: Mesh, advice: str = "refine the mesh or move the inclusion"
) -> None:
    """Raise `SceneError` naming the worst cell when any volume is not clearly positive."""
    # Signed volume (e,) of every cell as its worst corner has it: bricks may fold over there.
    if not mesh.bricks:
        volumes = mesh.cell_volumes()
    else:
        corners = CORNERS[mesh.dimension]
        at_corners = brick_rule(corners, np.zeros(len(corners)))
        volumes = np.asarray(
            np.linalg.det(at_corners.jacobians(mesh.nodes[mesh.corners])).min(axis=1)
        )
    bad = volumes <= 1e-9 * np.abs(volumes).mean()
    if bad.any():
        worst = int(np.argmin(volumes))
        centre = mesh.nodes[mesh.corners[worst]].mean(axis=0)
        at = ", ".join(f"{1e3 * c:.2f}" for c in centre)
        raise SceneError(
            f"{int(bad.sum())} of {len(volumes)} elements inverted or flat, worst element {worst} "
            f"with {1e9 * volumes[worst]:.4g} mm3 at ({at}) mm; {advice}"
        )


def require_nodes(shape: tuple[int, ...]) -> None:
    """Raise `MemoryShortError` where a mesh of a grid of `shape` nodes has no room."""
    count = math.prod(shape)
    require_memory(_NODE_BYTES[len(shape)] * count, f"mesh of {count:.4g} nodes")


def kuhn_cells(shape: tuple[int, ...]) -> Ints:
    """Simplices of a structured grid of `shape` nodes, all along one diagonal: 2 triangles or
    6 tetrahedra per box (Kuhn's split), node (i, j, k) numbered with the last index fastest.

    Raises `MemoryShortError` for more than fit.
    """
    require_nodes(shape)
    numbers = np.arange(np.prod(shape)).reshape(shape)
    base = numbers[tuple(slice(0, -1) for _ in shape)].ravel()
    strides = [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]
    cells = []
    for order in permutations(range(len(shape))):
        steps = np.cumsum([0, *(strides[axis] for axis in order)])
        corners = base[:, None] + steps
        if np.linalg.det(np.eye(len(shape))[list(order)]) < 0:
            corners[:, [-2, -1]] = corners[:, [-1, -2]]
        cells.append(corners)
    return np.vstack(cells)


def boundary_facets(corners: Ints, dimension: int) -> Ints:
    """Facets (f, d), of hexahedra (f, 4), that belong to one cell only, oriented outward.

    From all nodes of hex27, not just the corners, facets (f, 9) with all of theirs.
    """
    known = _FACETS[dimension, corners.shape[1]]
    facets = np.vstack([corners[:, list(local)] for local in known])
    _, first, count = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True
    )
    outside: Ints = facets[first[count == 1]]
    return outside


def _with_middles(facets: Ints, key: Ints, n: int) -> Ints:
    local = ((0, 1),) if facets.shape[1] == 2 else EDGES[2]
    ends = np.sort(facets[:, list(local)], axis=2)
    middles = n + np.searchsorted(key, ends[..., 0] * n + ends[..., 1])
    return np.hstack([facets, middles])


def _middle_keys(corners: Ints, d: int) -> Ints:
    """The sorted corners (e, m, 8) that each middle node of bricks (e, 2^d) lies between."""
    between = brick_values(LATTICE[d][2**d :]) > 0
    keys = np.where(between, corners[:, None], -1)
    padded = np.full((*keys.shape[:2], 8), -1)
    padded[..., : keys.shape[2]] = keys
    return np.sort(padded, axis=2)


def _with_all_middles(facets: Ints, at: Mapping[tuple[int, ...], int]) -> Ints:
    keys = _middle_keys(facets, 2)
    middles = [[at[tuple(key)] for key in facet] for facet in keys.tolist()]
    return np.hstack([facets, np.array(middles).reshape(len(facets), 5)])
