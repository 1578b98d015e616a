"""Laws without logarithms at a point, and their tensors, compiled for one cell or for lanes.

V times P, its change along D and the energy, of H = F - I and moduli times volume, a = V lambda
(neo-Hooke: V kappa) and b = V mu; and what each node of a linear cell has of force and tangent.
Numbers are floats or `fem.kernels.lanes`. The other laws are in `fem.kernels.laws`.
"""

from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np
from numba import njit

from validate.fem.kernels.lanes import rough_inverse_cube_root, where_positive

# --- small tensors of the compiled element loops, as tuples that are inlined ---------------------

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


# --- St. Venant-Kirchhoff and neo-Hooke at a point, for one cell or for lanes --------------------

SVK, NEO_HOOKE, INVARIANTS, INVARIANTS_COUPLED, OGDEN, OGDEN_COUPLED = range(6)
Corners = tuple[Three, Three, Three, Three]  # what the four nodes have


@inlined
def second(H: Nine, a: float, b: float) -> Nine:
    """V S = a tr(E) I + 2 b E, a = V lambda, b = V mu (paper 003, eq 10)."""
    C = strain(H)
    t = 0.5 * a * (C[0] + C[1] + C[2])
    xy, xz, yz = b * C[3], b * C[4], b * C[5]
    return t + b * C[0], xy, xz, xy, t + b * C[1], yz, xz, yz, t + b * C[2]


@inlined
def first_svk(H: Nine, a: float, b: float) -> Nine:
    """V P = F V S."""
    S = second(H, a, b)
    return combined(1.0, S, 1.0, product(H, S))


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
def stretched(H: Nine) -> float:
    """J^(-1/3)."""
    return inverse_cube_root(1 + volume(H)[0])


@inlined
def first_neo_hooke(H: Nine, a: float, b: float) -> Nine:
    """V P."""
    return first_of_stretched(H, stretched(H), a, b)


@inlined
def first_of_stretched(H: Nine, y: float, a: float, b: float) -> Nine:
    """V P of neo-Hooke where y = J^(-1/3) is known, with cof F - I = tr(H) I - H^T + cof H."""
    K, t = cofactor(H), H[0] + H[4] + H[8]
    dJ = t + K[0] + K[4] + K[8] + (H[0] * K[0] + H[1] * K[1] + H[2] * K[2])
    i, h, k = _shares(H, dJ, y, a, b)
    i, d = i + k * t, h - k
    return (
        i + d * H[0] + k * K[0], h * H[1] + k * (K[1] - H[3]), h * H[2] + k * (K[2] - H[6]),
        h * H[3] + k * (K[3] - H[1]), i + d * H[4] + k * K[4], h * H[5] + k * (K[5] - H[7]),
        h * H[6] + k * (K[6] - H[2]), h * H[7] + k * (K[7] - H[5]), i + d * H[8] + k * K[8],
    )  # fmt: skip


@inlined
def along_svk(H: Nine, D: Nine, a: float, b: float) -> Nine:
    """V dP = D V S + F V dS."""
    F, S = deformation(H), second(H, a, b)
    Q = product(transposed(F), D)
    t = a * (Q[0] + Q[4] + Q[8])
    xy, xz, yz = b * (Q[1] + Q[3]), b * (Q[2] + Q[6]), b * (Q[5] + Q[7])
    dS = t + 2 * b * Q[0], xy, xz, xy, t + 2 * b * Q[4], yz, xz, yz, t + 2 * b * Q[8]
    return combined(1.0, product(D, S), 1.0, product(F, dS))


@inlined
def along_neo_hooke(H: Nine, D: Nine, a: float, b: float) -> Nine:
    """V dP: the tangent of `fem.laws.law.NeoHooke` times D, with X = F^-T."""
    F, (dJ, K) = deformation(H), volume(H)
    y = inverse_cube_root(1 + dJ)
    m, third = b * y * y, 1 + (2 * (H[0] + H[4] + H[8]) + inner(H, H)) / 3
    p = 0.5 * a * dJ * (dJ + 2)
    X = combined(y * y * y, deformation(K), 0.0, F)
    into, along = inner(X, D), 2 / 3 * m * inner(F, D)
    straight = combined(-2 / 3 * m * into, F, m, D)
    c = (2 / 3 * m * third + a * (1 + dJ) * (1 + dJ)) * into - along
    turned = product(X, product(transposed(D), X))
    return combined(1.0, combined(1.0, straight, c, X), m * third - p, turned)


@inlined
def energy(law: int, H: Nine, a: float, b: float, dJ: float) -> float:
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
def row(A: Nine, a: int) -> Three:
    return A[3 * a], A[3 * a + 1], A[3 * a + 2]


@inlined
def plus(x: Three, y: Three) -> Three:
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


