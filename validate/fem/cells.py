"""Shape functions, their slopes and quadrature inside cells of every kind, from one table.

Simplices in coordinates xi >= 0, sum xi <= 1; quadrilaterals and hexahedra in 0 <= xi <= 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import roots_jacobi

from validate.arrays import Floats
from validate.scene import bricks
from validate.scene.bricks import CORNERS
from validate.scene.mesh import EDGES, Mesh


@dataclass(frozen=True)
class Rule:
    """Quadrature of one cell kind: N (q, m), dN (q, m, d) by xi, weights (q,) of the reference."""

    N: Floats
    dN: Floats
    weights: Floats


def rule(mesh: Mesh, points: int) -> Rule:
    """`points` Gauss points along each axis: exact to degree 2 points - 1."""
    d = mesh.dimension
    xi, weights = _brick_points(d, points) if mesh.bricks else _simplex_points(d, points)
    return Rule(*shapes(mesh, xi), weights)


def nodal_rule(mesh: Mesh) -> Rule:
    """Shapes at the nodes of a cell, without weights: where slopes of linear fields peak."""
    if mesh.bricks:
        xi: Floats = CORNERS[mesh.dimension]
    else:
        xi = np.vstack([np.zeros(mesh.dimension), np.eye(mesh.dimension)])
        if mesh.order == 2:
            xi = np.vstack([xi, xi[np.array(EDGES[mesh.dimension])].mean(axis=1)])
    return Rule(*shapes(mesh, xi), np.zeros(len(xi)))


def shapes(mesh: Mesh, xi: Floats) -> tuple[Floats, Floats]:
    """N (q, m) and dN/dxi (q, m, d) at reference coordinates xi (q, d)."""
    if mesh.bricks:
        return bricks.shapes(xi), bricks.slopes(xi)
    L = np.hstack([1 - xi.sum(axis=1, keepdims=True), xi])
    dL = np.vstack([-np.ones(mesh.dimension), np.eye(mesh.dimension)])
    if mesh.order == 1:
        return L, np.broadcast_to(dL, (len(xi), *dL.shape))
    i, j = np.array(EDGES[mesh.dimension]).T
    N = np.hstack([L * (2 * L - 1), 4 * L[:, i] * L[:, j]])
    corners = (4 * L - 1)[..., None] * dL
    middles = 4 * (L[:, i, None] * dL[j] + L[:, j, None] * dL[i])
    return N, np.concatenate([corners, middles], axis=1)


def jacobians(mesh: Mesh, rule: Rule, u: Floats | None = None) -> Floats:
    """det dx/dxi (e, q) of the mesh, moved by u (n, d) m when given; not positive = inverted."""
    x = mesh.nodes if u is None else mesh.nodes + u
    return np.asarray(np.linalg.det(np.einsum("qmj,emi->eqij", rule.dN, x[mesh.cells])))


def volumes_at(mesh: Mesh, rule: Rule) -> Floats:
    """Weight times volume (e, q) m^d: an integral is the sum of these times the integrand."""
    return rule.weights * jacobians(mesh, rule)


def values_at(mesh: Mesh, rule: Rule, nodal: Floats) -> Floats:
    """Nodal values (n, c) interpolated at the quadrature points (e, q, c)."""
    return np.asarray(np.einsum("qm,emc->eqc", rule.N, nodal[mesh.cells]))


def nodal_volumes(mesh: Mesh) -> Floats:
    """w_a = integral of N_a (n,) m^d: their sum is the volume; negative at tet10 vertices."""
    points = rule(mesh, 2)
    share = volumes_at(mesh, points) @ points.N
    sums = np.bincount(mesh.cells.ravel(), share.ravel(), minlength=len(mesh.nodes))
    return np.asarray(sums, dtype=np.float64)


def _brick_points(d: int, points: int) -> tuple[Floats, Floats]:
    x, w = leggauss(points)
    return _product([((x + 1) / 2, w / 2)] * d)


def _simplex_points(d: int, points: int) -> tuple[Floats, Floats]:
    """A cube's product rule collapsed onto the simplex; its Jacobian sits in the Jacobi weights."""
    lines = []
    for power in range(d - 1, -1, -1):
        x, w = roots_jacobi(points, power, 0)
        lines.append(((x + 1) / 2, w / 2 ** (power + 1)))
    cube, weights = _product(lines)
    left = np.cumprod(np.hstack([np.ones((len(cube), 1)), 1 - cube[:, :-1]]), axis=1)
    return cube * left, weights


def _product(lines: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    xi = np.stack(np.meshgrid(*(x for x, _ in lines), indexing="ij"), axis=-1)
    weights = np.ones(1)
    for _, w in lines:
        weights = np.multiply.outer(weights, w).ravel()
    return xi.reshape(-1, len(lines)), weights
