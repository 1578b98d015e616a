"""Factorisation of a symmetric positive definite matrix: the one place that chooses a solver."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.fill import require_factor
from validate.fem.frontal import Fronts, fronts
from validate.fem.ordering import Dissection, nested_dissection

FRONTAL = 3000  # unknowns from which dense fronts are faster: 0.24 s for 0.43 s at 3548


@dataclass(frozen=True)
class Factor:
    """P^T L U P of a matrix (m, m); `solve` takes (m,) or (m, k).

    `negative_pivots` counts the negative eigenvalues of the matrix (Sylvester's law of inertia).
    """

    lu: SuperLU
    order: Ints
    negative_pivots: int = 0

    def solve(self, b: Floats) -> Floats:
        x = np.empty_like(b)
        x[self.order] = self.lu.solve(np.ascontiguousarray(b[self.order]))
        return x


def factorise(A: sparse.csr_array, node: Ints, places: Floats) -> Factor | Fronts:
    """Factorises A (m, m); unknown i belongs to mesh node `node[i]` at `places[node[i]]` m.

    Raises `MemoryShortError` before memory is taken that is not there, and `SceneError` when A is
    not positive definite: SuperLU itself would go on silently.
    Without pivoting U's diagonal holds the pivots, whose signs are the inertia of A.
    """
    require_factor(len(node), places.shape[1])
    _require_positive(A)
    dissection = _dissected(A, node, places)
    if len(node) > FRONTAL:
        found = fronts(A, dissection.order, dissection.stops, dissection.children)
        if found is not None:
            return found
    factor, pivots = _factorised(A, dissection.order)
    if pivots.min() <= 1e-13 * pivots.max():
        raise _not_definite(float(pivots.min() / pivots.max()), int((pivots <= 0).sum()))
    return factor


def _require_positive(A: sparse.csr_array) -> None:
    """Raises `SceneError` for entries that are not finite and for a diagonal that is not positive:
    SuperLU would hand an empty column to BLAS, which prints a line of its own."""
    if not np.isfinite(A.data).all():
        raise SceneError(
            f"{int((~np.isfinite(A.data)).sum())} entries of the stiffness matrix are not "
            "finite; check for sizes or material parameters that overflow"
        )
    diagonal = A.diagonal()
    if (diagonal <= 0).any():
        largest = max(float(np.abs(diagonal).max()), np.finfo(float).tiny)
        raise _not_definite(float(diagonal.min()) / largest, int((diagonal <= 0).sum()))


def factorise_indefinite(A: sparse.csr_array, order: Ints) -> Factor:
    """Factorises a symmetric A (m, m) in the given order, whatever the signs of its pivots.

    For tangents, which may lose definiteness: the caller reads `negative_pivots`. Raises
    `SceneError` only where a pivot vanishes.
    """
    factor, pivots = _factorised(A, order)
    if np.abs(pivots).min() <= 1e-13 * np.abs(pivots).max():
        raise _not_definite(float(pivots.min() / pivots.max()), int((pivots <= 0).sum()))
    return factor


def factorise_general(A: sparse.csr_array, order: Ints) -> Factor:
    """Factorises an A (m, m) of symmetric pattern that is not symmetric, in the given order.

    Its pivots say nothing of stability. Raises `SceneError` where one vanishes.
    """
    try:
        lu = splu(A[order][:, order].tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)
    except RuntimeError as singular:
        raise _not_definite(0.0, int(A.shape[0])) from singular
    pivots = np.abs(lu.U.diagonal())
    if pivots.min() <= 1e-13 * pivots.max():
        raise _not_definite(float(pivots.min() / pivots.max()), 1)
    return Factor(lu, order)


def _factorised(A: sparse.csr_array, order: Ints) -> tuple[Factor, Floats]:
    """The factor and its pivots (m,): without row exchanges these are U's diagonal."""
    B = A[order][:, order].tocsc()
    try:
        lu = splu(B, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as singular:
        raise _not_definite(0.0, int(A.shape[0])) from singular
    pivots = lu.U.diagonal()
    if not (lu.perm_r == np.arange(len(order))).all():
        raise _not_definite(float(pivots.min() / pivots.max()), int((pivots <= 0).sum()))
    return Factor(lu, order, int((pivots < 0).sum())), pivots


def elimination_order(A: sparse.csr_array, node: Ints, places: Floats) -> Ints:
    """Nested dissection of the unknowns (m,) by their nodes; holds for every A of one pattern.

    Raises `MemoryShortError` where tangents in that order would not fit.
    """
    require_factor(len(node), places.shape[1], indefinite=True)
    return _dissected(A, node, places).order


def _dissected(A: sparse.csr_array, node: Ints, places: Floats) -> Dissection:
    """The dissection of the nodes, told by unknowns."""
    used, local = np.unique(node, return_inverse=True)
    links = A.tocoo()
    ones = np.ones(links.nnz, dtype=np.int8)
    shape = (len(used), len(used))
    graph = sparse.csr_array((ones, (local[links.row], local[links.col])), shape=shape)
    nodes = nested_dissection(graph, places[used])
    rank = np.empty(len(used), dtype=np.int64)
    rank[nodes.order] = np.arange(len(used))
    order = np.argsort(rank[local], kind="stable")
    stops = np.searchsorted(rank[local][order], nodes.stops)
    return Dissection(order, stops, nodes.children)


def _not_definite(smallest: float, count: int) -> SceneError:
    return SceneError(
        f"the stiffness matrix is not positive definite (smallest pivot {smallest:.1e} of the "
        f"largest, {count} not positive): the body can move rigidly or an element is inverted; "
        "add a support or pin, or refine the mesh"
    )
