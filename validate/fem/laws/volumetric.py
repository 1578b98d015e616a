"""Volumetric parts of laws, as functions of J - 1 and of ln J.

"split": kappa/4 (J^2 - 1 - 2 ln J), convex in J and infinite at J = 0 and J = infinity (Simo &
Miehe 1992). "coupled": bulk/2 ln^2 J beside the shear terms' own - c ln J (Bonet & Wood 2008, 6.4).
"""

import numpy as np

from validate.arrays import Floats
from validate.fem.laws.tensors import EYE, cofactor, outer, volume_change
from validate.scene.laws import VolumetricName


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
