"""Factorisation of a symmetric matrix: choice of the solver, multifrontal Cholesky.

Multifrontal Cholesky factorisation: dense fronts on the tree of nested dissection. All arithmetic
is done by dense kernels on whole separators, which makes it several times faster than a column-wise
sparse LU where separators are large (10 000 unknowns in three dimensions and more); it is not worth
its bookkeeping below. Source: Duff & Reid (1983); Liu, The multifrontal method for sparse matrix
solution (1992).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import LinAlgError, solve_triangular
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf
from scipy.sparse.linalg import SuperLU, splu

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.kernels.jit_cache import compiled
from validate.memory import free_memory, require_memory


@dataclass(frozen=True)
class Front:
    """Unknowns `start` to `stop` of the order, and the later ones (b,) that they touch.

    `diagonal` (k, k) is their lower triangle of L, `below` (b, k) the rows of L at the border.
    """

    start: int
    stop: int
    border: Ints
    diagonal: Floats
    below: Floats


@dataclass(frozen=True)
class Fronts:
    """P^T L L^T P of a positive definite matrix (m, m); `solve` takes (m,) or (m, k)."""

    order: Ints
    fronts: tuple[Front, ...]

    def solve(self, b: Floats) -> Floats:
        y = np.ascontiguousarray(b[self.order])
        for f in self.fronts:
            own = slice(f.start, f.stop)
            y[own] = solve_triangular(f.diagonal, y[own], lower=True, check_finite=False)
            y[f.border] -= f.below @ y[own]
        for f in reversed(self.fronts):
            own = slice(f.start, f.stop)
            rest = y[own] - f.below.T @ y[f.border]
            y[own] = solve_triangular(f.diagonal, rest, lower=True, trans=1, check_finite=False)
        x = np.empty_like(y)
        x[self.order] = y
        return x


@dataclass(frozen=True)
class _Update:
    """What eliminated unknowns leave on those at their border (b,): the lower triangle of a matrix
    (b, b) to add."""

    border: Ints
    matrix: Floats


def fronts(A: sparse.csr_array, order: Ints, stops: Ints, children: Sequence[int]) -> Fronts | None:
    """Factorise A (m, m) in `order` (m,); None when A is not positive definite.

    Front i eliminates the unknowns before `stops[i]` of the order and takes up what its
    `children[i]` predecessors on the stack have left: the tree in postorder.
    """
    lower = sparse.tril(A[order][:, order]).tocsc()
    found: list[Front] = []
    stack: list[_Update] = []
    start, place = 0, np.empty(len(order), dtype=np.int64)
    for stop, below in zip(stops.tolist(), children, strict=True):
        parts = [stack.pop() for _ in range(below)]
        try:
            front, update = _eliminated(lower, start, stop, parts, place)
        except LinAlgError:
            return None
        found.append(front)
        stack.append(update)
        start = stop
    return Fronts(order, tuple(found))


def _eliminated(
    lower: sparse.csc_array, start: int, stop: int, parts: list[_Update], place: Ints
) -> tuple[Front, _Update]:
    """One front: assembled from the matrix and its children, its own unknowns eliminated.

    `place` (m,) is room for the number that each unknown has here.
    """
    k, of = stop - start, slice(*lower.indptr[[start, stop]])
    rows, values = lower.indices[of], lower.data[of]
    columns = np.repeat(np.arange(k), np.diff(lower.indptr[start : stop + 1]))
    beyond = [p.border[np.searchsorted(p.border, stop) :] for p in parts]
    border = np.unique(np.concatenate([rows[rows >= stop], *beyond], dtype=np.int64))
    b = len(border)
    place[start:stop], place[border] = np.arange(k), np.arange(k, k + b)
    own, below, left = (np.zeros(shape, order="F") for shape in ((k, k), (b, k), (b, b)))
    for part in parts:
        _add(part.matrix, place[part.border], own, below, left)
    at = place[rows]
    inside = at < k
    own[at[inside], columns[inside]] += values[inside]
    below[at[~inside] - k, columns[~inside]] += values[~inside]
    own, stopped = dpotrf(own, lower=1, clean=1, overwrite_a=1)
    if stopped:
        raise LinAlgError(f"pivot {start + stopped} is not positive")
    if b:
        below = dtrsm(1.0, own, below, side=1, lower=1, trans_a=1, overwrite_b=1)
        left = dsyrk(-1.0, below, beta=1.0, c=left, lower=1, overwrite_c=1)
    return Front(start, stop, border, own, below), _Update(border, left)


@compiled()
def _add(matrix: Floats, at: Ints, own: Floats, below: Floats, left: Floats) -> None:
    """Add the lower triangle of a child's matrix (j, j) to a front, whose rows `at` (j,) ascend."""
    k = len(own)
    for j in range(len(at)):
        for i in range(j, len(at)):
            if at[j] >= k:
                left[at[i] - k, at[j] - k] += matrix[i, j]
            elif at[i] >= k:
                below[at[i] - k, at[j]] += matrix[i, j]
            else:
                own[at[i], at[j]] += matrix[i, j]


# --- Nested dissection of a mesh graph by coordinates: the elimination order that keeps fill
# low.

_LEAF = 48  # nodes; below this the order within hardly matters


@dataclass(frozen=True)
class Dissection:
    """A permutation `order` (n,) of the nodes in parts: halves first, their separator last.

    Part i is `order[stops[i - 1]:stops[i]]` and separates `children[i]` parts (with all that those
    separate) before it from each other: a tree in postorder.
    """

    order: Ints
    stops: Ints
    children: tuple[int, ...]


