"""Bilinear quadrilaterals and trilinear hexahedra: shape functions on the unit square or cube.

Corners run counter-clockwise, in 3-D first those of zeta = 0, then those of zeta = 1.
"""

from collections.abc import Mapping
from itertools import product

import numpy as np

from validate.arrays import Floats

_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
#: Corners (2^d, d) of the unit cell by dimension.
CORNERS: Mapping[int, Floats] = {
    1: np.array([[0.0], [1.0]]),
    2: np.array(_SQUARE, dtype=np.float64),
    3: np.array([(*xy, z) for z in (0, 1) for xy in _SQUARE], dtype=np.float64),
}
_GAUSS = (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12))


def gauss_points(d: int) -> tuple[Floats, float]:
    """The 2^d points (q, d), exact to degree 3 along every axis, and their one weight."""
    return np.array(list(product(_GAUSS, repeat=d))), 0.5**d


def shapes(xi: Floats) -> Floats:
    """N (..., 2^d) at local coordinates xi (..., d)."""
    return np.asarray(np.prod(_factors(xi), axis=-1))


def slopes(xi: Floats) -> Floats:
    """dN/dxi (..., 2^d, d) at local coordinates xi (..., d)."""
    factors, d = _factors(xi), xi.shape[-1]
    signs = 2 * CORNERS[d] - 1
    others = [np.prod(np.delete(factors, c, axis=-1), axis=-1) for c in range(d)]
    return np.stack([signs[:, c] * others[c] for c in range(d)], axis=-1)


def _factors(xi: Floats) -> Floats:
    """1 - xi or xi (..., 2^d, d), whichever belongs to the corner."""
    high = CORNERS[xi.shape[-1]] > 0
    return np.where(high, xi[..., None, :], 1 - xi[..., None, :])


def jacobians(x: Floats, xi: Floats) -> Floats:
    """dx_i/dxi_j (e, q, d, j) of cells or facets with corners x (e, 2^j, d) at xi (q, j)."""
    return np.asarray(np.einsum("ead,qaj->eqdj", x, slopes(xi)))
