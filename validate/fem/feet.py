"""The nearest points of a body's surface."""

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats
from validate.scene.mesh import Mesh

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
