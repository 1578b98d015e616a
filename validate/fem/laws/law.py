"""Hyperelastic laws at a point, as functions of the displacement gradient H = F - I.

Written in H, not F, so that small strains keep their digits. P = dW/dF is the first Piola-Kirchhoff
stress; the tangent A_iJjK = dP_iJ/dF_jK comes in the index order (J, i, j, K) that the element
kernel contracts. `kappa` 0 leaves the isochoric part of a split law, for nodal mean dilatation,
whose volumetric part is a function of one scalar measure of the cell's dilatation.

Sources: Bonet & Wood (2008), ch. 6; Simo & Miehe (1992) for the volumetric function. Laws of
invariants are in `fem.laws.energies`, of principal stretches in `fem.laws.energies`.
"""

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Protocol, cast

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.laws.energies import (
    EYE,
    ByVolume,
    Ogden,
    Polynomial,
    cofactor,
    green_strain,
    outer,
    split_energy,
    trace,
    volume_change,
)
from validate.scene.laws import LAWS, VolumetricName, coupled_lambda, law_kind, ogden_terms
from validate.scene.material import Material, Prony

# --- Neo-Hooke, split into isochoric and volumetric part: the shortest form of the commonest
# law.


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


# -------------------------------------------------------------------------------------------------


class Law(Protocol):
    """mu, kappa Pa; H (..., 3, 3). Beyond `least_stretch` and `most_stretch`
    the law has no sense."""

    @property
    def mu(self) -> float: ...

    @property
    def kappa(self) -> float: ...

    @property
    def least_stretch(self) -> float: ...

    @property
    def most_stretch(self) -> float: ...

    def energy(self, H: Floats) -> Floats:
        """W (...) J/m^3."""
        ...

    def stress(self, H: Floats) -> Floats:
        """P (..., 3, 3) Pa."""
        ...

    def tangent(self, H: Floats) -> Floats:
        """Return a (..., J, i, j, K) Pa."""
        ...

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        """Return the measure of volume strain s (...) and ds/dF (..., 3, 3)."""
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

    least_stretch: ClassVar[float] = float(1 / np.sqrt(3))
    most_stretch: ClassVar[float] = np.inf

    @property
    def _lame(self) -> float:
        return self.kappa - 2 * self.mu / 3

    def energy(self, H: Floats) -> Floats:
        E = green_strain(H)
        return np.asarray(self._lame / 2 * trace(E) ** 2 + self.mu * (E * E).sum(axis=(-2, -1)))

    def stress(self, H: Floats) -> Floats:
        return np.asarray((H + EYE) @ self._second(H))

    def tangent(self, H: Floats) -> Floats:
        """delta_ij S_JK + lambda F_iJ F_jK + mu (b_ij delta_JK + F_iK F_jJ)."""
        F = H + EYE
        left = self.mu * F @ np.swapaxes(F, -1, -2)
        A = outer("JK,ij->JijK", self._second(H), EYE) + outer("ij,JK->JijK", left, EYE)
        A += outer("iJ,jK->JijK", self._lame * F, F)
        A += outer("iK,jJ->JijK", self.mu * F, F)
        return A

    def dilatation(self, H: Floats) -> tuple[Floats, Floats]:
        """s = tr E."""
        return trace(green_strain(H)), H + EYE

    def curvature(self, H: Floats) -> Floats:
        return np.broadcast_to(outer("ij,JK->JijK", EYE, EYE), (*H.shape[:-2], 3, 3, 3, 3))

    def volumetric(self, s: Floats, kappa: float) -> tuple[Floats, Floats, Floats]:
        return kappa / 2 * s**2, kappa * s, np.full_like(s, kappa)

    def _second(self, H: Floats) -> Floats:
        E = green_strain(H)
        return np.asarray(self._lame * trace(E)[..., None, None] * EYE + 2 * self.mu * E)


def law_of(material: Material, *, isochoric: bool = False) -> Law:
    """Return the material's law, or its isochoric part.

    Raises `SceneError` for one that is linear only, and for the isochoric part of a coupled one.
    """
    law, c = material.law, material.coefficients
    kind = law_kind(law)
    if kind.at_point is None and kind not in LAWS.own:
        names = [each.name for each in LAWS]
        raise SceneError(f"law '{law}' has no large-strain form; choose one of {sorted(names)}")
    if isochoric and c.volumetric == "coupled":
        raise SceneError(
            f"law '{law}' in its coupled form has no isochoric part; use volumetric 'split', "
            "or dilatation 'pointwise' with elements of order 2"
        )
    mu, kappa = material.shear_modulus, 0.0 if isochoric else material.bulk_modulus
    if kind.at_point is not None:
        return cast(Law, kind.at_point(mu, kappa, c.known_to(law)))
    if law == "svk":
        return SaintVenantKirchhoff(mu, kappa)
    if law == "ogden":
        return Ogden(ogden_terms(c, mu), kappa, c.volumetric, *c.stretches)
    if law == "neo_hooke" and c.volumetric == "split":
        return NeoHooke(mu, kappa)
    bulk = coupled_lambda(c, mu, kappa) if c.volumetric == "coupled" else kappa
    ends = c.stretches if kind.ranged else (0.0, np.inf)
    return Polynomial(mu / 2 - c.C01, c.C01, c.C20, c.C30, kappa, bulk, c.volumetric, *ends)


def parts_of(material: Material, *, averaged: bool) -> tuple[Law, float]:
    """Return the law without its volumetric part, and kappa Pa of that, or the factor of ln^2 J/2.

    Raises `SceneError` as `law_of` does where the volume change is `averaged`: what is left of a
    coupled law is not isochoric.
    """
    law, kappa = law_of(material), material.assembled_bulk_modulus
    if averaged or material.coefficients.volumetric == "split":
        return law_of(instant(material), isochoric=True), kappa
    bulk = coupled_lambda(material.coefficients, law.mu, kappa)
    if isinstance(law, Ogden):
        return replace(law, kappa=2 * law.mu / 3), bulk
    assert isinstance(law, Polynomial)
    return replace(law, bulk=0.0), bulk


def instant(material: Material) -> Material:
    """Return the material whose isochoric part is that of statics: the relaxed one, or with all
    branches of its Prony series taut."""
    if material.prony.statics == "relaxed":
        return material
    return stiffened(material, material.prony.instant)


def stiffened(material: Material, factor: float) -> Material:
    """Another shear modulus and coefficients by a factor, at the same bulk modulus."""
    c, mu, kappa = material.coefficients, factor * material.shear_modulus, material.bulk_modulus
    if material.incompressible:
        scaled_modulus, nu = 3 * mu, 0.5
    else:
        scaled_modulus = 9 * kappa * mu / (3 * kappa + mu)
        nu = (3 * kappa - 2 * mu) / (2 * (3 * kappa + mu))
    moduli = [f.name for f in fields(c) if f.metadata["unit"] == "Pa"]
    values: dict[str, Any] = {name: getattr(c, name) for name in moduli}
    for name, value in values.items():
        terms = isinstance(value, tuple)
        values[name] = tuple(factor * v for v in value) if terms else factor * value
    scaled = replace(c, **values)
    return replace(material, E=scaled_modulus, nu=nu, coefficients=scaled, prony=Prony())
