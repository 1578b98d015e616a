"""Factorisation of a symmetric positive definite matrix: the one place that chooses a solver."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.ordering import nested_dissection


@dataclass(frozen=True)
class Factor:
    """P^T L U P of a matrix (m, m); `solve` takes (m,) or (m, k)."""

    lu: SuperLU
    order: Ints

    def solve(self, b: Floats) -> Floats:
        x = np.empty_like(b)
        x[self.order] = self.lu.solve(np.ascontiguousarray(b[self.order]))
        return x


def factorise(A: sparse.csr_array, node: Ints, places: Floats) -> Factor:
    """Factorises A (m, m); unknown i belongs to mesh node `node[i]` at `places[node[i]]` m.

    Raises `SceneError` when A is not positive definite: SuperLU itself would go on silently.
    Without pivoting U's diagonal holds the pivots, whose signs are the inertia of A.
    """
    order = _order(A, node, places)
    B = A[order][:, order].tocsc()
    try:
        lu = splu(B, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as singular:
        raise _not_definite(0.0, int(A.shape[0])) from singular
    pivots = lu.U.diagonal()
    unmoved = bool((lu.perm_r == np.arange(len(order))).all())
    if not unmoved or pivots.min() <= 1e-13 * pivots.max():
        raise _not_definite(float(pivots.min() / pivots.max()), int((pivots <= 0).sum()))
    return Factor(lu, order)


def _order(A: sparse.csr_array, node: Ints, places: Floats) -> Ints:
    used, local = np.unique(node, return_inverse=True)
    links = A.tocoo()
    ones = np.ones(links.nnz, dtype=np.int8)
    shape = (len(used), len(used))
    graph = sparse.csr_array((ones, (local[links.row], local[links.col])), shape=shape)
    rank = np.empty(len(used), dtype=np.int64)
    rank[nested_dissection(graph, places[used])] = np.arange(len(used))
    return np.argsort(rank[local], kind="stable")


def _not_definite(smallest: float, count: int) -> SceneError:
    return SceneError(
        f"the stiffness matrix is not positive definite (smallest pivot {smallest:.1e} of the "
        f"largest, {count} not positive): the body can move rigidly or an element is inverted; "
        "add a support or pin, or refine the mesh"
    )
