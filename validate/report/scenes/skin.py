"""Surface of a mesh as triangles for display: outside and cavity walls, decimated if large.

A quadratic facet of six nodes is drawn as four triangles through its middles. Thinning lays a grid
over the surface and joins the vertices in one of its boxes to the one nearest their mean, so every
vertex drawn is a node and moves as computed.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.meshless import AnyScene
from validate.scene.shape_functions import EDGES

OUTSIDE = "outside"
_FEWEST = 8  # triangles that a thinned part keeps, to remain a body


@dataclass(frozen=True)
class SurfacePart:
    """One part of a surface: `nodes` (v,) of the mesh, triangles (t, 3) between them.

    `whole` counts the triangles before thinning.
    """

    name: str
    nodes: Ints
    triangles: Ints
    whole: int


def skins(scene: AnyScene, most: int) -> tuple[SurfacePart, ...]:
    """Return the outside and every cavity wall, about `most` triangles in all; none of a 2-D
    mesh."""
    mesh = scene.mesh
    if mesh.dimension != 3:
        return ()
    walls = {c.name: flat_triangles(mesh.facets[c.facets]) for c in scene.cavities}
    six = mesh.surface.shape[1] == 6
    outside = flat_triangles(mesh.surface) if six else boundary_facets(mesh.simplices, 3)
    # `facets` that are in none of the `others`, whatever the order of their corners
    others = list(walls.values())
    taken = {tuple(f) for other in others for f in np.sort(other, axis=1).tolist()}
    kept = [tuple(f) not in taken for f in np.sort(outside, axis=1).tolist()]
    parts = {OUTSIDE: np.asarray(outside[np.array(kept)]), **walls}
    total = sum(len(t) for t in parts.values())
    share = min(1.0, most / total)
    return tuple(_skin(mesh, name, t, share) for name, t in parts.items() if len(t))


def flat_triangles(facets: Ints) -> Ints:
    """Return triangles (t, 3) for facets (f, m): six-node ones as four, others by their corners."""
    if facets.shape[1] != 6:
        return facets[:, :3]
    middle = {frozenset(edge): 3 + i for i, edge in enumerate(EDGES[2])}
    a, b, c = (middle[frozenset(e)] for e in ((0, 1), (1, 2), (0, 2)))
    return facets[:, [[0, a, c], [a, 1, b], [c, b, 2], [a, b, c]]].reshape(-1, 3)


def _skin(mesh: Mesh, name: str, triangles: Ints, share: float) -> SurfacePart:
    drawn = triangles if share >= 1 else _thinned(mesh.nodes, triangles, share)
    nodes, local = np.unique(drawn, return_inverse=True)
    return SurfacePart(name, nodes, local.reshape(-1, 3), len(triangles))


def _thinned(nodes: Floats, triangles: Ints, share: float) -> Ints:
    """Triangles between fewer nodes: `share` of them at most, unless under `_FEWEST` are left."""
    corners = nodes[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1).sum()
    size = float(np.sqrt(2 * area / len(triangles)))  # the legs of an average triangle
    kept = triangles
    while len(kept) > share * len(triangles):
        joined = _joined(nodes, triangles, size)
        if len(joined) < _FEWEST:
            return kept
        kept, size = joined, 1.2 * size
    return kept


def _joined(nodes: Floats, triangles: Ints, size: float) -> Ints:
    used = np.unique(triangles)
    box = np.floor((nodes[used] - nodes[used].min(axis=0)) / size).astype(np.int64)
    _, cluster = np.unique(box, axis=0, return_inverse=True)
    cluster = cluster.ravel()
    count = np.bincount(cluster)
    mean = np.stack([np.bincount(cluster, x) / count for x in nodes[used].T], axis=1)
    off = np.linalg.norm(nodes[used] - mean[cluster], axis=1)
    order = np.lexsort((off, cluster))
    first = order[np.searchsorted(cluster[order], np.arange(len(count)))]
    moved = used[first][cluster][np.searchsorted(used, triangles)]
    a, b, c = moved.T
    kept = moved[(a != b) & (b != c) & (a != c)]
    _, unique = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    return np.asarray(kept[np.sort(unique)])
