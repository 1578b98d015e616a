"""Strain energies: Ogden, invariants (Mooney-Rivlin, Yeoh, neo-Hooke), volumetric parts.

Functions of the displacement gradient H = F - I, accurate at small strains.

Ogden, in the principal stretches l_a of F, sums over terms (mu_p, alpha_p):
"split": W = sum mu_p/alpha_p (m_1^alpha_p + m_2^alpha_p + m_3^alpha_p - 3) of m_a = J^(-1/3) l_a,
and kappa/4 (J^2 - 1 - 2 ln J); "coupled": the same of l_a, - sum mu_p ln J + lambda/2 ln^2 J.

Stretches come from the eigenvalues of 2 E, whose digits small strains keep. In the tangent the
quotient (S_b - S_a)/(l_b^2 - l_a^2) is written with expm1 of the logarithm of l_b^2/l_a^2, so that
equal stretches are no special case but the one point where both are zero. Sources: Ogden (1972);
Simo & Taylor (1991); Holzapfel (2000), 6.5-6.6.

Invariants: f(I1) = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3, with I1, I2 of C = F^T F.
"split": W = f(J^(-2/3) I1) + C01 (J^(-4/3) I2 - 3) + kappa/4 (J^2 - 1 - 2 ln J).
"coupled": W = f(I1) + C01 (I2 - 3) - 2 (C10 + 2 C01) ln J + bulk/2 ln^2 J.
Sources: Mooney (1940), Rivlin (1948), Yeoh (1993); Bonet & Wood (2008), ch. 6.

Volumetric parts, functions of J - 1 and of ln J: "split" is convex in J and infinite at J = 0 and
J = infinity (Simo & Miehe 1992); "coupled" stands beside the shear terms' own - c ln J (Bonet &
Wood 2008, 6.4).
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.scene.laws import VolumetricName

EYE = np.eye(3)
_CYCLES = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
#: The factors of all nine minors, in F's order: rows j, k, columns s, t.
_MINORS = tuple(
    np.array([3 * rows[row] + columns[column] for rows in _CYCLES for columns in _CYCLES])
    for row, column in ((1, 1), (2, 2), (1, 2), (2, 1))
)
_FEW = 9 * 512  # numbers up to which that is faster


def green_strain(H: Floats) -> Floats:
    """E (..., 3, 3) = (H + H^T + H^T H) / 2."""
    Ht = np.swapaxes(H, -1, -2)
    return np.asarray((H + Ht + Ht @ H) / 2)


def volume_change(H: Floats) -> Floats:
    """J - 1 (...), without the cancellation of det(I + H) - 1."""
    C = cofactor(H)
    return np.asarray(trace(H) + trace(C) + (H[..., 0, :] * C[..., 0, :]).sum(axis=-1))


def cofactor(F: Floats) -> Floats:
    """det(F) F^-T (..., 3, 3), also where F is singular."""
    if F.size < _FEW:  # calls of numpy take the time, not the numbers
        f = F.reshape(*F.shape[:-2], 9)
        js, kt, jt, ks = (f.take(at, axis=-1) for at in _MINORS)
        return np.asarray((js * kt - jt * ks).reshape(F.shape))
    C = np.empty_like(F)
    for i, j, k in _CYCLES:
        for r, s, t in _CYCLES:
            C[..., i, r] = F[..., j, s] * F[..., k, t] - F[..., j, t] * F[..., k, s]
    return C


def trace(E: Floats) -> Floats:
    return np.asarray(np.einsum("...ii->...", E))


def outer(indices: str, a: Floats, b: Floats) -> Floats:
    """Return the product of two tensors per point, e.g. "iJ,jK->JijK"."""
    inputs, out = indices.split("->")
    left, right = inputs.split(",")
    return np.asarray(np.einsum(f"...{left},...{right}->...{out}", a, b))


def split_energy(dJ: Floats, kappa: float) -> Floats:
    """Pa; dJ = J - 1."""
    return np.asarray(kappa / 4 * (dJ * (dJ + 2) - 2 * np.log1p(dJ)))


class ByVolume:
    """The measure s = J - 1 and the volumetric energy of it, of either form."""

    form: VolumetricName

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        return volume_change(H), cofactor(H + EYE)

    def curvature(self, H: Floats) -> Floats:
        F = H + EYE
        J = (1 + volume_change(H))[..., None, None]
        G = cofactor(F) / J
        return np.asarray(outer("iJ,jK->JijK", J * G, G) - outer("iK,jJ->JijK", J * G, G))

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        J = 1 + s
        if self.form == "coupled":
            L = np.log1p(s)
            return kappa / 2 * L**2, kappa * L / J, kappa * (1 - L) / J**2
        slope = kappa / 2 * s * (s + 2) / J
        return split_energy(s, kappa), slope, kappa / 2 * (1 + 1 / J**2)


_TURNS = ((0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1))


@dataclass(frozen=True)
class Ogden(ByVolume):
    """`terms` (mu_p Pa, alpha_p); kappa Pa, of the split form or of all at rest."""

    terms: tuple[tuple[float, float], ...]
    kappa: float
    form: VolumetricName
    least_stretch: float
    most_stretch: float

    @property
    def mu(self) -> float:
        return sum(m * a for m, a in self.terms) / 2

    def energy(self, H: Floats) -> Floats:
        logs, _ = _principal(H)
        L = logs.sum(axis=-1)
        shape = self._shape(logs)
        energy = sum(m / a * np.expm1(a * shape).sum(axis=-1) for m, a in self.terms)
        if self.form == "coupled":
            return np.asarray(energy - sum(m for m, _ in self.terms) * L + self._bulk / 2 * L**2)
        return np.asarray(energy + split_energy(np.expm1(L), self.kappa))

    def stress(self, H: Floats) -> Floats:
        """P = F S, S = sum of tau_a/l_a^2 N_a N_a."""
        logs, N = _principal(H)
        second = (N * (self._kirchhoff(logs) * np.exp(-2 * logs))[..., None, :]) @ _transposed(N)
        return np.asarray((H + EYE) @ second)

    def tangent(self, H: Floats) -> Floats:
        """delta_ij S_JK + D^T M D, D_ab = F N_a N_b: M holds dS/dE in the directions N_a."""
        logs, N = _principal(H)
        tau, x = self._kirchhoff(logs), np.exp(2 * logs)
        second = (N * (tau / x)[..., None, :]) @ _transposed(N)
        D = outer("ia,Jb->abiJ", (H + EYE) @ N, N).reshape(*H.shape[:-2], 9, 9)
        A = (_transposed(D) @ self._moduli(logs, tau, x) @ D).reshape(*H.shape[:-2], 3, 3, 3, 3)
        return np.moveaxis(A, -3, -4) + outer("ij,JK->JijK", EYE, second)

    def _moduli(self, logs: Floats, tau: Floats, x: Floats) -> Floats:
        """M (..., 9, 9) Pa, rows and columns (a, b): dS_a/dE_b, and what turns a towards b."""
        M = np.zeros((*x.shape[:-1], 9, 9))
        M[..., ::4, ::4] = (self._slopes(logs) - 2 * tau[..., None, :] * EYE) / _pairs(x)
        quotients = self._quotients(logs, tau)
        for a, b in _TURNS:
            M[..., 3 * a + b, 3 * a + b] = M[..., 3 * a + b, 3 * b + a] = quotients[..., a, b]
        return M

    @property
    def _bulk(self) -> float:
        """lambda Pa of the coupled form."""
        return self.kappa - 2 * self.mu / 3

    def _shape(self, logs: Floats) -> Floats:
        """Logarithms of what the terms are powers of."""
        mean = 0.0 if self.form == "coupled" else logs.mean(axis=-1, keepdims=True)
        return np.asarray(logs - mean)

    def _kirchhoff(self, logs: Floats) -> Floats:
        """Principal Kirchhoff stresses tau_a (..., 3) Pa."""
        shape, L = self._shape(logs), logs.sum(axis=-1, keepdims=True)
        tau = sum(m * np.expm1(a * shape) for m, a in self.terms)
        if self.form == "coupled":
            return np.asarray(tau + self._bulk * L)
        tau = tau - np.mean(tau, axis=-1, keepdims=True)
        return np.asarray(tau + self.kappa / 2 * np.expm1(2 * L))

    def _slopes(self, logs: Floats) -> Floats:
        """d tau_a/d ln l_b (..., 3, 3) Pa."""
        shape, J = self._shape(logs), np.exp(logs.sum(axis=-1))[..., None, None]
        powers = [m * a * np.exp(a * shape) for m, a in self.terms]
        total = np.sum(powers, axis=0)
        if self.form == "coupled":
            return np.asarray(total[..., None, :] * EYE + self._bulk)
        third = total / 3
        mean = third.mean(axis=-1)[..., None, None]
        mixed = third[..., :, None] + third[..., None, :] - mean
        return np.asarray(total[..., None, :] * EYE - mixed + self.kappa * J**2)

    def _quotients(self, logs: Floats, tau: Floats) -> Floats:
        """(S_b - S_a)/(l_b^2 - l_a^2) (..., 3, 3) Pa, its limit where the two are equal."""
        shape, x = self._shape(logs), np.exp(2 * logs)
        apart = 2 * (logs[..., None, :] - logs[..., :, None])
        powers = [m * np.exp(a * shape) for m, a in self.terms]
        common = (tau - np.sum(powers, axis=0)).mean(axis=-1)[..., None, None]
        quotient = sum(
            p[..., :, None] / x[..., :, None] ** 2 * _ratio(a / 2 - 1, apart)
            for p, (_, a) in zip(powers, self.terms, strict=True)
        )
        return np.asarray(quotient - common / _pairs(x))


def _principal(H: Floats) -> tuple[Floats, Floats]:
    """Logarithms of the principal stretches (..., 3), rising, and directions N (..., 3, 3) at rest
    in columns. A state with det F <= 0 has the stretches of C; not finite where there is none."""
    values, N = np.linalg.eigh(2 * green_strain(H))
    return np.asarray(np.log1p(values) / 2), N


def _ratio(k: float, d: Floats) -> Floats:
    """(e^(k d) - 1)/(e^d - 1), k where d = 0."""
    at_zero = d == 0
    safe = np.where(at_zero, 1.0, d)
    return np.where(at_zero, k, np.expm1(k * safe) / np.expm1(safe))


def _pairs(x: Floats) -> Floats:
    return x[..., :, None] * x[..., None, :]


def _transposed(A: Floats) -> Floats:
    return np.swapaxes(A, -1, -2)


@dataclass(frozen=True)
class Polynomial(ByVolume):
    """C10, C01, C20, C30, kappa, bulk Pa; `bulk` is kappa of the split form, or of ln^2 J/2."""

    C10: float
    C01: float
    C20: float
    C30: float
    kappa: float
    bulk: float
    form: VolumetricName
    least_stretch: float
    most_stretch: float

    @property
    def mu(self) -> float:
        return 2 * (self.C10 + self.C01)

    def energy(self, H: Floats) -> Floats:
        B, dJ = _left(H), volume_change(H)
        t, L = trace(B), np.log1p(dJ)
        i2 = 2 * t + (t * t - (B * B).sum(axis=(-2, -1))) / 2  # I2 - 3
        if self.form == "coupled":
            volume = self.bulk / 2 * L**2 - 2 * (self.C10 + 2 * self.C01) * L
            return np.asarray(self._f(t) + self.C01 * i2 + volume)
        j = np.exp(-2 / 3 * L)
        x, y = 3 * np.expm1(-2 / 3 * L) + j * t, 3 * np.expm1(-4 / 3 * L) + j * j * i2
        return np.asarray(self._f(x) + self.C01 * y + split_energy(dJ, self.bulk))

    def stress(self, H: Floats) -> Floats:
        """P = tau F^-T of the Kirchhoff stress tau, written in B = F F^T - I."""
        B, dJ = _left(H), volume_change(H)[..., None, None]
        t = trace(B)[..., None, None]
        if self.form == "coupled":
            more = self._slope(t) - self.C10
            tau = 2 * (self.C10 + more + self.C01 * (1 + t)) * B - 2 * self.C01 * B @ B
            tau = tau + (2 * (more + self.C01 * t) + self.bulk * np.log1p(dJ)) * EYE
        else:
            L = np.log1p(dJ)
            j = np.exp(-2 / 3 * L)
            slope = self._slope(3 * np.expm1(-2 / 3 * L) + j * t)
            tau = (slope * j + self.C01 * j * j * (1 + t)) * B - self.C01 * j * j * B @ B
            tau = 2 * tau - 2 / 3 * trace(tau)[..., None, None] * EYE
            tau = tau + self.bulk / 2 * dJ * (dJ + 2) * EYE
        return np.asarray(tau @ cofactor(H + EYE) / (1 + dJ))

    def tangent(self, H: Floats) -> Floats:
        """Of W(I1, I2, L = ln J): W_1 d2I1 + W_2 d2I2 + W_L d2L, and the products of slopes."""
        F, dJ = H + EYE, volume_change(H)[..., None, None]
        C, G = np.swapaxes(F, -1, -2) @ F, cofactor(F) / (1 + dJ)
        I1 = trace(C)[..., None, None]
        I2 = (I1**2 - trace(C @ C)[..., None, None]) / 2
        (W1, W2, WL), (W11, W1L, W2L, WLL) = self._derivatives(I1, I2, dJ)
        d1, d2 = 2 * F, 2 * (I1 * F - F @ C)
        A = outer("iJ,jK->JijK", W11 * d1 + W1L * G + 2 * W2 * F, d1)
        A += outer("iJ,jK->JijK", W1L * d1 + W2L * d2 + WLL * G, G)
        A += outer("iJ,jK->JijK", W2L * G, d2)
        A += outer("ij,JK->JijK", EYE, 2 * (W1 + W2 * I1) * EYE - 2 * W2 * C)
        A -= outer("ij,JK->JijK", 2 * W2 * F @ np.swapaxes(F, -1, -2), EYE)
        A -= outer("iK,jJ->JijK", 2 * W2 * F, F) + outer("iK,jJ->JijK", WL * G, G)
        return A

    def _derivatives(
        self, I1: Floats, I2: Floats, dJ: Floats
    ) -> tuple[tuple[Floats, Floats, Floats], tuple[Floats, Floats, Floats, Floats]]:
        """W_1, W_2, W_L and W_11, W_1L, W_2L, W_LL; the others vanish."""
        L, zero = np.log1p(dJ), np.zeros_like(dJ)
        if self.form == "coupled":
            WL = self.bulk * L - 2 * (self.C10 + 2 * self.C01)
            first = (self._slope(I1 - 3), zero + self.C01, WL)
            return first, (self._curve(I1 - 3), zero, zero, zero + self.bulk)
        j = np.exp(-2 / 3 * L)
        x, y = j * I1, self.C01 * j * j
        slope, curve = self._slope(x - 3), self._curve(x - 3)
        WL = self.bulk / 2 * dJ * (dJ + 2) - 2 / 3 * slope * x - 4 / 3 * y * I2
        WLL = self.bulk * (1 + dJ) ** 2 + 4 / 9 * (slope + curve * x) * x + 16 / 9 * y * I2
        cross = -2 / 3 * j * (slope + curve * x), -4 / 3 * y
        return (slope * j, y, WL), (curve * j * j, *cross, WLL)

    def _f(self, x: Floats) -> Floats:
        return x * (self.C10 + x * (self.C20 + x * self.C30))

    def _slope(self, x: Floats) -> Floats:
        return self.C10 + x * (2 * self.C20 + 3 * self.C30 * x)

    def _curve(self, x: Floats) -> Floats:
        return 2 * self.C20 + 6 * self.C30 * x


def _left(H: Floats) -> Floats:
    """B (..., 3, 3) = F F^T - I."""
    Ht = np.swapaxes(H, -1, -2)
    return np.asarray(H + Ht + H @ Ht)
