"""Ogden's law in the principal stretches l_a of F: sums over terms (mu_p, alpha_p).

"split": W = sum mu_p/alpha_p (m_1^alpha_p + m_2^alpha_p + m_3^alpha_p - 3) of m_a = J^(-1/3) l_a,
and kappa/4 (J^2 - 1 - 2 ln J); "coupled": the same of l_a, - sum mu_p ln J + lambda/2 ln^2 J.

Stretches come from the eigenvalues of 2 E, whose digits small strains keep. In the tangent the
quotient (S_b - S_a)/(l_b^2 - l_a^2) is written with expm1 of the logarithm of l_b^2/l_a^2, so that
equal stretches are no special case but the one point where both are zero. Sources: Ogden (1972);
Simo & Taylor (1991); Holzapfel (2000), 6.5-6.6.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.laws.tensors import EYE, green_strain, outer
from validate.fem.laws.volumetric import ByVolume, split_energy
from validate.scene.laws import VolumetricName

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