@inlined
def rest(x: Three, y: Three, z: Three) -> Three:
    """What node 0 has: minus the sum of the others."""
    return -(x[0] + y[0] + z[0]), -(x[1] + y[1] + z[1]), -(x[2] + y[2] + z[2])


@inlined
def _mixed(a: float, x: Three, b: float, y: Three, c: float, z: Three) -> Three:
    return (
        a * x[0] + b * y[0] + c * z[0],
        a * x[1] + b * y[1] + c * z[1],
        a * x[2] + b * y[2] + c * z[2],
    )


@inlined
def _node_svk(g: Three, q: Three, ab: float, b: float, T: Nine) -> Six:
    """V (|g|^2 T + mu |q|^2 I + (lambda + mu) q q^T) of one node, q = F g.

    With F S g = T q this is g.S g I + (lambda + mu) q q^T + mu |g|^2 F F^T in fewer products.
    """
    m, x, y, z = dot(g, g), q[0] * q[0], q[1] * q[1], q[2] * q[2]
    s = b * (x + y + z)
    return (
        s + ab * x + m * T[0],
        s + ab * y + m * T[4],
        s + ab * z + m * T[8],
        ab * q[0] * q[1] + m * T[1],
        ab * q[0] * q[2] + m * T[2],
        ab * q[1] * q[2] + m * T[5],
    )


@inlined
def nodes_svk(H: Nine, G: Nine, a: float, b: float) -> tuple[Corners, tuple[Six, Six, Six, Six]]:
    """Forces V F S g = V T F g of the four nodes and their own blocks of the tangent.

    T = F S F^-1 = lambda tr(E) I + mu (F F^T - I) is S with H^T for H.
    """
    T, g1, g2, g3 = second(transposed(H), a, b), row(G, 0), row(G, 1), row(G, 2)
    q1, q2, q3 = plus(g1, times(H, g1)), plus(g2, times(H, g2)), plus(g3, times(H, g3))
    f1, f2, f3 = times(T, q1), times(T, q2), times(T, q3)
    g0, q0 = rest(g1, g2, g3), rest(q1, q2, q3)
    return (rest(f1, f2, f3), f1, f2, f3), (
        _node_svk(g0, q0, a + b, b, T), _node_svk(g1, q1, a + b, b, T),
        _node_svk(g2, q2, a + b, b, T), _node_svk(g3, q3, a + b, b, T),
    )  # fmt: skip


@inlined
def _node_neo_hooke(g: Three, q: Three, h: Three, m: float, c: float, k: float) -> Six:
    """m |g|^2 I + c h h^T - k/2 (q h^T + h q^T) of one node, q = F g, h = cof(F) g."""
    s = m * dot(g, g)
    x, y, z = c * h[0] - k * q[0], c * h[1] - k * q[1], c * h[2] - k * q[2]
    return (
        s + x * h[0],
        s + y * h[1],
        s + z * h[2],
        0.5 * (x * h[1] + y * h[0]),
        0.5 * (x * h[2] + z * h[0]),
        0.5 * (y * h[2] + z * h[1]),
    )


@inlined
def nodes_neo_hooke(
    H: Nine, G: Nine, a: float, b: float
) -> tuple[Corners, tuple[Six, Six, Six, Six]]:
    """The same: forces V P g and blocks."""
    dJ, K = volume(H)
    y = inverse_cube_root(1 + dJ)
    i, h, k = _shares(H, dJ, y, a, b)
    g1, g2, g3 = row(G, 0), row(G, 1), row(G, 2)
    q1, q2, q3 = times(H, g1), times(H, g2), times(H, g3)
    h1, h2, h3 = times(K, g1), times(K, g2), times(K, g3)
    f1, f2 = _mixed(i, g1, h, q1, k, h1), _mixed(i, g2, h, q2, k, h2)
    f3 = _mixed(i, g3, h, q3, k, h3)
    q1, q2, q3 = plus(g1, q1), plus(g2, q2), plus(g3, q3)
    h1, h2, h3 = plus(g1, h1), plus(g2, h2), plus(g3, h3)
    g0, q0, h0 = rest(g1, g2, g3), rest(q1, q2, q3), rest(h1, h2, h3)
    third = 1 + (2 * (H[0] + H[4] + H[8]) + inner(H, H)) / 3
    m, inverse = b * y * y, y * y * y
    c = (5 / 3 * m * third + 0.5 * a * (2 + dJ * (dJ + 2))) * inverse * inverse
    k = 4 / 3 * m * inverse
    return (rest(f1, f2, f3), f1, f2, f3), (
        _node_neo_hooke(g0, q0, h0, m, c, k), _node_neo_hooke(g1, q1, h1, m, c, k),
        _node_neo_hooke(g2, q2, h2, m, c, k), _node_neo_hooke(g3, q3, h3, m, c, k),
    )  # fmt: skip