def nested_dissection(graph: sparse.csr_array, places: Floats) -> Dissection:
    """Halves of the nodes, their halves, and so on.

    `graph` (n, n) links neighbouring nodes, `places` (n, d) m are their coordinates.
    Source: George (1973), with coordinate bisection.
    """
    side = np.zeros(len(places), dtype=np.int8)
    parts: list[tuple[Ints, int]] = []
    _dissect(graph, places, np.arange(len(places)), side, parts)
    order = np.concatenate([nodes for nodes, _ in parts])
    stops = np.cumsum([len(nodes) for nodes, _ in parts])
    return Dissection(order, stops, tuple(children for _, children in parts))


def _dissect(
    graph: sparse.csr_array,
    places: Floats,
    nodes: Ints,
    side: np.ndarray,
    parts: list[tuple[Ints, int]],
) -> None:
    if len(nodes) <= _LEAF:
        parts.append((nodes, 0))
        return
    low, high = _halves(places, nodes)
    separator = _touching(graph, low, high, side)
    halves = [half for half in (low[~separator], high) if len(half)]
    for half in halves:
        _dissect(graph, places, half, side, parts)
    parts.append((low[separator], len(halves)))


def _halves(places: Floats, nodes: Ints) -> tuple[Ints, Ints]:
    x = places[nodes]
    along = x[:, int(np.argmax(np.ptp(x, axis=0)))]
    ranks = np.argsort(along, kind="stable")
    half = len(nodes) // 2
    # Nodes level with the median stay together, so that a grid is cut along its own planes.
    below = along <= along[ranks[half - 1]]
    if below.all():
        below = np.zeros(len(nodes), dtype=bool)
        below[ranks[:half]] = True
    return nodes[below], nodes[~below]


def _touching(graph: sparse.csr_array, low: Ints, high: Ints, side: np.ndarray) -> np.ndarray:
    side[high] = 1
    rows = graph[low]
    hits = np.concatenate([[0], np.cumsum(side[rows.indices])])
    side[high] = 0
    return np.asarray(hits[rows.indptr[1:]] > hits[rows.indptr[:-1]])


# --- How much memory a system takes, before it is taken, from its unknowns and its dimension.
#
# Nested dissection of a mesh in space leaves O(N^(4/3)) entries, in the plane O(N log N): George
# (1973), "Nested dissection of a regular finite element mesh". The numbers before them were
# measured as peaks of blocks of 2 000 to 64 000 unknowns in space (P1 and P2: 252 to 317 and 296
# to 635 bytes, thin plates 140) and 2 000 to 116 000 in the plane (84 to 107):
# docs/reference/conventions.md.

_SPACE, _PLANE = 300.0, 100.0  # bytes of a factor per N^(4/3), N log2 N
_ASSEMBLED = {2: 2e3, 3: 13e3}  # bytes an unknown while K is assembled
_BOTH = 2.0  # L and U, where pivots of either sign are kept apart


def factor_bytes(unknowns: float, dimension: int, *, indefinite: bool = False) -> float:
    """Of a factorisation at its peak; one of a tangent that may be indefinite keeps two halves."""
    N = max(unknowns, 2.0)
    once = _SPACE * N ** (4 / 3) if dimension == 3 else _PLANE * N * math.log2(N)
    return _BOTH * once if indefinite else once


def next_to_nothing(unknowns: float, dimension: int) -> bool:
    """Return whether a system a hundred times as large in memory would fit, too."""
    free = free_memory()
    return free is None or 100 * solvable_bytes(unknowns, dimension) < free


def require_solvable(unknowns: float, dimension: int, what: str) -> None:
    """Raise `MemoryShortError` where a system of so many unknowns does not fit, assembled or
    factored: asked before a mesh of a ladder is made."""
    needed = solvable_bytes(unknowns, dimension)
    require_memory(needed, f"{what} with up to {unknowns:.3g} unknowns in {dimension}-D")


def solvable_bytes(unknowns: float, dimension: int) -> float:
    """Return the larger of assembly and factor: the two do not peak at once."""
    return max(_ASSEMBLED[dimension] * unknowns, factor_bytes(unknowns, dimension))


def require_assembly(unknowns: float, dimension: int) -> None:
    """Raise `MemoryShortError` where the stiffness of so many unknowns does not fit."""
    require_memory(_ASSEMBLED[dimension] * unknowns, f"assembly of {unknowns:.4g} unknowns")


def require_factor(unknowns: float, dimension: int, *, indefinite: bool = False) -> None:
    """Raise `MemoryShortError` where the factor of so many unknowns does not fit."""
    needed = factor_bytes(unknowns, dimension, indefinite=indefinite)
    require_memory(needed, f"factor of {unknowns:.4g} unknowns in {dimension}-D")


# -------------------------------------------------------------------------------------------------

# Unknowns from which dense fronts pay: at 3548 a factor takes 14 ms for 47, a solve 1.3 ms for 0.7.
FRONTAL = 3000


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
    """Factorise A (m, m); unknown i belongs to mesh node `node[i]` at `places[node[i]]` m.

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
    """Factorise a symmetric A (m, m) in the given order, whatever the signs of its pivots.

    For tangents, which may lose definiteness: the caller reads `negative_pivots`. Raises
    `SceneError` only where a pivot vanishes.
    """
    factor, pivots = _factorised(A, order)
    if np.abs(pivots).min() <= 1e-13 * np.abs(pivots).max():
        raise _not_definite(float(pivots.min() / pivots.max()), int((pivots <= 0).sum()))
    return factor


def factorise_general(A: sparse.csr_array, order: Ints) -> Factor:
    """Factorise an A (m, m) of symmetric pattern that is not symmetric, in the given order.

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
