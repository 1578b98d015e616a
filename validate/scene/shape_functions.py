"""Shape functions and quadrature of every reference cell and facet.

Simplices in barycentric coordinates L (..., d + 1), L_0 = 1 - sum xi, xi >= 0: vertices first, then
the middles of `EDGES`. Bricks (quadrilaterals, hexahedra) in 0 <= xi <= 1: corners
counter-clockwise, in 3-D first those of zeta = 0, then those of zeta = 1; quadratic ones list the
other places of `LATTICE` behind them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import roots_jacobi

from validate.arrays import Floats

EDGES: Mapping[int, tuple[tuple[int, int], ...]] = {
    1: ((0, 1),),
    2: ((0, 1), (1, 2), (0, 2)),
    3: ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)),
}
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
#: Corners (2^d, d) of the unit brick by dimension.
CORNERS: Mapping[int, Floats] = {
    1: np.array([[0.0], [1.0]]),
    2: np.array(_SQUARE, dtype=np.float64),
    3: np.array([(*xy, z) for z in (0, 1) for xy in _SQUARE], dtype=np.float64),
}


def _lattice(d: int) -> Floats:
    """Corners, then middles of edges, of faces, of the brick: xi (3^d, d)."""
    places = np.stack(np.meshgrid(*[[0.0, 0.5, 1.0]] * d, indexing="ij"), axis=-1).reshape(-1, d)
    halves = (places == 0.5).sum(axis=1)
    rest = np.argsort(halves, kind="stable")[2**d :]
    return np.vstack([CORNERS[d], places[rest]])


#: Nodes (3^d, d) of the quadratic unit brick by dimension.
LATTICE: Mapping[int, Floats] = {d: _lattice(d) for d in (1, 2, 3)}
# (dimension, degree): b and the weight of points with all barycentric coordinates b but one.
# Sources: Dunavant (1985) for degree 4, Keast (1986) for the tetrahedron.
_SYMMETRIC: Mapping[tuple[int, int], tuple[tuple[float, float], ...]] = {
    (1, 3): (((1 - 1 / np.sqrt(3)) / 2, 1 / 2),),
    (2, 2): ((1 / 6, 1 / 6),),
    (2, 4): ((0.445948490915965, 0.111690794839005), (0.091576213509771, 0.054975871827661)),
    (3, 2): (((5 - np.sqrt(5)) / 20, 1 / 24),),
}


@dataclass(frozen=True)
class Quadrature:
    """Quadrature: N (q, m), dN/dxi (q, m, j) and weights (q,) of the reference cell."""

    N: Floats
    dN: Floats
    weights: Floats

    def at(self, nodal: Floats) -> Floats:
        """Values (e, q, c) at the points from those at the nodes of each cell (e, m, c)."""
        return np.asarray(np.einsum("qm,emc->eqc", self.N, nodal))

    def jacobians(self, x: Floats) -> Floats:
        """dx_i/dxi_j (e, q, i, j) of cells or facets with nodes x (e, m, i)."""
        return np.asarray(np.einsum("qmj,emi->eqij", self.dN, x))


def simplex_rule(order: int, L: Floats, weights: Floats) -> Quadrature:
    """Simplices of order 1 or 2 at the points L (q, d + 1)."""
    d = L.shape[1] - 1
    along = np.vstack([-np.ones(d), np.eye(d)])  # dL/dxi
    return Quadrature(simplex_values(order, L), simplex_slopes(order, L) @ along, weights)


def brick_rule(xi: Floats, weights: Floats, order: int = 1) -> Quadrature:
    """Bricks of order 1 or 2 at the points xi (q, d)."""
    return Quadrature(brick_values(xi, order), brick_slopes(xi, order), weights)


def facet_rule(dimension: int, nodes: int) -> Quadrature:
    """Facets with that many nodes of a mesh in `dimension` 2 or 3: edges exact to degree 5,
    triangles to 4, quadrilaterals to 3 along each side, quadratic ones to 5."""
    if dimension == 3 and nodes in (4, 9):
        order = 1 if nodes == 4 else 2
        return brick_rule(*gauss_points(2, order + 1), order)
    if dimension == 3:
        return simplex_rule(1 if nodes == 3 else 2, *symmetric_points(2, 4))
    xi, weights = gauss_points(1, 3)
    return simplex_rule(nodes - 1, barycentric(xi), weights)


def barycentric(xi: Floats) -> Floats:
    """L (q, d + 1) of points xi (q, d)."""
    return np.hstack([1 - xi.sum(axis=1, keepdims=True), xi])


def simplex_values(order: int, L: Floats) -> Floats:
    """N (q, m): L, or L (2 L - 1) at the vertices and 4 L_i L_j on the edges."""
    if order == 1:
        return L
    i, j = np.array(EDGES[L.shape[1] - 1]).T
    return np.hstack([L * (2 * L - 1), 4 * L[:, i] * L[:, j]])


def simplex_slopes(order: int, L: Floats) -> Floats:
    """dN/dL (q, m, d + 1)."""
    unit = np.eye(L.shape[1])
    if order == 1:
        return np.broadcast_to(unit, (len(L), *unit.shape))
    i, j = np.array(EDGES[L.shape[1] - 1]).T
    middles = 4 * (L[:, i, None] * unit[j] + L[:, j, None] * unit[i])
    return np.concatenate([(4 * L - 1)[..., None] * unit, middles], axis=1)


def brick_values(xi: Floats, order: int = 1) -> Floats:
    """N (..., (order + 1)^d) at xi (..., d)."""
    return np.asarray(np.prod(_factors(xi, order)[0], axis=-1))


def brick_slopes(xi: Floats, order: int = 1) -> Floats:
    """dN/dxi (..., (order + 1)^d, d) at xi (..., d)."""
    factors, slopes = _factors(xi, order)
    d = xi.shape[-1]
    others = [np.prod(np.delete(factors, c, axis=-1), axis=-1) for c in range(d)]
    return np.stack([slopes[..., c] * others[c] for c in range(d)], axis=-1)


def _factors(xi: Floats, order: int) -> tuple[Floats, Floats]:
    """The polynomial of every node along every axis (..., m, d), and its slope."""
    x = xi[..., None, :]
    if order == 1:
        high = CORNERS[xi.shape[-1]] > 0
        return np.where(high, x, 1 - x), np.broadcast_to(
            2.0 * high - 1, (*xi.shape[:-1], *high.shape)
        )
    twice = (2 * LATTICE[xi.shape[-1]]).astype(int)  # 0, 1, 2: first, middle, last
    values = np.choose(twice, [(1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1)])
    return values, np.choose(twice, [4 * x - 3, 4 - 8 * x, 4 * x - 1])


def gauss_points(d: int, points: int) -> tuple[Floats, Floats]:
    """xi (q, d) and weights (q,) in the brick, exact to degree 2 points - 1 along each axis."""
    x, w = leggauss(points)
    return _product([((x + 1) / 2, w / 2)] * d)


def collapsed_points(d: int, points: int) -> tuple[Floats, Floats]:
    """xi (q, d) and weights (q,) in the simplex, exact to degree 2 points - 1.

    A cube's product rule collapsed; its Jacobian sits in the weights of Gauss-Jacobi.
    """
    lines = []
    for power in range(d - 1, -1, -1):
        x, w = roots_jacobi(points, power, 0)
        lines.append(((x + 1) / 2, w / 2 ** (power + 1)))
    cube, weights = _product(lines)
    left = np.cumprod(np.hstack([np.ones((len(cube), 1)), 1 - cube[:, :-1]]), axis=1)
    return cube * left, weights


def symmetric_points(d: int, degree: int) -> tuple[Floats, Floats]:
    """L (q, d + 1) and weights (q,) in the simplex, the same whichever way it is turned.

    Degree 3 on edges, 2 or 4 on triangles, 2 on tetrahedra.
    """
    orbits = _SYMMETRIC[d, degree]
    L = np.vstack([b + (1 - (d + 1) * b) * np.eye(d + 1) for b, _ in orbits])
    return L, np.repeat([w for _, w in orbits], d + 1)


def _product(lines: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    xi = np.stack(np.meshgrid(*(x for x, _ in lines), indexing="ij"), axis=-1)
    weights = np.ones(1)
    for _, w in lines:
        weights = np.multiply.outer(weights, w).ravel()
    return xi.reshape(-1, len(lines)), weights
