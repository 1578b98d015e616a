"""Hyperelastic laws at a point, as functions of the displacement gradient H = F - I.

Written in H, not F, so that small strains keep their digits. P = dW/dF is the first Piola-Kirchhoff
stress; the tangent A_iJjK = dP_iJ/dF_jK comes in the index order (J, i, j, K) that the element
kernel contracts. `kappa` 0 leaves the isochoric part, for nodal mean dilatation, whose volumetric
part is a function of one scalar measure of the cell's dilatation.

Sources: Bonet & Wood (2008), ch. 6; Simo & Miehe (1992) for the volumetric function.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.scene import Material

_I = np.eye(3)
_CYCLES = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


class Law(Protocol):
    """mu, kappa Pa; H (..., 3, 3). `least_stretch`: below it the law has no sense."""

    @property
    def mu(self) -> float: ...

    @property
    def kappa(self) -> float: ...

    @property
    def least_stretch(self) -> float: ...

    def energy(self, H: Floats) -> Floats:
        """W (...) J/m^3."""
        ...

    def stress(self, H: Floats) -> Floats:
        """P (..., 3, 3) Pa."""
        ...

    def tangent(self, H: Floats) -> Floats:
        """A (..., J, i, j, K) Pa."""
        ...

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        """The measure of volume strain s (...) and ds/dF (..., 3, 3)."""
        ...

    def curvature(self, H: Floats) -> Floats:
        """d2s/dF2 (..., J, i, j, K)."""
        ...

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        """Energy, slope and curvature (...) Pa of the volumetric part at the measure s."""
        ...


@dataclass(frozen=True)
class SaintVenantKirchhoff:
    """S = lambda tr(E) I + 2 mu E, E the Green-Lagrange strain (paper 003, eqs 1-4).

    In uniaxial compression the force peaks at stretch 1/sqrt(3): beyond it the law has no sense.
    """

    mu: float
    kappa: float

    @property
    def least_stretch(self) -> float:
        return float(1 / np.sqrt(3))

    @property
    def _lame(self) -> float:
        return self.kappa - 2 * self.mu / 3

    def energy(self, H: Floats) -> Floats:
        E = green_strain(H)
        return np.asarray(self._lame / 2 * _trace(E) ** 2 + self.mu * (E * E).sum(axis=(-2, -1)))

    def stress(self, H: Floats) -> Floats:
        return np.asarray((H + _I) @ self._second(H))

    def tangent(self, H: Floats) -> Floats:
        """delta_ij S_JK + lambda F_iJ F_jK + mu (b_ij delta_JK + F_iK F_jJ)."""
        F = H + _I
        left = self.mu * F @ np.swapaxes(F, -1, -2)
        A = _outer("JK,ij->JijK", self._second(H), _I) + _outer("ij,JK->JijK", left, _I)
        A += _outer("iJ,jK->JijK", self._lame * F, F)
        A += _outer("iK,jJ->JijK", self.mu * F, F)
        return A

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        """s = tr E."""
        return _trace(green_strain(H)), H + _I

    def curvature(self, H: Floats) -> Floats:
        return np.broadcast_to(_outer("ij,JK->JijK", _I, _I), (*H.shape[:-2], 3, 3, 3, 3))

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        return kappa / 2 * s**2, kappa * s, np.full_like(s, kappa)

    def _second(self, H: Floats) -> Floats:
        E = green_strain(H)
        return np.asarray(self._lame * _trace(E)[..., None, None] * _I + 2 * self.mu * E)


@dataclass(frozen=True)
class NeoHooke:
    """W = mu/2 (J^(-2/3) tr C - 3) + kappa/4 (J^2 - 1 - 2 ln J).

    The volumetric part is convex in J and infinite at J = 0 and J = infinity.
    """

    mu: float
    kappa: float

    @property
    def least_stretch(self) -> float:
        return 0.0

    def energy(self, H: Floats) -> Floats:
        dJ = volume_change(H)
        stretch = 3 + 2 * _trace(green_strain(H))
        isochoric = self.mu / 2 * ((1 + dJ) ** (-2 / 3) * stretch - 3)
        return np.asarray(isochoric + self.volumetric(dJ, self.kappa)[0])

    def stress(self, H: Floats) -> Floats:
        """mu J^(-2/3) (F - tr C/3 G) + kappa/2 (J^2 - 1) G, G = F^-T."""
        m, third, G, dJ = self._parts(H)
        return np.asarray(m * (H + _I - third * G) + self.kappa / 2 * dJ * (dJ + 2) * G)

    def tangent(self, H: Floats) -> Floats:
        m, third, G, dJ = self._parts(H)
        p = self.kappa / 2 * dJ * (dJ + 2)
        toward = -2 / 3 * m * (H + _I - third * G) + self.kappa * (1 + dJ) ** 2 * G
        A = _outer("iJ,jK->JijK", toward, G)
        A -= _outer("iJ,jK->JijK", 2 / 3 * m * G, H + _I)
        A += _outer("iK,jJ->JijK", (m * third - p) * G, G)
        A += m[..., None, None] * _outer("ij,JK->JijK", _I, _I)
        return A

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        """s = J - 1."""
        return volume_change(H), cofactor(H + _I)

    def curvature(self, H: Floats) -> Floats:
        _, _, G, dJ = self._parts(H)
        return np.asarray(
            _outer("iJ,jK->JijK", (1 + dJ) * G, G) - _outer("iK,jJ->JijK", (1 + dJ) * G, G)
        )

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        J = 1 + s
        energy = kappa / 4 * (s * (s + 2) - 2 * np.log1p(s))
        return energy, kappa / 2 * s * (s + 2) / J, kappa / 2 * (1 + 1 / J**2)

    def _parts(self, H: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """mu J^(-2/3), tr C / 3, F^-T and J - 1, each shaped to multiply (..., 3, 3)."""
        dJ = volume_change(H)[..., None, None]
        third = (1 + 2 / 3 * _trace(green_strain(H)))[..., None, None]
        return self.mu * (1 + dJ) ** (-2 / 3), third, cofactor(H + _I) / (1 + dJ), dJ


LAWS: dict[str, type[SaintVenantKirchhoff] | type[NeoHooke]] = {
    "svk": SaintVenantKirchhoff,
    "neo_hooke": NeoHooke,
}


def law_of(material: Material, *, isochoric: bool = False) -> Law:
    """The material's law, or its isochoric part; `SceneError` for one that is linear only."""
    if material.law not in LAWS:
        raise SceneError(
            f"law '{material.law}' has no form at large strain; choose one of {sorted(LAWS)}"
        )
    return LAWS[material.law](material.shear_modulus, 0.0 if isochoric else material.bulk_modulus)


