"""Small tensors of the compiled element loops, as tuples that are inlined.

Numbers are floats, or lanes of cells (`fem.kernels.lanes`).
"""

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

from validate.fem.kernels.lanes import rough_inverse_cube_root, where_positive

Nine = tuple[float, float, float, float, float, float, float, float, float]
Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
_Function = TypeVar("_Function", bound=Callable[..., object])

FAST = {"contract", "reassoc", "nsz", "arcp"}


def inlined(function: _Function) -> _Function:
    made = njit(fastmath=FAST, error_model="numpy", forceinline=True)(function)
    return cast(_Function, made)


def called(function: _Function) -> _Function:
    """One that stays a call: what is too long to be compiled anew at every place."""
    return cast(_Function, njit(fastmath=FAST, error_model="numpy")(function))


@inlined
def product(A: Nine, B: Nine) -> Nine:
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


@inlined
def times(A: Nine, x: Three) -> Three:
    return (
        A[0] * x[0] + A[1] * x[1] + A[2] * x[2],
        A[3] * x[0] + A[4] * x[1] + A[5] * x[2],
        A[6] * x[0] + A[7] * x[1] + A[8] * x[2],
    )


@inlined
def transposed(A: Nine) -> Nine:
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


@inlined
def deformation(H: Nine) -> Nine:
    """F = I + H."""
    return 1 + H[0], H[1], H[2], H[3], 1 + H[4], H[5], H[6], H[7], 1 + H[8]


@inlined
def dot(x: Three, y: Three) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@inlined
def inner(A: Nine, B: Nine) -> float:
    return (
        A[0] * B[0] + A[1] * B[1] + A[2] * B[2] + A[3] * B[3] + A[4] * B[4] + A[5] * B[5]
        + A[6] * B[6] + A[7] * B[7] + A[8] * B[8]
    )  # fmt: skip


@inlined
def cofactor(H: Nine) -> Nine:
    return (
        H[4] * H[8] - H[5] * H[7], H[5] * H[6] - H[3] * H[8], H[3] * H[7] - H[4] * H[6],
        H[7] * H[2] - H[8] * H[1], H[8] * H[0] - H[6] * H[2], H[6] * H[1] - H[7] * H[0],
        H[1] * H[5] - H[2] * H[4], H[2] * H[3] - H[0] * H[5], H[0] * H[4] - H[1] * H[3],
    )  # fmt: skip


@inlined
def volume(H: Nine) -> tuple[float, Nine]:
    """J - 1 without cancellation, and cof(F) - I = tr(H) I - H^T + cof(H)."""
    K = cofactor(H)
    t = H[0] + H[4] + H[8]
    dJ = t + K[0] + K[4] + K[8] + H[0] * K[0] + H[1] * K[1] + H[2] * K[2]
    return dJ, (
        t - H[0] + K[0], K[1] - H[3], K[2] - H[6],
        K[3] - H[1], t - H[4] + K[4], K[5] - H[7],
        K[6] - H[2], K[7] - H[5], t - H[8] + K[8],
    )  # fmt: skip


@inlined
def inverse_cube_root(x: float) -> float:
    """x^(-1/3) to rounding, without a division: a first guess from the bits, two steps of order
    four. NaN for x <= 0, where neo-Hooke has no state."""
    y = rough_inverse_cube_root(x)
    for _ in range(2):
        r = 1 - x * y * y * y
        y += y * r * (1 / 3 + r * (2 / 9 + r * (14 / 81)))
    found: float = where_positive(x, y)
    return found


@inlined
def combined(a: float, A: Nine, b: float, B: Nine) -> Nine:
    return (
        a * A[0] + b * B[0], a * A[1] + b * B[1], a * A[2] + b * B[2],
        a * A[3] + b * B[3], a * A[4] + b * B[4], a * A[5] + b * B[5],
        a * A[6] + b * B[6], a * A[7] + b * B[7], a * A[8] + b * B[8],
    )  # fmt: skip


@inlined
def strain(H: Nine) -> Six:
    """2 E = H + H^T + H^T H as xx, yy, zz, xy, xz, yz: small strains keep their digits."""
    return (
        2 * H[0] + H[0] * H[0] + H[3] * H[3] + H[6] * H[6],
        2 * H[4] + H[1] * H[1] + H[4] * H[4] + H[7] * H[7],
        2 * H[8] + H[2] * H[2] + H[5] * H[5] + H[8] * H[8],
        H[1] + H[3] + H[0] * H[1] + H[3] * H[4] + H[6] * H[7],
        H[2] + H[6] + H[0] * H[2] + H[3] * H[5] + H[6] * H[8],
        H[5] + H[7] + H[1] * H[2] + H[4] * H[5] + H[7] * H[8],
    )


@inlined
def inverse(H: Nine) -> tuple[Nine, float]:
    """F^-T and J - 1; the first not finite where det F <= 0, where no law has a state."""
    dJ, K = volume(H)
    y = inverse_cube_root(1 + dJ)
    return combined(y * y * y, deformation(K), 0.0, H), dJ
