"""Where the path of a tip enters a surface: the first facet that it crosses from outside."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.compiled import compiled
from validate.scene.shape_functions import simplex_values

_EDGE = 1e-9  # of a facet: a path through an edge belongs to one of its two facets


@dataclass(frozen=True)
class Entry:
    """Nodes (m,) of the facet with their shares (m,) at the point; outward unit `normal` (d,)."""

    nodes: Ints
    shares: Floats
    normal: Floats


@dataclass(frozen=True)
class Surface:
    """Facets (f, m) in numbers of the positions that `entered` is given, out of the solid."""

    facets: Ints
    dimension: int

    def __post_init__(self) -> None:
        d, nodes = self.dimension, self.facets.shape[1]
        if nodes not in (d, d * (d + 1) // 2):
            raise SceneError(f"facets of {nodes} nodes in {d}-D: a needle touches simplices")

    def entered(self, x: Floats, start: Floats, end: Floats) -> Entry | None:
        """The first crossing from outside on the way from `start` to `end` (d,) m, among corners at
        x (n, d) m; None without one."""
        d = self.dimension
        corners = self.facets[:, :d]
        search = _crossed_triangle if d == 3 else _crossed_edge
        index, L = search(x, corners, start, end)
        if index < 0:
            return None
        nodes = self.facets[index]
        shares = simplex_values(1 if len(nodes) == d else 2, L[None])[0]
        return Entry(nodes, np.asarray(shares), _normal(x[corners[index]]))


def _normal(x: Floats) -> Floats:
    if len(x) == 2:
        along = x[1] - x[0]
        normal = np.array([along[1], -along[0]])
    else:
        normal = np.cross(x[1] - x[0], x[2] - x[0])
    return np.asarray(normal / np.linalg.norm(normal))


@compiled()
def _crossed_edge(x: Floats, edges: Ints, a: Floats, b: Floats) -> tuple[int, Floats]:
    first, found, L = np.inf, -1, np.zeros(2)
    vx, vy = b[0] - a[0], b[1] - a[1]
    for i in range(len(edges)):
        p, q = x[edges[i, 0]], x[edges[i, 1]]
        ex, ey = q[0] - p[0], q[1] - p[1]
        inward = vx * ey - vy * ex  # v . outward normal
        if inward >= 0:
            continue
        t = ((p[0] - a[0]) * ey - (p[1] - a[1]) * ex) / inward
        s = ((p[0] - a[0]) * vy - (p[1] - a[1]) * vx) / inward
        if -_EDGE <= t <= 1 and -_EDGE <= s <= 1 + _EDGE and t < first:
            first, found = t, i
            L[0], L[1] = 1 - s, s
    return found, L


@compiled()
def _crossed_triangle(x: Floats, triangles: Ints, a: Floats, b: Floats) -> tuple[int, Floats]:
    first, found, L = np.inf, -1, np.zeros(3)
    v = b - a
    for i in range(len(triangles)):
        p = x[triangles[i, 0]]
        e = x[triangles[i, 1]] - p
        g = x[triangles[i, 2]] - p
        n0 = e[1] * g[2] - e[2] * g[1]
        n1 = e[2] * g[0] - e[0] * g[2]
        n2 = e[0] * g[1] - e[1] * g[0]
        inward = v[0] * n0 + v[1] * n1 + v[2] * n2
        if inward >= 0:
            continue
        w0, w1, w2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
        t = (w0 * n0 + w1 * n1 + w2 * n2) / inward
        if t < -_EDGE or t > 1 or t >= first:
            continue
        y0, y1, y2 = t * v[0] - w0, t * v[1] - w1, t * v[2] - w2
        square = n0 * n0 + n1 * n1 + n2 * n2
        s = ((y1 * g[2] - y2 * g[1]) * n0 + (y2 * g[0] - y0 * g[2]) * n1
             + (y0 * g[1] - y1 * g[0]) * n2) / square  # fmt: skip
        r = ((e[1] * y2 - e[2] * y1) * n0 + (e[2] * y0 - e[0] * y2) * n1
             + (e[0] * y1 - e[1] * y0) * n2) / square  # fmt: skip
        if s >= -_EDGE and r >= -_EDGE and s + r <= 1 + _EDGE:
            first, found = t, i
            L[0], L[1], L[2] = 1 - s - r, s, r
    return found, L
