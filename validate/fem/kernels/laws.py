"""Mooney-Rivlin, Yeoh, Ogden and coupled laws at a point, compiled.

V times energy, P and its change along D, of H and a cell's card: bulk V, then C10 V, C01 V, C20 V,
C30 V, or for Ogden pairs of mu_p V and alpha_p. Principal directions come from Jacobi's rotations:
the closed form of a cubic loses half the digits where two stretches are equal, and all small
strains are near such a state.
"""

import numpy as np

from validate.arrays import Floats
from validate.fem.kernels.points import (
    Nine,
    Six,
    Three,
    called,
    combined,
    deformation,
    inlined,
    inner,
    inverse,
    inverse_cube_root,
    product,
    strain,
    transposed,
    volume,
)

Four = tuple[float, float, float, float]
_SWEEPS = 8  # of Jacobi: four settle most matrices


@inlined
def _left(H: Nine) -> Nine:
    """F F^T - I."""
    B = strain(transposed(H))
    return B[0], B[3], B[4], B[3], B[1], B[5], B[4], B[5], B[2]


@inlined
def _plus_trace(A: Nine, a: float) -> Nine:
    return A[0] + a, A[1], A[2], A[3], A[4] + a, A[5], A[6], A[7], A[8] + a


@inlined
def first_split(H: Nine, a: float, c: Four) -> Nine:
    """V P of C10 V, C01 V, C20 V, C30 V, and `a` the bulk modulus times V."""
    (G, dJ), B = inverse(H), _left(H)
    t, BB = B[0] + B[4] + B[8], product(B, B)
    y = inverse_cube_root(1 + dJ)
    j = y * y
    x = j * (3 + t) - 3
    s = c[0] + x * (2 * c[2] + 3 * c[3] * x)
    tau = combined(2 * (s * j + c[1] * j * j * (1 + t)), B, -2 * c[1] * j * j, BB)
    mean = (tau[0] + tau[4] + tau[8]) / 3
    return product(_plus_trace(tau, 0.5 * a * dJ * (dJ + 2) - mean), G)


@called
def first_coupled(H: Nine, a: float, c: Four) -> Nine:
    """The same of the coupled form, `a` its lambda times V; for loops that take a cell at a time,
    since no vector register takes the logarithm."""
    (G, dJ), B = inverse(H), _left(H)
    t, BB = B[0] + B[4] + B[8], product(B, B)
    more = t * (2 * c[2] + 3 * c[3] * t)
    tau = combined(2 * (c[0] + more + c[1] * (1 + t)), B, -2 * c[1], BB)
    return product(_plus_trace(tau, 2 * (more + c[1] * t) + a * np.log1p(dJ)), G)


@called
def product_invariants(coupled: bool, H: Nine, D: Nine, a: float, c: Four) -> Nine:
    """V dP along D, by the derivatives of W(I1, I2, ln J)."""
    (G, dJ), F = inverse(H), deformation(H)
    C = product(transposed(F), F)
    I1 = C[0] + C[4] + C[8]
    d2 = combined(2 * I1, F, -2.0, product(F, C))
    L = inner(G, D)
    i1, i2 = 2 * inner(F, D), inner(d2, D)
    if coupled:
        x = I1 - 3
        W1, W2 = c[0] + x * (2 * c[2] + 3 * c[3] * x), c[1]
        WL = a * np.log1p(dJ) - 2 * (c[0] + 2 * c[1])
        w1, w2, wL = (2 * c[2] + 6 * c[3] * x) * i1, 0.0, a * L
    else:
        y = inverse_cube_root(1 + dJ)
        j, I2 = y * y, 0.5 * (I1 * I1 - inner(C, C))
        x = j * I1
        s, curve = c[0] + (x - 3) * (2 * c[2] + 3 * c[3] * (x - 3)), 2 * c[2] + 6 * c[3] * (x - 3)
        q = c[1] * j * j
        W1, W2 = s * j, q
        WL = 0.5 * a * dJ * (dJ + 2) - 2 / 3 * s * x - 4 / 3 * q * I2
        cross = -2 / 3 * j * (s + curve * x)
        w1, w2 = curve * j * j * i1 + cross * L, -4 / 3 * q * L
        wL = cross * i1 - 4 / 3 * q * i2
        wL += (a * (1 + dJ) * (1 + dJ) + 4 / 9 * (s + curve * x) * x + 16 / 9 * q * I2) * L
    Q = product(transposed(F), D)
    two = combined(1.0, Q, 1.0, transposed(Q))
    turned = product(G, product(transposed(D), G))
    dP = combined(2 * w1 + 2 * W2 * i1, F, w2, d2)
    dP = combined(1.0, dP, 2 * (W1 + W2 * I1), D)
    dP = combined(1.0, dP, -2 * W2, combined(1.0, product(D, C), 1.0, product(F, two)))
    return combined(1.0, dP, 1.0, combined(wL, G, -WL, turned))


