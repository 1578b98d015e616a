"""Compiled element loops of tet4 meshes at large strain: force, diagonal of the tangent, product.

Blocks of 16 cells are gathered into one flat workspace, worked through lane by lane and scattered.
One workspace for all that a loop reads and writes is what lets the compiler use vector registers:
between separate arrays it cannot rule out overlap. Rows of 16 lanes in the workspace: 0-8 gradients
dN/dX of nodes 1-3, 9-10 moduli times volume, 11-19 edges of u, 20-28 edges of v, from 29 results:
9 rows of forces, or 12 a node of force and block.

One thread takes 11.5 ns a tet for St. Venant-Kirchhoff and 15 ns for neo-Hooke where dgemm gives
52 GFLOP/s: 5.4 and 8.5 ns of arithmetic, the rest gather and scatter; the order of the cells makes
no difference there. The tangent's diagonal is 105 flop more on 228 (1.46), the nodes' own blocks
153 (1.67); measured 1.32 and 1.73, since gathering is shared and forces and blocks are scattered
together as vectors (`benchmarks/explicit.py`).

The other laws (`fem.law_kernels`) have cards, and geometry of three dimensions instead of two: the
compiler knows which, so that neither kind is in the code of the other. Mooney-Rivlin and Yeoh in
their split form take the vector registers too (17 ns a tet); with logarithms or principal stretches
a law is worked through cell by cell (coupled about 120 ns, Ogden of three terms 1 us).

Neither NaN nor infinity is assumed away (no `nnan`, `ninf`): a run that diverges must be seen to.
The numpy reference is `fem.hyperelastic.Body`.
"""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import prange
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.fem import brick_kernels, kernel_tensors, law_kernels
from validate.fem.brick_kernels import add_brick_forces, bricks_looked_at
from validate.fem.compiled import compiled
from validate.fem.kernel_tensors import (
    FAST,
    Nine,
    Six,
    Three,
    combined,
    deformation,
    dot,
    inlined,
    inner,
    inverse,
    inverse_cube_root,
    product,
    strain,
    times,
    transposed,
    volume,
)
from validate.fem.law_kernels import (
    Four,
    energy_invariants,
    energy_ogden,
    first_invariants,
    first_of_four,
    first_ogden,
    product_invariants,
    product_ogden,
)

Cells = NDArray[np.int32]
Springs = tuple[Cells, Cells, Floats]

LANES = 16
ROWS = 11  # of geometry: 9 gradients, 2 moduli; the card of other laws follows
WORK = max(80 * LANES, brick_kernels.WORK)  # length of the workspace
WIDE = 12  # numbers a node that `add_forces_and_blocks` needs behind the workspace
SVK, NEO_HOOKE, INVARIANTS, INVARIANTS_COUPLED, OGDEN, OGDEN_COUPLED = range(6)
_U, _V, _OUT, _NODES = ROWS * LANES, 20 * LANES, 29 * LANES, 29 * LANES
_CARD = 77 * LANES  # the last three rows

_INLINED = kernel_tensors, law_kernels, brick_kernels
_compiled = compiled(*_INLINED, nogil=True, fastmath=FAST, error_model="numpy")
_threaded = compiled(*_INLINED, nogil=True, parallel=True, error_model="numpy")


@inlined
def _matrix(w: Floats, o: int) -> Nine:
    return (
        w[o], w[o + 16], w[o + 32], w[o + 48], w[o + 64], w[o + 80], w[o + 96], w[o + 112],
        w[o + 128],
    )  # fmt: skip


@inlined
def _second(H: Nine, a: float, b: float) -> Nine:
    """V S = a tr(E) I + 2 b E, a = V lambda, b = V mu (paper 003, eq 10)."""
    C = strain(H)
    t = 0.5 * a * (C[0] + C[1] + C[2])
    xy, xz, yz = b * C[3], b * C[4], b * C[5]
    return t + b * C[0], xy, xz, xy, t + b * C[1], yz, xz, yz, t + b * C[2]


@inlined
def _first_svk(H: Nine, a: float, b: float) -> Nine:
    """V P = F V S."""
    return product(deformation(H), _second(H, a, b))


@inlined
def _shares(H: Nine, dJ: float, y: float, a: float, b: float) -> Three:
    """i, h, k of V P = i I + h H + k (cof F - I), y = J^(-1/3).

    This is b J^(-2/3) (F - tr C/3 F^-T) + a/2 (J^2 - 1) F^-T, a = V kappa, b = V mu, without the
    differences of numbers near 1 that it has at small strain.
    """
    shear = b * y * y * (y * y * y)
    t = (2 * (H[0] + H[4] + H[8]) + inner(H, H)) / 3
    bulk = 0.5 * a * dJ * (dJ + 2) * (y * y * y)
    return shear * (dJ - t) + bulk, shear * (1 + dJ), bulk - shear * (1 + t)


