"""The same body on another mesh: uniformly refined, or of straight linear cells only."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from validate.arrays import Ints
from validate.scene.mesh import Kind, Mesh, quadratic
from validate.scene.scene import Scene
from validate.scene.shape_functions import CORNERS, LATTICE

# The cells of a quadratic simplex, by the local numbers of its nodes (mesh.EDGES): corners first,
# then what is left in the middle.
_PARTS = {
    2: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    3: (
        (0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3),
        (4, 8, 6, 7), (4, 5, 6, 8), (6, 8, 9, 7), (6, 5, 9, 8),
    ),
}  # fmt: skip
_HALVES = ((0, 2), (2, 1))  # of a quadratic edge


def linear(mesh: Mesh) -> Mesh:
    """The mesh of its vertices alone; linear ones as they are."""
    if mesh.order == 1:
        return mesh
    d = mesh.dimension
    kind: Kind = "hex8" if mesh.bricks else "tri3" if d == 2 else "tet4"
    count = int(mesh.corners.max()) + 1
    facets = {name: f[:, : 4 if mesh.bricks else d] for name, f in mesh.facets.items()}
    return Mesh(mesh.nodes[:count], mesh.corners, kind, facets)


def refined(scene: Scene) -> Scene:
    """Every cell cut into 2^d at the middles of its edges (of hexahedra also of their faces and of
    itself); facet sets and regions follow.

    Cells of linear elements. Raises `SceneError` for quadrilaterals.
    """
    fine = quadratic(linear(scene.mesh))
    d, kind = fine.dimension, linear(scene.mesh).kind
    inside, outside = _PARTS[d], _HALVES if d == 2 else _PARTS[2]
    if fine.bricks:
        inside, outside = _bricks(3), _bricks(2)
    facets = {name: _cut(f, outside) for name, f in fine.facets.items()}
    mesh = Mesh(fine.nodes, _cut(fine.cells, inside), kind, facets)
    each = np.arange(2**d)
    regions = tuple(
        replace(r, cells=(2**d * r.cells[:, None] + each).ravel()) for r in scene.regions
    )
    return replace(scene, body=mesh, regions=regions)


def _bricks(d: int) -> tuple[tuple[int, ...], ...]:
    """The 2^d bricks of a quadratic one, each at a corner, by the local numbers of its nodes."""
    at = {tuple(place): i for i, place in enumerate(LATTICE[d].tolist())}
    corners = CORNERS[d]
    return tuple(tuple(at[tuple((c + q) / 2)] for q in corners) for c in corners)


def _cut(cells: Ints, parts: Sequence[tuple[int, ...]]) -> Ints:
    """All `parts` of the first cell, then those of the second, ..."""
    return np.stack([cells[:, list(part)] for part in parts], axis=1).reshape(-1, len(parts[0]))


def of_element(scene: Scene, element: str) -> Scene:
    """The scene in elements "P1", "MD" (P1, nodal mean dilatation), "P2", "H8" or "Q4"."""
    mesh = linear(scene.mesh)
    if element in ("H8", "Q4"):
        shaped = any(drive.shape is not None for drive in scene.drives)  # node by node
        return scene if shaped else replace(scene, body=mesh)
    return replace(
        scene,
        body=quadratic(mesh) if element == "P2" else mesh,
        dilatation="nodal_mean" if element == "MD" else "pointwise",
    )