@called
def energy_invariants(coupled: bool, H: Nine, a: float, c: Four, dJ: float) -> float:
    """V W."""
    B, L = _left(H), float(np.log1p(dJ))
    t = B[0] + B[4] + B[8]
    i2 = 2 * t + 0.5 * (t * t - inner(B, B))
    if coupled:
        shape = t * (c[0] + t * (c[2] + t * c[3])) + c[1] * i2
        return shape + 0.5 * a * L * L - 2 * (c[0] + 2 * c[1]) * L
    j, e = np.exp(-2 / 3 * L), np.expm1(-2 / 3 * L)
    x, y = 3 * e + j * t, 3 * np.expm1(-4 / 3 * L) + j * j * i2
    shape = x * (c[0] + x * (c[2] + x * c[3])) + c[1] * y
    return float(shape + a / 4 * (dJ * (dJ + 2) - 2 * L))


@inlined
def _rotated(p: float, q: float, o: float) -> tuple[float, float, float]:
    """Jacobi's t = tan, cosine and sine for the diagonal p, q and the entry o between them."""
    if o == 0.0:
        return 0.0, 1.0, 0.0
    h = (q - p) / (2 * o)
    t = 1 / (abs(h) + np.sqrt(h * h + 1))
    t = t if h >= 0 else -t
    c = 1 / np.sqrt(t * t + 1)
    return t, c, t * c


@called
def principal(C: Six) -> tuple[Three, Nine]:
    """Eigenvalues of a symmetric xx, yy, zz, xy, xz, yz, and eigenvectors in columns."""
    x, y, z, a, b, c = C
    n00, n01, n02 = 1.0, 0.0, 0.0
    n10, n11, n12 = 0.0, 1.0, 0.0
    n20, n21, n22 = 0.0, 0.0, 1.0
    for _ in range(_SWEEPS):
        off = a * a + b * b + c * c
        if not off > 1e-36 * (x * x + y * y + z * z):
            break
        t, k, s = _rotated(x, y, a)
        x, y, a, b, c = x - t * a, y + t * a, 0.0, k * b - s * c, s * b + k * c
        n00, n01 = k * n00 - s * n01, s * n00 + k * n01
        n10, n11 = k * n10 - s * n11, s * n10 + k * n11
        n20, n21 = k * n20 - s * n21, s * n20 + k * n21
        t, k, s = _rotated(x, z, b)
        x, z, b, a, c = x - t * b, z + t * b, 0.0, k * a - s * c, s * a + k * c
        n00, n02 = k * n00 - s * n02, s * n00 + k * n02
        n10, n12 = k * n10 - s * n12, s * n10 + k * n12
        n20, n22 = k * n20 - s * n22, s * n20 + k * n22
        t, k, s = _rotated(y, z, c)
        y, z, c, a, b = y - t * c, z + t * c, 0.0, k * a - s * b, s * a + k * b
        n01, n02 = k * n01 - s * n02, s * n01 + k * n02
        n11, n12 = k * n11 - s * n12, s * n11 + k * n12
        n21, n22 = k * n21 - s * n22, s * n21 + k * n22
    return (x, y, z), (n00, n01, n02, n10, n11, n12, n20, n21, n22)


@inlined
def _logs(H: Nine, dJ: float) -> tuple[Three, Nine]:
    """Logarithms of the principal stretches, and their directions; not finite if det F <= 0."""
    x, N = principal(strain(H))
    lost = 0.0 if 1 + dJ > 0 else np.nan
    return (
        0.5 * np.log1p(x[0]) + lost, 0.5 * np.log1p(x[1]) + lost, 0.5 * np.log1p(x[2]) + lost
    ), N  # fmt: skip


