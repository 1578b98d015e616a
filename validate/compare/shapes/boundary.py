"""Boundary of a deformed body: segments in the plane, triangles in space.

Quadratic facets become the pieces between their nodes (2 segments, 4 triangles); a quadrilateral
facet becomes 4 triangles round its middle, which enclose the volume under its bilinear patch; one
with nine nodes is four quadrilaterals.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints, checked
from validate.errors import ComparisonError
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.shape_functions import EDGES

_PIECES = {
    2: ((0, 1),),
    3: ((0, 1, 2),),
    6: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}
_QUARTERS = ((0, 5, 8, 4), (5, 1, 7, 8), (8, 7, 2, 6), (4, 8, 6, 3))  # as in LATTICE
_SEGMENTS = ((0, 2), (2, 1))  # an edge with its middle node


@dataclass(frozen=True)
class Boundary:
    """points (p, d) m of a closed boundary, pieces (s, d) oriented outward, by point number."""

    points: Floats
    pieces: Ints


def deformed_boundary(mesh: Mesh, nodal: Floats) -> Boundary:
    """Return the boundary of a mesh whose nodes moved to `nodal` (n, d) m.

    Point and piece numbers depend on the mesh alone: two skins of one mesh correspond.
    """
    facets = _boundary(mesh)
    if facets.shape[1] == 9:
        facets = facets[:, np.array(_QUARTERS)].reshape(-1, 4)
    if facets.shape[1] == 4:
        middles = len(nodal) + np.arange(len(facets))
        around = [np.stack([facets[:, i], facets[:, (i + 1) % 4], middles], 1) for i in range(4)]
        return _used(np.vstack([nodal, nodal[facets].mean(axis=1)]), np.vstack(around))
    per_facet = facets.shape[1]
    edge_with_middle = mesh.dimension == 2 and per_facet == 3
    local = _SEGMENTS if edge_with_middle else _PIECES[per_facet]
    return _used(nodal, np.vstack([facets[:, list(piece)] for piece in local]))


def outline_boundary(outline: Floats) -> Boundary:
    """Return a closed curve (k, 2) m, recorded or drawn, as a boundary; its sense is turned
    outward."""
    points = checked(outline, "outline [m]", (None, 2), error=ComparisonError)
    if len(points) < 3:
        raise ComparisonError(f"an outline of {len(points)} points encloses nothing; 3 are needed")
    number = np.arange(len(points))
    closed = Boundary(points, np.stack([number, np.roll(number, -1)], axis=1))
    return closed if enclosed(closed) > 0 else Boundary(points, closed.pieces[:, ::-1])


def enclosed(boundary: Boundary) -> float:
    """Signed area m^2 or volume m^3 inside; negative when the boundary points inward."""
    x = boundary.points - boundary.points.mean(axis=0)
    size = {2: 2.0, 3: 6.0}[x.shape[1]]
    return float(np.linalg.det(x[boundary.pieces]).sum() / size)


def normals(boundary: Boundary) -> Floats:
    """Outward normals (s, d) with the length m or area m^2 of the piece as their length."""
    x = boundary.points[boundary.pieces]
    if x.shape[2] == 2:
        along = x[:, 1] - x[:, 0]
        return np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2)


def _used(points: Floats, pieces: Ints) -> Boundary:
    used, number = np.unique(pieces, return_inverse=True)
    return Boundary(np.asarray(points[used]), number.reshape(pieces.shape))


def _boundary(mesh: Mesh) -> Ints:
    """Boundary facets with all their nodes, oriented outward."""
    if mesh.order == 1 or mesh.bricks:
        return boundary_facets(mesh.cells, mesh.dimension)
    facets = boundary_facets(mesh.corners, mesh.dimension)
    ends = np.sort(mesh.cells[:, list(EDGES[mesh.dimension])].reshape(-1, 2), axis=1)
    middle = mesh.cells[:, mesh.dimension + 1 :].ravel()
    n = len(mesh.nodes)
    key, first = np.unique(ends[:, 0] * n + ends[:, 1], return_index=True)
    local = ((0, 1),) if mesh.dimension == 2 else EDGES[2]
    wanted = np.sort(facets[:, list(local)], axis=2)
    found = middle[first[np.searchsorted(key, wanted[..., 0] * n + wanted[..., 1])]]
    return np.hstack([facets, found])