@inlined
def _first_neo_hooke(H: Nine, a: float, b: float) -> Nine:
    """V P."""
    dJ, K = volume(H)
    i, h, k = _shares(H, dJ, inverse_cube_root(1 + dJ), a, b)
    return (
        i + h * H[0] + k * K[0], h * H[1] + k * K[1], h * H[2] + k * K[2],
        h * H[3] + k * K[3], i + h * H[4] + k * K[4], h * H[5] + k * K[5],
        h * H[6] + k * K[6], h * H[7] + k * K[7], i + h * H[8] + k * K[8],
    )  # fmt: skip


@inlined
def _put_forces(w: Floats, l: int, P: Nine, G: Nine) -> None:
    """Forces V P g of nodes 1-3 in rows 0-8 of the results, 3 i + a - 1."""
    f = product(P, transposed(G))
    for k in range(9):
        w[_OUT + k * LANES + l] = f[k]


@inlined
def _forces_svk(w: Floats) -> None:
    for l in range(LANES):
        G = _matrix(w, l)
        H = product(_matrix(w, _U + l), G)
        _put_forces(w, l, _first_svk(H, w[144 + l], w[160 + l]), G)


@inlined
def _forces_neo_hooke(w: Floats) -> None:
    for l in range(LANES):
        G = _matrix(w, l)
        H = product(_matrix(w, _U + l), G)
        _put_forces(w, l, _first_neo_hooke(H, w[144 + l], w[160 + l]), G)


@inlined
def _card(geometry: Floats, block: int, l: int) -> Floats:
    """What a cell's law has beyond the two moduli: rows of the geometry that stay there."""
    return geometry[block, ROWS:, l]


@inlined
def _four(card: Floats, b: float) -> Four:
    """C10 V, C01 V, C20 V, C30 V of mu V and the last three of them."""
    return 0.5 * b - card[0], card[0], card[1], card[2]


@inlined
def _first_carded(law: int, H: Nine, a: float, b: float, card: Floats) -> Nine:
    """V P of the laws that have a card."""
    if law < OGDEN:
        return first_of_four(law == INVARIANTS_COUPLED, H, a, _four(card, b))
    return first_ogden(law == OGDEN_COUPLED, H, a, card)


@inlined
def _first_along(law: int, H: Nine, D: Nine, a: float, b: float, card: Floats) -> Nine:
    """V dP along D of the laws that have a card."""
    if law < OGDEN:
        return product_invariants(law == INVARIANTS_COUPLED, H, D, a, _four(card, b))
    return product_ogden(law == OGDEN_COUPLED, H, D, a, card)


@inlined
def _forces_invariants(w: Floats, geometry: Floats, block: int) -> None:
    for k in range(3):
        for l in range(LANES):
            w[_CARD + k * LANES + l] = geometry[block, ROWS + k, l]
    for l in range(LANES):
        G, b = _matrix(w, l), w[160 + l]
        H = product(_matrix(w, _U + l), G)
        c = w[_CARD + l], w[_CARD + LANES + l], w[_CARD + 2 * LANES + l]
        four = 0.5 * b - c[0], c[0], c[1], c[2]
        _put_forces(w, l, first_invariants(False, H, w[144 + l], four), G)


@inlined
def _forces_carded(w: Floats, law: int, geometry: Floats, block: int) -> None:
    """Lane by lane: these laws have branches and logarithms that no vector register takes."""
    for l in range(LANES):
        G = _matrix(w, l)
        H = product(_matrix(w, _U + l), G)
        card = _card(geometry, block, l)
        _put_forces(w, l, _first_carded(law, H, w[144 + l], w[160 + l], card), G)


@inlined
def _load(w: Floats, geometry: Floats, block: int) -> None:
    if geometry.ndim == 3:
        for k in range(ROWS):
            for l in range(LANES):
                w[k * LANES + l] = geometry[block, k, l]
    else:
        for k in range(ROWS * LANES):
            w[k] = geometry[block, k]


@inlined
def _corners(cells: Cells, block: int, l: int) -> tuple[Any, Any, Any, Any]:
    """First unknowns of a cell's nodes. Unsigned: a sign would be tested for at every access."""
    return (
        np.uint64(cells[block, 0, l]),
        np.uint64(cells[block, 1, l]),
        np.uint64(cells[block, 2, l]),
        np.uint64(cells[block, 3, l]),
    )


