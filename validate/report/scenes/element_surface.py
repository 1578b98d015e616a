"""Surface of a mesh as its elements bend: triangles of each facet by its shape functions."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.scene.mesh import Mesh
from validate.scene.shape_functions import brick_values, simplex_values

_SMOOTH, _SIDES = 12_000, 6  # triangles of a smoothed surface, and most sides of one facet


@dataclass(frozen=True)
class Surface:
    """Facets (f, m) of a mesh, each drawn by triangles (t, 3) between points that the shape
    functions `weights` (p, m) place; `rim` (r,) runs along its edges."""

    facets: Ints
    weights: Floats
    triangles: Ints
    rim: Ints

    def at(self, x: Floats) -> Floats:
        """Return values (f p, ...) at the points for values (n, ...) at the nodes."""
        found = np.einsum("pm,fm...->fp...", self.weights, x[self.facets])
        return np.asarray(found.reshape(-1, *x.shape[1:]))

    def every(self, numbers: Ints) -> Ints:
        """Return point numbers (f, ...) of all facets for those (...) of one."""
        first = len(self.weights) * np.arange(len(self.facets))
        return np.asarray(np.add.outer(first, numbers))


def surface_of(mesh: Mesh) -> Surface:
    """Return the boundary of a body, or all cells of a planar mesh; the fewer facets that bend, the
    finer they are."""
    facets = mesh.surface if mesh.dimension == 3 else mesh.cells
    m = facets.shape[1]
    n = 1 if m == 3 else int(np.clip(np.sqrt(_SMOOTH / len(facets)), 1, _SIDES))
    places = [(i, j) for i in range(n + 1) for j in range(n + 1) if m in (4, 9) or i + j <= n]
    rim = [(s, 0) for s in range(n)]
    if m in (4, 9):
        weights = brick_values(np.array(places) / n, 1 if m == 4 else 2)
        rim += [(n, s) for s in range(n)] + [(n - s, n) for s in range(n)]
    else:
        L = np.array([(n - i - j, i, j) for i, j in places]) / n
        weights = simplex_values(1 if m == 3 else 2, L)
        rim += [(n - s, s) for s in range(n)]
    rim += [(0, n - s) for s in range(n + 1)]
    number = {place: k for k, place in enumerate(places)}
    squares = [[(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)] for i, j in places]
    halves = [half for a, b, c, d in squares for half in ((a, b, c), (b, d, c))]
    triangles = [[number[at] for at in half] for half in halves if set(half) <= set(number)]
    return Surface(facets, weights, np.array(triangles), np.array([number[at] for at in rim]))
