"""Gent's law of rubber with limited extensibility (Gent 1996), split into isochoric and volumetric.

W = -mu J_m/2 ln(1 - (I1bar - 3)/J_m) + kappa/4 (J^2 - 1 - 2 ln J). For J_m to infinity it is
neo-Hooke, of which it is a function here: with w = (I1bar - 3)/2, W = mu g(w).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.laws.energies import ByVolume, outer
from validate.fem.laws.law import NeoHooke
from validate.parameters import quantity
from validate.scene.laws import Coefficients, LawKind

_UNIT = NeoHooke(1.0, 0.0)  # W = (I1bar - 3)/2


@dataclass(frozen=True)
class GentCoefficients(Coefficients):
    """What Gent's law has beyond E and nu."""

    J_m: float = quantity(100.0, "1", "Gent: limit of I1bar - 3")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.J_m > 0:
            raise SceneError(f"J_m = {self.J_m:g} of Gent's law: expected a number above 0")


@dataclass(frozen=True)
class Gent(ByVolume):
    """The law at a point; mu, kappa Pa; H (..., 3, 3) = F - I."""

    mu: float
    kappa: float
    J_m: float

    form: ClassVar = "split"
    least_stretch: ClassVar[float] = 0.0
    most_stretch: ClassVar[float] = np.inf

    def energy(self, H: Floats) -> Floats:
        isochoric = -self.mu * self.J_m / 2 * np.log1p(-2 * _UNIT.energy(H) / self.J_m)
        return np.asarray(isochoric + NeoHooke(0.0, self.kappa).energy(H))

    def stress(self, H: Floats) -> Floats:
        slope, _ = self._slopes(H)
        return np.asarray(
            slope[..., None, None] * _UNIT.stress(H) + NeoHooke(0.0, self.kappa).stress(H)
        )

    def tangent(self, H: Floats) -> Floats:
        slope, curve = (s[..., None, None, None, None] for s in self._slopes(H))
        P = _UNIT.stress(H)
        A = slope * _UNIT.tangent(H) + curve * outer("iJ,jK->JijK", P, P)
        return np.asarray(A + NeoHooke(0.0, self.kappa).tangent(H))

    def _slopes(self, H: Floats) -> tuple[Floats, Floats]:
        """mu g' and mu g'' of w."""
        left = 1 - 2 * _UNIT.energy(H) / self.J_m
        return self.mu / left, 2 * self.mu / (self.J_m * left**2)


def gent(mu: float, kappa: float, coefficients: GentCoefficients) -> Gent:
    """The law of a material."""
    return Gent(mu, kappa, coefficients.J_m)


GENT = LawKind(
    "gent", "Gent", ("J_m",), volumetric=("split",), ranged=False, at_point=gent,
    holds=GentCoefficients,
)  # fmt: skip
