"""Compiled element loops of tet4 meshes at large strain: force, diagonal of the tangent, product.

Blocks of 16 cells are gathered into one flat workspace, worked through lane by lane and scattered.
One workspace for all that a loop reads and writes is what lets the compiler use vector registers:
between separate arrays it cannot rule out overlap. Rows of 16 lanes in the workspace: 0-8 gradients
dN/dX of nodes 1-3, 9-10 moduli times volume, 11-19 edges of u, 20-28 edges of v, from 29 results.

Neither NaN nor infinity is assumed away (no `nnan`, `ninf`): a run that diverges must be seen to.
The numpy reference is `fem.hyperelastic.Body`.
"""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from validate.arrays import Floats

Cells = NDArray[np.int32]
Nine = tuple[float, float, float, float, float, float, float, float, float]
Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
_Function = TypeVar("_Function", bound=Callable[..., object])

LANES = 16
ROWS = 11  # of geometry: 9 gradients, 2 moduli
WORK = 64 * LANES  # length of the workspace
SVK, NEO_HOOKE = 0, 1
_U, _V, _OUT = ROWS * LANES, 20 * LANES, 29 * LANES
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_CUBE_ROOT = np.int32(0x54A2FA8C)  # bits of a float32 first guess of x^(-1/3), 3 % off


def _compiled(function: _Function) -> _Function:
    made: _Function = njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")(function)
    return made


def _inlined(function: _Function) -> _Function:
    made: _Function = njit(fastmath=_FAST, error_model="numpy", forceinline=True)(function)
    return made


@_inlined
def _matrix(w: Floats, o: int) -> Nine:
    return (
        w[o], w[o + 16], w[o + 32], w[o + 48], w[o + 64], w[o + 80], w[o + 96], w[o + 112],
        w[o + 128],
    )  # fmt: skip


@_inlined
def _product(A: Nine, B: Nine) -> Nine:
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@_inlined
def _times(A: Nine, x: Three) -> Three:
    return (
        A[0] * x[0] + A[1] * x[1] + A[2] * x[2],
        A[3] * x[0] + A[4] * x[1] + A[5] * x[2],
        A[6] * x[0] + A[7] * x[1] + A[8] * x[2],
    )


@_inlined
def _transposed(A: Nine) -> Nine:
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


@_inlined
def _deformation(H: Nine) -> Nine:
    """F = I + H."""
    return 1 + H[0], H[1], H[2], H[3], 1 + H[4], H[5], H[6], H[7], 1 + H[8]


@_inlined
def _dot(x: Three, y: Three) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@_inlined
def _inner(A: Nine, B: Nine) -> float:
    return (
        A[0] * B[0] + A[1] * B[1] + A[2] * B[2] + A[3] * B[3] + A[4] * B[4] + A[5] * B[5]
        + A[6] * B[6] + A[7] * B[7] + A[8] * B[8]
    )  # fmt: skip


@_inlined
def _strain(H: Nine) -> Six:
    """2 E = H + H^T + H^T H as xx, yy, zz, xy, xz, yz: small strains keep their digits."""
    return (
        2 * H[0] + H[0] * H[0] + H[3] * H[3] + H[6] * H[6],
        2 * H[4] + H[1] * H[1] + H[4] * H[4] + H[7] * H[7],
        2 * H[8] + H[2] * H[2] + H[5] * H[5] + H[8] * H[8],
        H[1] + H[3] + H[0] * H[1] + H[3] * H[4] + H[6] * H[7],
        H[2] + H[6] + H[0] * H[2] + H[3] * H[5] + H[6] * H[8],
        H[5] + H[7] + H[1] * H[2] + H[4] * H[5] + H[7] * H[8],
    )


@_inlined
def _second(H: Nine, a: float, b: float) -> Nine:
    """V S = a tr(E) I + 2 b E, a = V lambda, b = V mu (paper 003, eq 10)."""
    C = _strain(H)
    t = 0.5 * a * (C[0] + C[1] + C[2])
    xy, xz, yz = b * C[3], b * C[4], b * C[5]
    return t + b * C[0], xy, xz, xy, t + b * C[1], yz, xz, yz, t + b * C[2]


@_inlined
def _cofactor(H: Nine) -> Nine:
    return (
        H[4] * H[8] - H[5] * H[7], H[5] * H[6] - H[3] * H[8], H[3] * H[7] - H[4] * H[6],
        H[7] * H[2] - H[8] * H[1], H[8] * H[0] - H[6] * H[2], H[6] * H[1] - H[7] * H[0],
        H[1] * H[5] - H[2] * H[4], H[2] * H[3] - H[0] * H[5], H[0] * H[4] - H[1] * H[3],
    )  # fmt: skip


@_inlined
def _volume(H: Nine) -> tuple[float, Nine]:
    """J - 1 without cancellation, and cof(F) - I = tr(H) I - H^T + cof(H)."""
    K = _cofactor(H)
    t = H[0] + H[4] + H[8]
    dJ = t + K[0] + K[4] + K[8] + H[0] * K[0] + H[1] * K[1] + H[2] * K[2]
    return dJ, (
        t - H[0] + K[0], K[1] - H[3], K[2] - H[6],
        K[3] - H[1], t - H[4] + K[4], K[5] - H[7],
        K[6] - H[2], K[7] - H[5], t - H[8] + K[8],
    )  # fmt: skip


