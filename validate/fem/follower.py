"""The second derivative of a cavity's volume: the stiffness of a pressure that follows the wall.

V = sum over facets of -1/3 A_abc det(x_a, x_b, x_c), A antisymmetric, so that its Hessian is exact
and symmetric, d2V/dx_a dx_b = 2 A_abc [x_c]x. It agrees with the gradient of `cavity` on closed
surfaces, the only ones there are.
"""

from itertools import permutations

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.fem.cavity import CavitySurface
from validate.scene.shape_functions import facet_rule


def volume_hessian(surface: CavitySurface, positions: Floats) -> sparse.csr_array:
    """d2V/dx2 (N, N) m for the positions (n, 3) m of all mesh nodes, N = 3 n.

    In 2-D it is (N, N) without a unit, N = 2 n.
    """
    if positions.shape[1] == 2:
        return _flat_hessian(surface, positions)
    x = positions[surface.facets] - positions[surface.nodes].mean(axis=0)
    blocks = 2 * np.einsum("abc,fcij->faibj", _antisymmetric(x.shape[1]), _cross_matrix(x))
    return _assembled(surface, blocks, positions)


def _flat_hessian(surface: CavitySurface, positions: Floats) -> sparse.csr_array:
    count = surface.facets.shape[1]
    rule = facet_rule(2, count)
    M = np.einsum("q,qa,qb->ab", rule.weights, rule.N, rule.dN[..., 0])
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    block = np.einsum("ab,ij->aibj", (M - M.T) / 2, turn)
    blocks = np.broadcast_to(block, (len(surface.facets), *block.shape))
    return _assembled(surface, blocks, positions)


def _assembled(surface: CavitySurface, blocks: Floats, positions: Floats) -> sparse.csr_array:
    """Blocks (f, m, d, m, d) of all facets, summed at their unknowns."""
    d = positions.shape[1]
    unknowns = (d * surface.facets[..., None] + np.arange(d)).reshape(len(surface.facets), -1)
    m = unknowns.shape[1]
    rows, columns = np.repeat(unknowns, m, axis=1).ravel(), np.tile(unknowns, m).ravel()
    shape = (positions.size, positions.size)
    return sparse.csr_array((blocks.ravel(), (rows, columns)), shape=shape)


def _antisymmetric(per_facet: int) -> Floats:
    """A (m, m, m): the facet's integrals of N_a dN_b/dxi dN_c/deta, signed mean of all orders."""
    rule = facet_rule(3, per_facet)
    M = np.einsum("q,qa,qb,qc->abc", rule.weights, rule.N, rule.dN[..., 0], rule.dN[..., 1])
    signed = [np.linalg.det(np.eye(3)[list(p)]) * M.transpose(p) for p in permutations(range(3))]
    return np.asarray(np.mean(signed, axis=0))


def _cross_matrix(x: Floats) -> Floats:
    """[x]x (..., 3, 3): the matrix of y -> x cross y."""
    rows = np.zeros((*x.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows[..., i, k], rows[..., k, i] = x[..., j], -x[..., j]
    return rows