@inlined
def _gather(w: Floats, at: int, cells: Cells, block: int, u: Floats) -> None:
    """Edges u_a - u_0 of the block's cells, rows 3 i + a - 1 from `at`."""
    for l in range(LANES):
        n0, n1, n2, n3 = _corners(cells, block, l)
        for i in range(3):
            c, o = np.uint64(i), at + 3 * i * LANES + l
            x = u[n0 + c]
            w[o] = u[n1 + c] - x
            w[o + LANES] = u[n2 + c] - x
            w[o + 2 * LANES] = u[n3 + c] - x


@inlined
def _scatter(w: Floats, cells: Cells, block: int, f: Floats) -> None:
    """Adds what `_put_forces` left; node 0 takes minus the sum of the others."""
    for l in range(LANES):
        n0, n1, n2, n3 = _corners(cells, block, l)
        for i in range(3):
            c, o = np.uint64(i), _OUT + 3 * i * LANES + l
            f1, f2, f3 = w[o], w[o + LANES], w[o + 2 * LANES]
            f[n1 + c] += f1
            f[n2 + c] += f2
            f[n3 + c] += f3
            f[n0 + c] -= f1 + f2 + f3


@_compiled
def add_forces(law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, w: Floats) -> None:
    """Adds the internal forces N of all blocks to f (N,); cells (blocks, 4, 16) hold 3 x node.

    Geometry of four dimensions is that of hexahedra (`fem.brick_kernels`).
    """
    if geometry.ndim == 4:
        add_brick_forces(geometry, cells, u, f, w)
        return
    for block in range(cells.shape[0]):
        _load(w, geometry, block)
        _gather(w, _U, cells, block, u)
        if geometry.ndim == 3 and law == INVARIANTS:
            _forces_invariants(w, geometry, block)
        elif geometry.ndim == 3:
            _forces_carded(w, law, geometry, block)
        elif law == SVK:
            _forces_svk(w)
        else:
            _forces_neo_hooke(w)
        _scatter(w, cells, block, f)


@inlined
def _pulled_back(P: Nine, G: Nine) -> Six:
    """F^-1 P of a symmetric result, G = F^-T: xx, yy, zz, xy, xz, yz."""
    S = product(transposed(G), P)
    return S[0], S[4], S[8], S[1], S[2], S[5]