def green_strain(H: Floats) -> Floats:
    """E (..., 3, 3) = (H + H^T + H^T H) / 2."""
    Ht = np.swapaxes(H, -1, -2)
    return np.asarray((H + Ht + Ht @ H) / 2)


def volume_change(H: Floats) -> Floats:
    """J - 1 (...), without the cancellation of det(I + H) - 1."""
    C = cofactor(H)
    return np.asarray(_trace(H) + _trace(C) + (H[..., 0, :] * C[..., 0, :]).sum(axis=-1))


def cofactor(F: Floats) -> Floats:
    """det(F) F^-T (..., 3, 3), also where F is singular."""
    C = np.empty_like(F)
    for i, j, k in _CYCLES:
        for r, s, t in _CYCLES:
            C[..., i, r] = F[..., j, s] * F[..., k, t] - F[..., j, t] * F[..., k, s]
    return C


def _trace(E: Floats) -> Floats:
    return np.asarray(np.einsum("...ii->...", E))


def _outer(indices: str, a: Floats, b: Floats) -> Floats:
    """The product of two tensors per point, e.g. "iJ,jK->JijK"."""
    inputs, out = indices.split("->")
    left, right = inputs.split(",")
    return np.asarray(np.einsum(f"...{left},...{right}->...{out}", a, b))