@inlined
def _kirchhoff(coupled: bool, l: Three, a: float, card: Floats) -> Three:
    """V times the principal Kirchhoff stresses; `card` (2 p,) mu_p V and alpha_p."""
    L = l[0] + l[1] + l[2]
    third = 0.0 if coupled else L / 3
    x, y, z = 0.0, 0.0, 0.0
    for p in range(card.shape[0] // 2):
        m, k = card[2 * p], card[2 * p + 1]
        x += m * np.expm1(k * (l[0] - third))
        y += m * np.expm1(k * (l[1] - third))
        z += m * np.expm1(k * (l[2] - third))
    pressure = a * L if coupled else 0.5 * a * np.expm1(2 * L) - (x + y + z) / 3
    return x + pressure, y + pressure, z + pressure


@inlined
def _turned(N: Nine, A: Nine) -> Nine:
    """N A N^T."""
    return product(N, product(A, transposed(N)))


@inlined
def _second(l: Three, tau: Three, N: Nine) -> Nine:
    """V S = sum of tau_a/l_a^2 N_a N_a."""
    x, y, z = (tau[0] * np.exp(-2 * l[0]), tau[1] * np.exp(-2 * l[1]), tau[2] * np.exp(-2 * l[2]))
    return _turned(N, (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z))


@called
def first_ogden(coupled: bool, H: Nine, a: float, card: Floats) -> Nine:
    """V P = F V S."""
    l, N = _logs(H, volume(H)[0])
    return product(deformation(H), _second(l, _kirchhoff(coupled, l, a, card), N))


@inlined
def _ratio(k: float, d: float) -> float:
    """(e^(k d) - 1)/(e^d - 1), k where d = 0."""
    return float(np.expm1(k * d) / np.expm1(d)) if d != 0.0 else k


@called
def _quotient(l: Three, i: int, j: int, third: float, common: float, card: Floats) -> float:
    """V (S_j - S_i)/(l_j^2 - l_i^2), and its limit."""
    total, x = 0.0, np.exp(-2 * l[i])
    for p in range(card.shape[0] // 2):
        m, k = card[2 * p], card[2 * p + 1]
        total += m * np.exp(k * (l[i] - third)) * _ratio(k / 2 - 1, 2 * (l[j] - l[i]))
    return float(x * (x * total - common * np.exp(-2 * l[j])))


@called
def product_ogden(coupled: bool, H: Nine, D: Nine, a: float, card: Floats) -> Nine:
    """V dP = D V S + F V dS, dS in the principal directions."""
    dJ, _ = volume(H)
    F, (l, N) = deformation(H), _logs(H, dJ)
    tau = _kirchhoff(coupled, l, a, card)
    L = l[0] + l[1] + l[2]
    third = 0.0 if coupled else L / 3
    sums, powers = (0.0, 0.0, 0.0), 0.0
    for p in range(card.shape[0] // 2):
        m, k = card[2 * p], card[2 * p + 1]
        x, y = m * np.exp(k * (l[0] - third)), m * np.exp(k * (l[1] - third))
        z = m * np.exp(k * (l[2] - third))
        powers += x + y + z
        sums = sums[0] + k * x, sums[1] + k * y, sums[2] + k * z
    common = (tau[0] + tau[1] + tau[2] - powers) / 3
    e = product(transposed(N), product(product(transposed(F), D), N))
    i0, i1, i2 = np.exp(-2 * l[0]), np.exp(-2 * l[1]), np.exp(-2 * l[2])
    e0, e1, e2 = e[0] * i0, e[4] * i1, e[8] * i2  # changes of the logarithms
    if coupled:
        t = a * (e0 + e1 + e2)
        t0, t1, t2 = sums[0] * e0 + t, sums[1] * e1 + t, sums[2] * e2 + t
    else:
        mean, whole = (e0 + e1 + e2) / 3, a * np.exp(2 * L) * (e0 + e1 + e2)
        d0, d1, d2 = sums[0] * (e0 - mean), sums[1] * (e1 - mean), sums[2] * (e2 - mean)
        t = whole - (d0 + d1 + d2) / 3
        t0, t1, t2 = d0 + t, d1 + t, d2 + t
    xy = _quotient(l, 0, 1, third, common, card) * (e[1] + e[3])
    xz = _quotient(l, 0, 2, third, common, card) * (e[2] + e[6])
    yz = _quotient(l, 1, 2, third, common, card) * (e[5] + e[7])
    dS = _turned(N, (
        (t0 - 2 * tau[0] * e0) * i0, xy, xz, xy, (t1 - 2 * tau[1] * e1) * i1, yz,
        xz, yz, (t2 - 2 * tau[2] * e2) * i2,
    ))  # fmt: skip
    return combined(1.0, product(D, _second(l, tau, N)), 1.0, product(F, dS))


@called
def energy_ogden(coupled: bool, H: Nine, a: float, card: Floats, dJ: float) -> float:
    """V W."""
    l, _ = _logs(H, dJ)
    L = l[0] + l[1] + l[2]
    third = 0.0 if coupled else L / 3
    total, moduli = 0.0, 0.0
    for p in range(card.shape[0] // 2):
        m, k = card[2 * p], card[2 * p + 1]
        if m != 0.0:
            x, y = np.expm1(k * (l[0] - third)), np.expm1(k * (l[1] - third))
            total += m / k * (x + y + np.expm1(k * (l[2] - third)))
            moduli += m
    if coupled:
        return float(total - moduli * L + 0.5 * a * L * L)
    return float(total + a / 4 * (dJ * (dJ + 2) - 2 * L))
