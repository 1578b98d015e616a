"""Neo-Hooke, split into isochoric and volumetric part: the shortest form of the commonest law."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.fem.tensors import EYE, cofactor, green_strain, outer, trace, volume_change
from validate.fem.volumetric import ByVolume, split_energy
from validate.scene.laws import VolumetricName


@dataclass(frozen=True)
class NeoHooke(ByVolume):
    """W = mu/2 (J^(-2/3) tr C - 3) + kappa/4 (J^2 - 1 - 2 ln J).

    The volumetric part is convex in J and infinite at J = 0 and J = infinity.
    """

    mu: float
    kappa: float

    form: VolumetricName = "split"
    least_stretch: ClassVar[float] = 0.0
    most_stretch: ClassVar[float] = np.inf

    def energy(self, H: Floats) -> Floats:
        dJ = volume_change(H)
        stretch = 3 + 2 * trace(green_strain(H))
        isochoric = self.mu / 2 * ((1 + dJ) ** (-2 / 3) * stretch - 3)
        return np.asarray(isochoric + split_energy(dJ, self.kappa))

    def stress(self, H: Floats) -> Floats:
        """mu J^(-2/3) (F - tr C/3 G) + kappa/2 (J^2 - 1) G, G = F^-T."""
        m, third, G, dJ = self._parts(H)
        return np.asarray(m * (H + EYE - third * G) + self.kappa / 2 * dJ * (dJ + 2) * G)

    def tangent(self, H: Floats) -> Floats:
        m, third, G, dJ = self._parts(H)
        p = self.kappa / 2 * dJ * (dJ + 2)
        toward = -2 / 3 * m * (H + EYE - third * G) + self.kappa * (1 + dJ) ** 2 * G
        A = outer("iJ,jK->JijK", toward, G)
        A -= outer("iJ,jK->JijK", 2 / 3 * m * G, H + EYE)
        A += outer("iK,jJ->JijK", (m * third - p) * G, G)
        A += m[..., None, None] * outer("ij,JK->JijK", EYE, EYE)
        return A

    def _parts(self, H: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """mu J^(-2/3), tr C / 3, F^-T and J - 1, each shaped to multiply (..., 3, 3)."""
        dJ = volume_change(H)[..., None, None]
        third = (1 + 2 / 3 * trace(green_strain(H)))[..., None, None]
        return self.mu * (1 + dJ) ** (-2 / 3), third, cofactor(H + EYE) / (1 + dJ), dJ
