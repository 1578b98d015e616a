"""Hyperelastic laws in plane stress: thickness stretch of zero normal stress.

At every point P_33(H_33) = 0 is solved by secants in the logarithm of that stretch, and the tangent
is condensed: A_iJjK - A_iJ33 A_33jK / A_3333. No pressure is left in the sheet, so that nothing
locks as nu nears .5.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.laws.law import Law
from validate.fem.laws.tensors import volume_change

_ITERATIONS = 50
_SETTLED = 1e-13  # of kappa + mu: the stress across that is rounding
_STEP = 0.5  # the longest step in the logarithm of the stretch


@dataclass(frozen=True)
class PlaneStress:
    """`law` and its volumetric part of `bulk` Pa as one; H (..., 3, 3) has no component across but
    H_33, which `completed` finds. Nothing is left to a volumetric law of its own."""

    law: Law
    bulk: float

    @property
    def mu(self) -> float:
        return self.law.mu

    @property
    def kappa(self) -> float:
        return self.bulk

    @property
    def least_stretch(self) -> float:
        return self.law.least_stretch

    @property
    def most_stretch(self) -> float:
        return self.law.most_stretch

    def completed(self, H: Floats) -> Floats:
        """H with the H_33 that leaves no stress across; -1 (no thickness) where there is none."""
        flat = volume_change(H)
        sound = flat > -1
        out = np.where(sound[..., None, None], H, 0.0)
        nu = (3 * self.bulk - 2 * self.mu) / (2 * (3 * self.bulk + self.mu))
        log = -nu / (1 - nu) * np.log1p(np.where(sound, flat, 0.0))
        slope = np.full_like(log, self.bulk + 4 * self.mu / 3)  # at rest, then by secants
        before, step = np.zeros_like(log), np.zeros_like(log)
        for _ in range(_ITERATIONS):
            out[..., 2, 2] = np.expm1(log)
            P = self.stress(out)[..., 2, 2]
            left = np.abs(P) > _SETTLED * (self.bulk + self.mu)
            if not left.any():
                break
            moved = left & (step != 0) & (before != P)
            slope = np.where(moved, (P - before) / np.where(moved, step, 1.0), slope)
            step = np.where(left, np.clip(-P / slope, -_STEP, _STEP), 0.0)
            before, log = P, log + step
        out[..., :2, :2] = H[..., :2, :2]
        out[..., 2, 2] = np.where(sound & ~left, out[..., 2, 2], -1.0)
        return out

    def energy(self, H: Floats) -> Floats:
        s, _ = self.law.dilatation(H)
        return np.asarray(self.law.energy(H) + self.law.volumetric(s, self.bulk)[0])

    def stress(self, H: Floats) -> Floats:
        s, slope = self.law.dilatation(H)
        p = self.law.volumetric(s, self.bulk)[1]
        return np.asarray(self.law.stress(H) + p[..., None, None] * slope)

    def tangent(self, H: Floats) -> Floats:
        A = self._whole(H)
        across = A[..., 2, 2, 2, 2][..., None, None, None, None]
        toward, away = A[..., :, :, 2, 2], A[..., 2, 2, :, :]
        return np.asarray(A - np.einsum("...Ji,...jK->...JijK", toward, away) / across)

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        return np.zeros(H.shape[:-2]), np.zeros(H.shape)

    def curvature(self, H: Floats) -> Floats:
        return np.broadcast_to(0.0, (*H.shape, 3, 3))

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        return s, s, s

    def _whole(self, H: Floats) -> Floats:
        """The tangent (..., J, i, j, K) Pa in three dimensions."""
        s, slope = self.law.dilatation(H)
        _, p, stiff = self.law.volumetric(s, self.bulk)
        A = self.law.tangent(H) + p[..., None, None, None, None] * self.law.curvature(H)
        return np.asarray(A + np.einsum("...,...iJ,...jK->...JijK", stiff, slope, slope))
