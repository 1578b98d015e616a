"""Laws of the invariants: Mooney-Rivlin, Yeoh and coupled neo-Hooke.

f(I1) = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3, with I1, I2 those of C = F^T F.
"split": W = f(J^(-2/3) I1) + C01 (J^(-4/3) I2 - 3) + kappa/4 (J^2 - 1 - 2 ln J).
"coupled": W = f(I1) + C01 (I2 - 3) - 2 (C10 + 2 C01) ln J + bulk/2 ln^2 J.

Sources: Mooney (1940), Rivlin (1948), Yeoh (1993); Bonet & Wood (2008), ch. 6.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.laws.tensors import EYE, cofactor, outer, trace, volume_change
from validate.fem.laws.volumetric import ByVolume, split_energy
from validate.scene.laws import VolumetricName


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