@inlined
def _late(memory: Floats, series: Floats, block: int, l: int, S: Six) -> Nine:
    """V times the sum of the branches' stresses after a step that ends at V S; remembers both."""
    x, y, z, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(series.shape[1] // 2):
        decay, gain, o = series[block, 2 * k, l], series[block, 2 * k + 1, l], 6 * (k + 1)
        for i in range(6):
            change = gain * (S[i] - memory[block, i, l])
            memory[block, o + i, l] = decay * memory[block, o + i, l] + change
        x += memory[block, o, l]
        y += memory[block, o + 1, l]
        z += memory[block, o + 2, l]
        xy += memory[block, o + 3, l]
        xz += memory[block, o + 4, l]
        yz += memory[block, o + 5, l]
    for i in range(6):
        memory[block, i, l] = S[i]
    return x, xy, xz, xy, y, yz, xz, yz, z


@_compiled
def add_late_forces(
    law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, w: Floats, memory: Floats,
    series: Floats,
) -> None:  # fmt: skip
    """`add_forces` of a viscoelastic body in a split form, at the end of a step (`fem.viscous`).

    `memory` (blocks, 6 + 6 k, 16) is V S of the isochoric law and V Q of the k branches, as xx, yy,
    zz, xy, xz, yz, after the step before: overwritten; `series` (blocks, 2 k, 16) exp(-x) and
    g (1 - exp(-x))/x of each branch.
    """
    for block in range(cells.shape[0]):
        _load(w, geometry, block)
        _gather(w, _U, cells, block, u)
        for l in range(LANES):
            G, a, b = _matrix(w, l), w[144 + l], w[160 + l]
            H = product(_matrix(w, _U + l), G)
            if geometry.ndim == 3:
                P = _first_carded(law, H, 0.0, b, _card(geometry, block, l))
            else:
                P = _first_neo_hooke(H, 0.0, b)
            X, dJ = inverse(H)
            late = product(deformation(H), _late(memory, series, block, l, _pulled_back(P, X)))
            P = combined(1.0, combined(1.0, P, 1.0, late), 0.5 * a * dJ * (dJ + 2), X)
            _put_forces(w, l, P, G)
        _scatter(w, cells, block, f)


@_threaded
def add_forces_in_parts(
    law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, parts: Floats
) -> None:
    """The same by as many threads as `parts` (threads, WORK + N) has rows, each for itself.

    A thread adds up its share of the blocks in its own row; the rows are added in their order, so
    results do not depend on which thread was first.
    """
    threads, blocks = parts.shape[0], cells.shape[0]
    for t in prange(threads):
        first, end = t * blocks // threads, (t + 1) * blocks // threads
        parts[t, WORK:] = 0.0
        own = parts[t, WORK:]
        add_forces(law, geometry[first:end], cells[first:end], u, own, parts[t, :WORK])
    for t in range(threads):
        for i in range(f.size):
            f[i] += parts[t, WORK + i]


@inlined
def _row(A: Nine, a: int) -> Three:
    return A[3 * a], A[3 * a + 1], A[3 * a + 2]


@inlined
def _plus(x: Three, y: Three) -> Three:
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


@inlined
def _rest(x: Three, y: Three, z: Three) -> Three:
    """What node 0 has: minus the sum of the others."""
    return -(x[0] + y[0] + z[0]), -(x[1] + y[1] + z[1]), -(x[2] + y[2] + z[2])


@inlined
def _put_three(w: Floats, o: int, x: Three) -> None:
    w[o], w[o + 16], w[o + 32] = x[0], x[1], x[2]


@inlined
def _put_node_forces(w: Floats, o: int, f1: Three, f2: Three, f3: Three) -> None:
    """V P g of all four nodes, in the first three of the 12 rows that each has."""
    _put_three(w, o, _rest(f1, f2, f3))
    _put_three(w, o + WIDE * LANES, f1)
    _put_three(w, o + 2 * WIDE * LANES, f2)
    _put_three(w, o + 3 * WIDE * LANES, f3)


@inlined
def _put_block(w: Floats, o: int, rows: int, block: Six) -> None:
    """Three or all six entries of a symmetric block, in the rows after the force."""
    _put_three(w, o + 48, (block[0], block[1], block[2]))
    if rows == 6:
        _put_three(w, o + 96, (block[3], block[4], block[5]))


@inlined
def _node_svk(
    w: Floats, o: int, rows: int, g: Three, q: Three, ab: float, b: float, T: Nine
) -> None:
    """V (|g|^2 T + mu |q|^2 I + (lambda + mu) q q^T) of one node, q = F g.

    With F S g = T q this is g.S g I + (lambda + mu) q q^T + mu |g|^2 F F^T in fewer products.
    """
    m, x, y, z = dot(g, g), q[0] * q[0], q[1] * q[1], q[2] * q[2]
    s = b * (x + y + z)
    block = (
        s + ab * x + m * T[0],
        s + ab * y + m * T[4],
        s + ab * z + m * T[8],
        ab * q[0] * q[1] + m * T[1],
        ab * q[0] * q[2] + m * T[2],
        ab * q[1] * q[2] + m * T[5],
    )
    _put_block(w, o, rows, block)


@inlined
def _tangents_svk(w: Floats, rows: int) -> None:
    """The nodes' own blocks of the tangent, and the forces V F S g = V T F g.

    T = F S F^-1 = lambda tr(E) I + mu (F F^T - I) is S with H^T for H.
    """
    for l in range(LANES):
        G, a, b = _matrix(w, l), w[144 + l], w[160 + l]
        H = product(_matrix(w, _U + l), G)
        F, T, o = deformation(H), _second(transposed(H), a, b), _NODES + l
        g1, g2, g3 = _row(G, 0), _row(G, 1), _row(G, 2)
        q1, q2, q3 = times(F, g1), times(F, g2), times(F, g3)
        _put_node_forces(w, o, times(T, q1), times(T, q2), times(T, q3))
        g0, q0 = _rest(g1, g2, g3), _rest(q1, q2, q3)
        _node_svk(w, o, rows, g0, q0, a + b, b, T)
        _node_svk(w, o + 1 * WIDE * LANES, rows, g1, q1, a + b, b, T)
        _node_svk(w, o + 2 * WIDE * LANES, rows, g2, q2, a + b, b, T)
        _node_svk(w, o + 3 * WIDE * LANES, rows, g3, q3, a + b, b, T)


@inlined
def _node_neo_hooke(
    w: Floats, o: int, rows: int, g: Three, q: Three, h: Three, m: float, c: float, k: float
) -> None:
    """m |g|^2 I + c h h^T - k/2 (q h^T + h q^T) of one node, q = F g, h = cof(F) g."""
    s = m * dot(g, g)
    x, y, z = c * h[0] - k * q[0], c * h[1] - k * q[1], c * h[2] - k * q[2]
    block = (
        s + x * h[0],
        s + y * h[1],
        s + z * h[2],
        0.5 * (x * h[1] + y * h[0]),
        0.5 * (x * h[2] + z * h[0]),
        0.5 * (y * h[2] + z * h[1]),
    )
    _put_block(w, o, rows, block)


@inlined
def _tangents_neo_hooke(w: Floats, rows: int) -> None:
    """The nodes' own blocks of the tangent, and the forces V P g."""
    for l in range(LANES):
        G, a, b = _matrix(w, l), w[144 + l], w[160 + l]
        H = product(_matrix(w, _U + l), G)
        dJ, K = volume(H)
        y = inverse_cube_root(1 + dJ)
        i, h, k = _shares(H, dJ, y, a, b)
        g1, g2, g3 = _row(G, 0), _row(G, 1), _row(G, 2)
        q1, q2, q3 = times(H, g1), times(H, g2), times(H, g3)
        h1, h2, h3 = times(K, g1), times(K, g2), times(K, g3)
        f1, f2 = _mixed(i, g1, h, q1, k, h1), _mixed(i, g2, h, q2, k, h2)
        _put_node_forces(w, _NODES + l, f1, f2, _mixed(i, g3, h, q3, k, h3))
        q1, q2, q3 = _plus(g1, q1), _plus(g2, q2), _plus(g3, q3)
        h1, h2, h3 = _plus(g1, h1), _plus(g2, h2), _plus(g3, h3)
        g0, q0, h0 = _rest(g1, g2, g3), _rest(q1, q2, q3), _rest(h1, h2, h3)
        third = 1 + (2 * (H[0] + H[4] + H[8]) + inner(H, H)) / 3
        m, inverse, o = b * y * y, y * y * y, _NODES + l
        c = (5 / 3 * m * third + 0.5 * a * (2 + dJ * (dJ + 2))) * inverse * inverse
        k = 4 / 3 * m * inverse
        _node_neo_hooke(w, o, rows, g0, q0, h0, m, c, k)
        _node_neo_hooke(w, o + 1 * WIDE * LANES, rows, g1, q1, h1, m, c, k)
        _node_neo_hooke(w, o + 2 * WIDE * LANES, rows, g2, q2, h2, m, c, k)
        _node_neo_hooke(w, o + 3 * WIDE * LANES, rows, g3, q3, h3, m, c, k)


@inlined
def _tangents_carded(w: Floats, law: int, geometry: Floats, block: int, rows: int) -> None:
    """The nodes' own blocks of the tangent by its columns, and the forces V P g."""
    for l in range(LANES):
        G, a, b, o = _matrix(w, l), w[144 + l], w[160 + l], _NODES + l
        H, card = product(_matrix(w, _U + l), G), _card(geometry, block, l)
        P = _first_carded(law, H, a, b, card)
        g1, g2, g3 = _row(G, 0), _row(G, 1), _row(G, 2)
        _put_node_forces(w, o, times(P, g1), times(P, g2), times(P, g3))
        for node in range(4):
            g = g1 if node == 1 else g2 if node == 2 else g3 if node == 3 else _rest(g1, g2, g3)
            place = o + node * WIDE * LANES
            x = y = z = (0.0, 0.0, 0.0)
            for axis in range(3):  # dP g of D = e g^T
                e0 = 1.0 if axis == 0 else 0.0
                e1 = 1.0 if axis == 1 else 0.0
                e2 = 1.0 if axis == 2 else 0.0
                D = (
                    e0 * g[0], e0 * g[1], e0 * g[2], e1 * g[0], e1 * g[1], e1 * g[2],
                    e2 * g[0], e2 * g[1], e2 * g[2],
                )  # fmt: skip
                x, y, z = y, z, times(_first_along(law, H, D, a, b, card), g)
            _put_block(w, place, rows, (x[0], y[1], z[2], x[1], x[2], y[2]))


@inlined
def _mixed(a: float, x: Three, b: float, y: Three, c: float, z: Three) -> Three:
    return (
        a * x[0] + b * y[0] + c * z[0],
        a * x[1] + b * y[1] + c * z[1],
        a * x[2] + b * y[2] + c * z[2],
    )


def _add_four(typing: Any, to: Any, n: Any, w: Any, o: Any) -> Any:
    """Adds w[o + 16 k + j] to to[n[j] + k], j and k 0-3: four rows of four lanes, turned.

    As vectors, 16 sums are 4 loads, 8 shuffles and 4 sums; the compiler does not see to it.
    """
    four, picks = ir.VectorType(ir.DoubleType(), 4), ir.VectorType(ir.IntType(32), 4)
    proxy = cast(Callable[..., Any], cgutils.create_struct_proxy)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        def vector(i: int, index: Any) -> Any:
            array = proxy(signature.args[i])(context, builder, args[i])
            return builder.bitcast(builder.gep(array.data, [index]), four.as_pointer())

        def row(k: int) -> Any:
            index = builder.add(args[3], ir.Constant(args[3].type, k * LANES))
            return builder.load(vector(2, index), align=8)

        def turned(x: Any, y: Any, lanes: list[int]) -> Any:
            return builder.shuffle_vector(x, y, ir.Constant(picks, lanes))

        x, y, z, t = (row(k) for k in range(4))
        even, odd = [0, 4, 2, 6], [1, 5, 3, 7]
        pairs = [(turned(x, y, half), turned(z, t, half)) for half in (even, odd)]
        for j in range(4):
            lanes = [0, 1, 4, 5] if j < 2 else [2, 3, 6, 7]
            place = vector(0, builder.extract_value(args[1], j))
            old = builder.load(place, align=8)
            builder.store(builder.fadd(old, turned(*pairs[j % 2], lanes)), place, align=8)
        return context.get_dummy_value()

    return types.none(to, n, w, o), code


_add_lanes = cast(Callable[..., None], intrinsic(_add_four))


@inlined
def _place(cells: Cells, block: int, a: int, l: int, wide: int) -> Any:
    return np.uint64(cells[block, a, l]) // np.uint64(3) * np.uint64(wide)


@inlined
def _scatter_nodes(w: Floats, cells: Cells, block: int, wide: int, to: Floats) -> None:
    """Adds the first `wide` (8 or 12) rows of every node to `to`, as many numbers a node."""
    for l in range(0, LANES, 4):
        for a in range(4):
            n0, n1 = _place(cells, block, a, l, wide), _place(cells, block, a, l + 1, wide)
            n2, n3 = _place(cells, block, a, l + 2, wide), _place(cells, block, a, l + 3, wide)
            o = _NODES + a * WIDE * LANES + l
            for k in range(0, wide, 4):
                c = np.uint64(k)
                _add_lanes(to, (n0 + c, n1 + c, n2 + c, n3 + c), w, o + k * LANES)


@_compiled
def add_forces_and_blocks(
    law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, d: Floats, w: Floats
) -> None:
    """Adds the internal forces to f (N,) and the nodes' own blocks of the tangent to d.

    d (3 n,) takes the diagonal; d (6 n,) the blocks as xx, yy, zz, xy, xz, yz. They are added up
    side by side behind the workspace, w (WORK + 12 n,): one place in memory a node.
    """
    rows = 6 if d.size == 2 * f.size else 3
    wide = 4 * (1 + rows // 3)
    to = w[WORK : WORK + wide * (f.size // 3)]
    to[:] = 0.0
    for block in range(cells.shape[0]):
        _load(w, geometry, block)
        _gather(w, _U, cells, block, u)
        if geometry.ndim == 3:
            _tangents_carded(w, law, geometry, block, rows)
        elif law == SVK and rows == 6:
            _tangents_svk(w, 6)
        elif law == SVK:
            _tangents_svk(w, 3)
        elif rows == 6:
            _tangents_neo_hooke(w, 6)
        else:
            _tangents_neo_hooke(w, 3)
        if rows == 6:
            _scatter_nodes(w, cells, block, 12, to)
        else:
            _scatter_nodes(w, cells, block, 8, to)
    for n in range(f.size // 3):
        for i in range(3):
            f[3 * n + i] += to[wide * n + i]
            d[rows * n + i] += to[wide * n + 3 + i]
            if rows == 6:
                d[rows * n + 3 + i] += to[wide * n + 6 + i]


@inlined
def _products_svk(w: Floats) -> None:
    """V dP = dH V S + F V dS of the direction v, dH = dv/dX."""
    for l in range(LANES):
        G, a, b = _matrix(w, l), w[144 + l], w[160 + l]
        H, D = product(_matrix(w, _U + l), G), product(_matrix(w, _V + l), G)
        F, S = deformation(H), _second(H, a, b)
        Q = product(transposed(F), D)
        t = a * (Q[0] + Q[4] + Q[8])
        xy, xz, yz = b * (Q[1] + Q[3]), b * (Q[2] + Q[6]), b * (Q[5] + Q[7])
        dS = t + 2 * b * Q[0], xy, xz, xy, t + 2 * b * Q[4], yz, xz, yz, t + 2 * b * Q[8]
        P, R = product(D, S), product(F, dS)
        _put_forces(w, l, combined(1.0, P, 1.0, R), G)


@inlined
def _products_neo_hooke(w: Floats) -> None:
    """V dP along v: the tangent of `fem.laws.NeoHooke` times dH, with X = F^-T."""
    for l in range(LANES):
        G, a, b = _matrix(w, l), w[144 + l], w[160 + l]
        H, D = product(_matrix(w, _U + l), G), product(_matrix(w, _V + l), G)
        F, (dJ, K) = deformation(H), volume(H)
        y = inverse_cube_root(1 + dJ)
        m, third = b * y * y, 1 + (2 * (H[0] + H[4] + H[8]) + inner(H, H)) / 3
        p = 0.5 * a * dJ * (dJ + 2)
        X = combined(y * y * y, deformation(K), 0.0, F)
        into, along = inner(X, D), 2 / 3 * m * inner(F, D)
        straight = combined(-2 / 3 * m * into, F, m, D)
        c = (2 / 3 * m * third + a * (1 + dJ) * (1 + dJ)) * into - along
        turned = product(X, product(transposed(D), X))
        _put_forces(w, l, combined(1.0, combined(1.0, straight, c, X), m * third - p, turned), G)


@inlined
def _products_carded(w: Floats, law: int, geometry: Floats, block: int) -> None:
    for l in range(LANES):
        G = _matrix(w, l)
        H, D = product(_matrix(w, _U + l), G), product(_matrix(w, _V + l), G)
        card = _card(geometry, block, l)
        _put_forces(w, l, _first_along(law, H, D, w[144 + l], w[160 + l], card), G)


@_compiled
def add_products(
    law: int, geometry: Floats, cells: Cells, u: Floats, v: Floats, f: Floats, w: Floats
) -> None:
    """Adds K_t(u) v to f (N,)."""
    for block in range(cells.shape[0]):
        _load(w, geometry, block)
        _gather(w, _U, cells, block, u)
        _gather(w, _V, cells, block, v)
        if geometry.ndim == 3:
            _products_carded(w, law, geometry, block)
        elif law == SVK:
            _products_svk(w)
        else:
            _products_neo_hooke(w)
        _scatter(w, cells, block, f)


@inlined
def _energy(law: int, H: Nine, a: float, b: float, dJ: float) -> float:
    """V W of one cell; logarithms by log1p, so that small strains keep their digits."""
    if law == SVK:
        C = strain(H)
        trace = C[0] + C[1] + C[2]
        square = C[0] * C[0] + C[1] * C[1] + C[2] * C[2]
        square += 2 * (C[3] * C[3] + C[4] * C[4] + C[5] * C[5])
        return a / 8 * trace * trace + b / 4 * square
    trace = 2 * (H[0] + H[4] + H[8]) + inner(H, H)
    log = float(np.log1p(dJ))
    shape = (3 + trace) * float(np.expm1(-2 / 3 * log)) + trace
    return b / 2 * shape + a / 4 * (dJ * (dJ + 2) - 2 * log)


@inlined
def _energy_carded(law: int, H: Nine, a: float, b: float, dJ: float, card: Floats) -> float:
    if law < OGDEN:
        return energy_invariants(law == INVARIANTS_COUPLED, H, a, _four(card, b), dJ)
    return energy_ogden(law == OGDEN_COUPLED, H, a, card, dJ)


@_compiled
def looked_at(
    law: int, count: int, geometry: Floats, cells: Cells, u: Floats, w: Floats
) -> tuple[float, float, int]:
    """Strain energy J, least det F and number of det F <= 0 of the first `count` cells."""
    if geometry.ndim == 4:
        return bricks_looked_at(count, geometry, cells, u, w)
    energy, least, inverted = 0.0, np.inf, 0
    for block in range(cells.shape[0]):
        _load(w, geometry, block)
        _gather(w, _U, cells, block, u)
        for l in range(min(LANES, count - block * LANES)):
            H = product(_matrix(w, _U + l), _matrix(w, l))
            dJ, _ = volume(H)
            least = min(least, 1 + dJ)
            inverted += not 1 + dJ > 0
            a, b = w[144 + l], w[160 + l]
            if geometry.ndim == 3:
                energy += _energy_carded(law, H, a, b, dJ, _card(geometry, block, l))
            else:
                energy += _energy(law, H, a, b, dJ)
    return energy, least, inverted


@inlined
def _pull(springs: Springs, u: Floats, r: Floats) -> None:
    """r = K u of springs, rows of a csr matrix; zero without any."""
    starts, columns, values = springs
    for i in range(r.size):
        r[i] = 0.0
    if values.size > 0:
        for i in range(r.size):
            for k in range(starts[i], starts[i + 1]):
                r[i] += values[k] * u[columns[k]]


@inlined
def _moved(u: Floats, d: Floats, r: Floats, keep: Floats, gain: Floats) -> None:
    for i in range(u.size):
        d[i] = keep[i] * d[i] - gain[i] * r[i]
        u[i] += d[i]


@inlined
def _moved_damped(
    u: Floats, d: Floats, r: Floats, old: Floats, keep: Floats, gain: Floats, lag: float
) -> float:
    """The same with damping; returns what it took, J."""
    taken = 0.0
    for i in range(u.size):
        drag = lag * (r[i] - old[i])
        new = keep[i] * d[i] - gain[i] * (r[i] + drag)
        if gain[i] > 0:
            way = (new + d[i]) / 2
            taken += (1 - keep[i]) / gain[i] * way * way + drag * way
        d[i], old[i] = new, r[i]
        u[i] += new
    return taken


@inlined
def _rates(rows: Floats, keep: Floats, gain: Floats, lag: float, dt: float) -> float:
    """v and a at u (paper 003, eqs 13-14), which know the next increment; sum of d^2."""
    u, d, r, old, v, a = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    total = 0.0
    for i in range(u.size):
        drag = r[i] if lag == 0.0 else r[i] + lag * (r[i] - old[i])
        new = keep[i] * d[i] - gain[i] * drag
        v[i], a[i] = (new + d[i]) / (2 * dt), (new - d[i]) / (dt * dt)
        total += d[i] * d[i] + u[i] * 0.0
    return total


@inlined
def _input(columns: Floats, j: int, begin: Floats, end: Floats, share: float, first: int) -> float:
    """Row j of `columns` (., k) times the inputs from `first` on, a share of the way."""
    total = 0.0
    for c in range(columns.shape[1]):
        total += columns[j, c] * (begin[first + c] + share * (end[first + c] - begin[first + c]))
    return total


@_compiled
def advance(
    law: int,
    geometry: Floats,
    cells: Cells,
    springs: Springs,
    rows: Floats,
    keep: Floats,
    gain: Floats,
    lag: float,
    dt: float,
    held: Ints,
    moves: Floats,
    loaded: Ints,
    loads: Floats,
    begin: Floats,
    end: Floats,
    substeps: int,
    w: Floats,
    memory: Floats | None,
    series: Floats | None,
) -> tuple[float, float, float]:
    """`substeps` steps of central difference (paper 003, eq 18) in increments d = u - u_before.

    d' = keep d - gain (r + lag (r - old) - f), u' = u + d', with keep = (1 - b)/(1 + b), gain =
    (dt^2/m)/(1 + b), b = alpha dt/2, lag = beta/dt; zeros where held. `rows` (6, N) are u, d, the
    forces r at u and `old` before it, v and a: overwritten, the last two from nothing. `held`
    unknowns move by `moves` (held, k) times the first inputs, `loaded` ones take `loads`
    (loaded, l) times the others; inputs go linearly from `begin` to `end` (k + l,). Returns the
    work J of loads and prescribed motion and what damping took, up to half a step before the last
    time, and the sum of d^2, not finite where any unknown is not. `w` is a workspace (WORK,) or the
    parts of `add_forces_in_parts`. `memory` and `series` are those of `add_late_forces`.
    """
    u, d, r, old, v, a = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    k = moves.shape[1]
    work, taken = 0.0, 0.0
    damped = lag > 0 or bool((keep[gain > 0] < 1).any())
    for s in range(substeps):
        for j in range(loaded.size):
            i = loaded[j]
            work += _input(loads, j, begin, end, s / substeps, k) * d[i] / 2
            v[i], a[i] = d[i], lag * (r[i] - old[i])
        for j in range(held.size):
            work += r[held[j]] * d[held[j]] / 2
        if damped:
            taken += _moved_damped(u, d, r, old, keep, gain, lag)
        else:
            _moved(u, d, r, keep, gain)
        for j in range(loaded.size):
            i, f = loaded[j], _input(loads, j, begin, end, s / substeps, k)
            way, drag = (v[i] + d[i]) / 2, (1 - keep[i]) / gain[i]
            d[i] += gain[i] * f
            u[i] += gain[i] * f
            work += f * d[i] / 2
            if damped:  # what it took was reckoned without the load
                more = gain[i] * f / 2
                taken += drag * more * (2 * way + more) + a[i] * more
        for j in range(held.size):
            i = held[j]
            d[i] = _input(moves, j, begin, end, (s + 1) / substeps, 0) - u[i]
            u[i] += d[i]
            work += r[i] * d[i] / 2
        _pull(springs, u, r)
        # What follows is known to the compiler: each kind of body has its own code alone.
        if memory is not None and series is not None:
            add_late_forces(law, geometry, cells, u, r, w, memory, series)
        elif w.ndim == 2:
            add_forces_in_parts(law, geometry, cells, u, r, w)
        else:
            add_forces(law, geometry, cells, u, r, w)
    size = _rates(rows, keep, gain, lag, dt)
    for j in range(loaded.size):
        i, more = loaded[j], gain[loaded[j]] * _input(loads, j, begin, end, 1.0, k)
        v[i] += more / (2 * dt)
        a[i] += more / (dt * dt)
    for j in range(held.size):
        v[held[j]], a[held[j]] = d[held[j]] / dt, 0.0
    return work, taken, size