@_inlined
def _inverse_cube_root(x: float) -> float:
    """x^(-1/3) to rounding, without a division: a first guess from the bits, two steps of order
    four. NaN for x <= 0, where neo-Hooke has no state."""
    bits = np.float32(x).view(np.int32)
    y = np.float64(np.int32(_CUBE_ROOT - bits // np.int32(3)).view(np.float32))
    for _ in range(2):
        r = 1 - x * y * y * y
        y += y * r * (1 / 3 + r * (2 / 9 + r * (14 / 81)))
    return y if x > 0 else np.nan


@_inlined
def _first_svk(H: Nine, a: float, b: float) -> Nine:
    """V P = F V S."""
    return _product(_deformation(H), _second(H, a, b))


@_inlined
def _first_neo_hooke(H: Nine, a: float, b: float) -> Nine:
    """V P = b J^(-2/3) (F - tr C/3 F^-T) + a/2 (J^2 - 1) F^-T, a = V kappa, b = V mu.

    Written so that nothing of order 1 cancels at small strain.
    """
    dJ, K = _volume(H)
    y = _inverse_cube_root(1 + dJ)
    shear = b * y * y * (y * y * y)
    t = (2 * (H[0] + H[4] + H[8]) + _inner(H, H)) / 3
    bulk = 0.5 * a * dJ * (dJ + 2) * (y * y * y)
    h, k, i = shear * (1 + dJ), bulk - shear * (1 + t), shear * (dJ - t) + bulk
    return (
        i + h * H[0] + k * K[0], h * H[1] + k * K[1], h * H[2] + k * K[2],
        h * H[3] + k * K[3], i + h * H[4] + k * K[4], h * H[5] + k * K[5],
        h * H[6] + k * K[6], h * H[7] + k * K[7], i + h * H[8] + k * K[8],
    )  # fmt: skip


@_inlined
def _row(A: Nine, a: int) -> Three:
    return A[3 * a], A[3 * a + 1], A[3 * a + 2]


@_inlined
def _put_forces(w: Floats, l: int, P: Nine, G: Nine) -> None:
    """Forces V P g of nodes 1-3 in rows 0-8 of the results, 3 i + a - 1."""
    f = _product(P, _transposed(G))
    for k in range(9):
        w[_OUT + k * LANES + l] = f[k]


@_inlined
def _forces_svk(w: Floats) -> None:
    for l in range(LANES):
        G = _matrix(w, l)
        H = _product(_matrix(w, _U + l), G)
        _put_forces(w, l, _first_svk(H, w[144 + l], w[160 + l]), G)


@_inlined
def _forces_neo_hooke(w: Floats) -> None:
    for l in range(LANES):
        G = _matrix(w, l)
        H = _product(_matrix(w, _U + l), G)
        _put_forces(w, l, _first_neo_hooke(H, w[144 + l], w[160 + l]), G)


@_inlined
def _load(w: Floats, geometry: Floats, block: int) -> None:
    for k in range(ROWS * LANES):
        w[k] = geometry[block, k]


@_inlined
def _gather(w: Floats, at: int, cells: Cells, block: int, u: Floats) -> None:
    """Edges u_a - u_0 of the block's cells, rows 3 i + a - 1 from `at`."""
    for l in range(LANES):
        n0, n1 = cells[block, 0, l], cells[block, 1, l]
        n2, n3 = cells[block, 2, l], cells[block, 3, l]
        for i in range(3):
            x = u[n0 + i]
            w[at + 3 * i * LANES + l] = u[n1 + i] - x
            w[at + (3 * i + 1) * LANES + l] = u[n2 + i] - x
            w[at + (3 * i + 2) * LANES + l] = u[n3 + i] - x


@_inlined
def _scatter(w: Floats, cells: Cells, block: int, f: Floats) -> None:
    """Adds what `_put_forces` left; node 0 takes minus the sum of the others."""
    for l in range(LANES):
        n0, n1 = cells[block, 0, l], cells[block, 1, l]
        n2, n3 = cells[block, 2, l], cells[block, 3, l]
        for i in range(3):
            f1 = w[_OUT + 3 * i * LANES + l]
            f2 = w[_OUT + (3 * i + 1) * LANES + l]
            f3 = w[_OUT + (3 * i + 2) * LANES + l]
            f[n1 + i] += f1
            f[n2 + i] += f2
            f[n3 + i] += f3
            f[n0 + i] -= f1 + f2 + f3


@_compiled
def add_forces(law: int, geometry: Floats, cells: Cells, u: Floats, f: Floats, w: Floats) -> None:
    """Adds the internal forces N of all blocks to f (N,); cells (blocks, 4, 16) hold 3 x node."""
    for block in range(cells.shape[0]):
        _load(w, geometry, block)
        _gather(w, _U, cells, block, u)
        if law == SVK:
            _forces_svk(w)
        else:
            _forces_neo_hooke(w)
        _scatter(w, cells, block, f)
