"""Shape functions and quadrature on triangular facets with 3 or 6 nodes."""

import numpy as np

from validate.arrays import Floats
from validate.scene.mesh import EDGES

# Six points, exact to degree 4, on the triangle of corners (0,0), (1,0), (0,1) (Dunavant 1985).
_A, _B = 0.445948490915965, 0.091576213509771
_XI = np.array(
    [[_A, _A], [1 - 2 * _A, _A], [_A, 1 - 2 * _A], [_B, _B], [1 - 2 * _B, _B], [_B, 1 - 2 * _B]]
)
WEIGHTS = np.repeat([0.111690794839005, 0.054975871827661], 3)


def facet_shapes(per_facet: int) -> tuple[Floats, Floats, Floats]:
    """N, dN/dxi, dN/deta (q, m) of triangles with 3 or 6 nodes at the quadrature points."""
    xi, eta = _XI.T
    L = np.stack([1 - xi - eta, xi, eta], axis=1)
    dL = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    if per_facet == 3:
        ones = np.ones((len(xi), 1))
        return L, ones * dL[:, 0], ones * dL[:, 1]
    i, j = np.array(EDGES[2]).T
    N = np.hstack([L * (2 * L - 1), 4 * L[:, i] * L[:, j]])
    slopes = [
        np.hstack([(4 * L - 1) * dL[:, s], 4 * (L[:, i] * dL[j, s] + L[:, j] * dL[i, s])])
        for s in (0, 1)
    ]
    return N, slopes[0], slopes[1]
