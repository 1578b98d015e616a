"""Interpolation rows: displacement at any point as weighted sum of nodal displacements."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints, checked
from validate.errors import RegistrationError, SceneError
from validate.scene.mesh import Mesh
from validate.scene.scene import Probe
from validate.scene.shape_functions import (
    barycentric,
    brick_slopes,
    brick_values,
    simplex_values,
)

# --- The nearest points of a body's surface.

_EDGES = ((0, 1), (1, 2), (2, 0))


def nearest_on_surface(mesh: Mesh, points: Floats) -> Floats:
    """Feet (k, 3) m of points on the flat facets of tetrahedra.

    The facet of the nearest middle bounds the distance; no facet whose middle is further off than
    that and the largest facet's radius can be nearer.
    """
    corners = mesh.nodes[mesh.surface[:, :3]]
    middles = corners.mean(axis=1)
    tree, radius = cKDTree(middles), np.linalg.norm(corners - middles[:, None], axis=2).max()
    feet = np.empty_like(points)
    firsts = np.asarray(tree.query(points)[1])
    for i, (p, first) in enumerate(zip(points, firsts, strict=True)):
        bound = float(np.linalg.norm(_on_triangles(corners[[first]], p)[0] - p))
        found = _on_triangles(corners[tree.query_ball_point(p, 1.001 * (bound + radius))], p)
        feet[i] = found[np.linalg.norm(found - p, axis=1).argmin()]
    return feet


def _on_triangles(x: Floats, p: Floats) -> Floats:
    """The nearest point of triangles (..., 3, 3) to p (..., 3): in the face, else on an edge."""
    a, u, v = x[..., 0, :], x[..., 1, :] - x[..., 0, :], x[..., 2, :] - x[..., 0, :]
    w = p - a
    uu, uv, vv = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
    wu, wv = (w * u).sum(-1), (w * v).sum(-1)
    area = np.maximum(uu * vv - uv**2, 1e-300)
    s, t = (vv * wu - uv * wv) / area, (uu * wv - uv * wu) / area
    inside = (s >= 0) & (t >= 0) & (s + t <= 1)
    found = a + s[..., None] * u + t[..., None] * v
    shortest = np.where(inside, np.linalg.norm(found - p, axis=-1), np.inf)
    for i, j in _EDGES:
        start, way = x[..., i, :], x[..., j, :] - x[..., i, :]
        share = ((p - start) * way).sum(-1) / np.maximum((way * way).sum(-1), 1e-300)
        foot = start + np.clip(share, 0, 1)[..., None] * way
        far = np.linalg.norm(foot - p, axis=-1)
        found = np.where((far < shortest)[..., None], foot, found)
        shortest = np.minimum(far, shortest)
    return np.asarray(found)


# -------------------------------------------------------------------------------------------------

_CANDIDATES = 24  # nearest cell centres tried per point
_ROUNDING = 1e-12  # of the body's size: how far off the surface a point within it may seem
_INVERSIONS = 12  # Newton steps to a brick's local coordinates; a parallelepiped takes one
_STRAY = 4.0  # how far outside its unit cell such a step may go: a brick's map folds further out


@dataclass(frozen=True)
class Rows:
    """weights (k, n): value at a point = row @ nodal values; `outside` (k,) m from the mesh."""

    weights: sparse.csr_array
    outside: Floats

    def apply(self, nodal: Floats) -> Floats:
        """Values (k, d) at the points from nodal values (n, d)."""
        return np.asarray(self.weights @ nodal)

    @classmethod
    def barycentric(cls, mesh: Mesh, points: Floats) -> Self:
        """Return rows of the cell that holds each point (k, d) m, or of the nearest cell, clipped
        to it.

        Raises `SceneError` for points of another shape, or that are not finite.
        """
        points = checked(points, "points [m]", (None, mesh.dimension), error=SceneError)
        if mesh.bricks:
            cells = _near_cells(mesh, points)
            x = mesh.nodes[mesh.corners[cells]]
            flat, each = x.reshape(-1, *x.shape[2:]), np.repeat(points, cells.shape[1], axis=0)
            xi = np.clip(_local(flat, each), 0.0, 1.0)
            feet = np.einsum("ka,kad->kd", brick_values(xi), flat)
            away = np.linalg.norm(each - feet, axis=1).reshape(cells.shape)
            # Judged by the feet: where a step to local coordinates has strayed, they say nothing.
            best, pick = np.argmin(away, axis=1), np.arange(len(points))
            weights = brick_values(xi.reshape(*cells.shape, -1)[pick, best], mesh.order)
            return cls(_csr(mesh.cells[cells[pick, best]], weights, mesh), away[pick, best])
        L, cell = _barycentric(mesh, points)
        clipped = np.clip(L, 0, None)
        clipped /= clipped.sum(axis=1, keepdims=True)
        corners = mesh.nodes[mesh.corners[cell]]
        feet = np.einsum("ka,kad->kd", clipped, corners)
        weights = simplex_values(mesh.order, clipped)
        return cls(_csr(mesh.cells[cell], weights, mesh), np.linalg.norm(points - feet, axis=1))

    @classmethod
    def standing(cls, mesh: Mesh, points: Floats) -> Self:
        """Return rows of points off the surface, as markers on stalks: each moves with its foot,
        the nearest point of the surface (of bricks: of the nearest cell), and turns with the cell
        below it, by the slope of the affine field (least squares) of its nodes. Points within the
        mesh are read as `barycentric` does.
        """
        rows = Rows.barycentric(mesh, points)
        off = rows.outside > _ROUNDING * float(np.ptp(mesh.nodes, axis=0).max())
        if off.any() and not mesh.bricks and mesh.dimension == 3:
            below = np.where(off[:, None], nearest_on_surface(mesh, points), points)
            rows = cls(
                Rows.barycentric(mesh, below).weights, np.linalg.norm(points - below, axis=1)
            )
        weights, feet = rows.weights.copy(), rows.apply(mesh.nodes)
        for i in np.flatnonzero(off):
            own = slice(weights.indptr[i], weights.indptr[i + 1])  # all nodes of the cell
            x = mesh.nodes[weights.indices[own]]
            affine = np.linalg.pinv(np.column_stack([np.ones(len(x)), x - x.mean(axis=0)]))
            weights.data[own] += (points[i] - feet[i]) @ affine[1:]
        return cls(weights, rows.outside)


def probe_rows(mesh: Mesh, probes: Sequence[Probe]) -> Rows:
    """Rows of probes, in their order."""
    points = np.array([p.point for p in probes])
    return (Rows.standing if any(p.stands for p in probes) else Rows.barycentric)(mesh, points)


def nearest_node_rows(mesh: Mesh, points: Floats, among: Ints | None = None) -> Rows:
    """Rows that read the node nearest to each point, of all or `among` some (paper 000, 4.5)."""
    nodes = np.arange(len(mesh.nodes)) if among is None else among
    distance, nearest = cKDTree(mesh.nodes[nodes]).query(points)
    ones = np.ones((len(points), 1))
    return Rows(_csr(nodes[np.asarray(nearest)][:, None], ones, mesh), np.asarray(distance))


def facet_samples(mesh: Mesh, facets: Ints, parts: int) -> tuple[Rows, Ints]:
    """Every facet split into parts^2 triangles: rows of the sample points and triangles (t, 3)."""
    grid = [(i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]
    number = {ij: k for k, ij in enumerate(grid)}
    L = barycentric(np.array(grid) / parts)
    small = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in grid if i + j < parts]
    small += [
        (number[i + 1, j], number[i + 1, j + 1], number[i, j + 1])
        for i, j in grid
        if i + j < parts - 1
    ]
    values = np.tile(simplex_values(mesh.order, L), (len(facets), 1))
    nodes = np.repeat(facets, len(grid), axis=0)
    first = len(grid) * np.arange(len(facets))[:, None, None]
    triangles = (first + np.array(small)[None]).reshape(-1, 3)
    return Rows(_csr(nodes, values, mesh), np.zeros(len(nodes))), triangles


def _barycentric(mesh: Mesh, points: Floats) -> tuple[Floats, Ints]:
    x, cells = mesh.nodes[mesh.corners], _near_cells(mesh, points)
    edges = np.swapaxes(x[cells, 1:] - x[cells, :1], -1, -2)
    rest = np.linalg.solve(edges, (points[:, None] - x[cells, 0])[..., None])[..., 0]
    L = np.concatenate([1 - rest.sum(axis=-1, keepdims=True), rest], axis=-1)
    best = np.argmax(L.min(axis=-1), axis=1)
    pick = np.arange(len(points))
    return L[pick, best], cells[pick, best]


def _near_cells(mesh: Mesh, points: Floats) -> Ints:
    """The cells (k, c) whose centres are nearest to each point."""
    near = min(_CANDIDATES, len(mesh.cells))
    _, cells = cKDTree(mesh.nodes[mesh.corners].mean(axis=1)).query(points, k=near)
    return np.asarray(cells).reshape(len(points), near)


def _local(x: Floats, points: Floats) -> Floats:
    """Local coordinates (k, d) of points (k, d) in the bricks of corners x (k, 2^d, d)."""
    xi = np.full(points.shape, 0.5)
    for _ in range(_INVERSIONS):
        missed = points - np.einsum("ka,kad->kd", brick_values(xi), x)
        J = np.einsum("kad,kaj->kdj", x, brick_slopes(xi))
        xi = np.clip(xi + np.linalg.solve(J, missed[..., None])[..., 0], -_STRAY, 1 + _STRAY)
    return xi


def _csr(nodes: Ints, weights: Floats, mesh: Mesh) -> sparse.csr_array:
    rows = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    shape = (len(nodes), len(mesh.nodes))
    return sparse.csr_array((weights.ravel(), (rows, nodes.ravel())), shape=shape)


def require_inside(rows: Rows, names: tuple[str, ...], limit: float) -> None:
    """Raise `RegistrationError` naming the points further than `limit` m from the mesh."""
    far = np.flatnonzero(rows.outside > limit)
    if len(far):
        worst = far[int(np.argmax(rows.outside[far]))]
        raise RegistrationError(
            f"{len(far)} of {len(names)} points lie outside the mesh, '{names[worst]}' by "
            f"{1e3 * rows.outside[worst]:.2f} mm; check the frame and the units"
        )
