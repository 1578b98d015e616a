"""Material: isotropic elasticity, damping, density, and the law at large strain."""

from dataclasses import MISSING, dataclass, field, replace
from typing import Any, Literal, Self

import numpy as np

from validate.arrays import Ints
from validate.errors import SceneError
from validate.parameters import part, quantity, take_units
from validate.scene.laws import Coefficients, VolumetricName, further_laws, law_kind, require_stable

# --- Viscoelasticity as a Prony series: how the isochoric stress of a law relaxes.


@dataclass(frozen=True)
class Prony:
    """G(t) = G (1 + sum g_i exp(-t/tau_i)): the material's E and law are the relaxed ones.

    Codes whose series is of the instantaneous modulus, G_0 (1 - sum h_i (1 - exp(-t/tau_i))), print
    h_i = g_i/(1 + sum g), and E_0 = (1 + sum g) E of an incompressible body. `statics` says which
    limit schemes without time stand for; those with time walk through both.
    """

    g: tuple[float, ...] = quantity((), "1", "moduli of the branches over the relaxed one")
    tau: tuple[float, ...] = quantity((), "s", "relaxation times of the branches")
    statics: Literal["relaxed", "instantaneous"] = quantity(
        "relaxed", "1", "limit that statics use: long-term or instantaneous"
    )

    def __post_init__(self) -> None:
        numbers = np.array([*self.g, *self.tau])
        if len(self.g) != len(self.tau):
            raise SceneError(
                f"Prony series of {len(self.g)} moduli and {len(self.tau)} times: expected one "
                "of each for every branch"
            )
        if not (np.isfinite(numbers).all() and (numbers > 0).all()):
            raise SceneError(
                f"Prony series g = {self.g}, tau = {self.tau} s: expected positive numbers, "
                "otherwise a branch creates energy"
            )

    @property
    def instant(self) -> float:
        """Instantaneous over relaxed modulus."""
        return 1 + sum(self.g)


# -------------------------------------------------------------------------------------------------

#: Bulk modulus over shear modulus of the penalty beside unknown pressures at nu = 0.5.
_PENALTY = 1000.0

LawName = Literal["linear", "svk", "neo_hooke", "mooney_rivlin", "yeoh", "ogden"]


@dataclass(frozen=True)
class Material:
    """Isotropic elasticity: E Pa, nu -, and the law at large strain (`scene.laws`, `fem.laws.law`).

    A declaration may leave E and nu open (None). Every law has these at small strain, which is all
    that the linear schemes use; `coefficients` are what the law has beyond them; with a `prony`
    series it is the relaxed law, whose isochoric stress comes late. At nu = 0.5 mixed cells and
    static schemes keep the volume exactly (`fem.assembly.volume_constraints`), others refuse it.
    Dynamic schemes need rho kg/m^3; Rayleigh damping is C = mass_damping M + stiffness_damping K,
    in 1/s and s (the alpha_0 and alpha_1 of paper 001, eq 7). Raises `SceneError` for values out of
    range, coefficients that the law does not know, and those that lose positive energy, with the
    stretch.
    """

    E: float = quantity(MISSING, "Pa", "Young's modulus at small strain", opened=True)
    nu: float = quantity(
        MISSING, "1", "Poisson ratio at small strain; 0.5 needs mixed cells", opened=True
    )
    law: LawName = quantity("linear", "1", "linear, or the law at large strain", more=further_laws)
    rho: float | None = quantity(None, "kg/m^3", "density")
    mass_damping: float = quantity(0.0, "1/s", "Rayleigh's alpha")
    stiffness_damping: float = quantity(0.0, "s", "Rayleigh's beta")
    coefficients: Coefficients = part(
        Coefficients(), "coefficients of the law in addition to E and nu"
    )
    prony: Prony = quantity(Prony(), "1", "relaxation of the isochoric stress")

    def __post_init__(self) -> None:
        take_units(self)
        if self.E is not None and not (np.isfinite(self.E) and self.E > 0):
            raise SceneError(f"modulus E = {self.E:g} Pa: expected a positive number")
        if self.nu is not None and not -1 < self.nu <= 0.5:
            raise SceneError(
                f"Poisson ratio nu = {self.nu:g}: expected -1 < nu <= 0.5; use at most 0.4999, "
                "or 0.5 with mixed cells"
            )
        if self.rho is not None and not (np.isfinite(self.rho) and self.rho > 0):
            raise SceneError(f"density rho = {self.rho:g} kg/m3: expected a positive number")
        for name, value in (("mass", self.mass_damping), ("stiffness", self.stiffness_damping)):
            if not (np.isfinite(value) and value >= 0):
                raise SceneError(f"{name} damping {value:g}: expected a number >= 0")
        self.coefficients.require_known(self.law)
        if self.prony != Prony() and not self._relaxes(self.law):
            form = self.coefficients.volumetric
            raise SceneError(
                f"law '{self.law}' ({form}) has no isochoric part that can relax: remove the "
                "Prony series, or use neo_hooke, mooney_rivlin, yeoh or ogden with volumetric "
                "'split'"
            )
        if self.coefficients.stability == "required" and None not in (self.E, self.nu):
            self.require_stable()

    def require_stable(self) -> None:
        """Raise `SceneError` for coefficients that lose positive energy, with the stretch."""
        if law_kind(self.law).ranged:
            require_stable(self.law, self.coefficients, self.shear_modulus, self.bulk_modulus)

    def of_law(self, law: LawName) -> "Material":
        """The same at small strain, with another law and what it knows of the coefficients."""
        prony = self.prony if self._relaxes(law) else Prony()
        return replace(self, law=law, coefficients=self.coefficients.known_to(law), prony=prony)

    def _relaxes(self, law: str) -> bool:
        """An isochoric part of its own is what a Prony series acts on."""
        split = self.coefficients.known_to(law).volumetric == "split"
        return split and "split" in law_kind(law).volumetric

    @property
    def shear_modulus(self) -> float:
        """mu Pa."""
        return self.E / (2 * (1 + self.nu))

    @property
    def bulk_modulus(self) -> float:
        """kappa Pa, infinite at nu = 0.5."""
        return np.inf if self.incompressible else self.E / (3 * (1 - 2 * self.nu))

    @property
    def incompressible(self) -> bool:
        """Whether the volume is kept exactly."""
        return self.nu == 0.5

    @property
    def assembled_bulk_modulus(self) -> float:
        """kappa Pa; at nu = 0.5 the finite penalty that is assembled beside unknown pressures."""
        return _PENALTY * self.shear_modulus if self.incompressible else self.bulk_modulus

    # --- published rubber: coefficients of papers and handbooks; incompressible sources are met by
    # nu up to .4999.

    @classmethod
    def mooney_rivlin(
        cls, C10: float, C01: float, nu: float, volumetric: VolumetricName = "split", **more: Any
    ) -> Self:
        """Make it of C10, C01 Pa of I1 - 3, I2 - 3 (Mooney 1940; Rivlin 1948): mu = 2 (C10 + C01).

        `more`: other fields of a material, and `stretches` of its coefficients, here and below.
        """
        return cls._rubber(
            "mooney_rivlin", 2 * (C10 + C01), nu, Coefficients(C01=C01), volumetric, more
        )

    @classmethod
    def yeoh(
        cls,
        C10: float,
        C20: float,
        C30: float,
        nu: float,
        volumetric: VolumetricName = "split",
        **more: Any,
    ) -> Self:
        """Make it of C10, C20, C30 Pa of the powers of I1 - 3 (Yeoh 1993): mu = 2 C10."""
        return cls._rubber("yeoh", 2 * C10, nu, Coefficients(C20=C20, C30=C30), volumetric, more)

    @classmethod
    def ogden(
        cls,
        mu: tuple[float, ...],
        alpha: tuple[float, ...],
        nu: float,
        volumetric: VolumetricName = "split",
        **more: Any,
    ) -> Self:
        """Make it of terms mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3), mu_p Pa (Ogden
        1972): the shear modulus is sum mu_p alpha_p / 2. Codes that write 2 mu_p/alpha_p^2 print
        mu_p alpha_p / 2.

        Raises `SceneError` for another number of moduli than of powers.
        """
        if len(mu) != len(alpha) or not mu:
            raise SceneError(f"Ogden: {len(mu)} moduli for {len(alpha)} powers; give one for each")
        shear = sum(m * a for m, a in zip(mu, alpha, strict=True)) / 2
        more_terms = Coefficients(ogden_mu=tuple(mu[1:]), ogden_alpha=tuple(alpha))
        return cls._rubber("ogden", shear, nu, more_terms, volumetric, more)

    @classmethod
    def _rubber(
        cls, law: LawName, shear: float, nu: float, known: Coefficients, form: VolumetricName,
        more: dict[str, Any],
    ) -> Self:  # fmt: skip
        stretches = more.pop("stretches", known.stretches)
        coefficients = replace(known, volumetric=form, stretches=stretches)
        return cls(2 * shear * (1 + nu), nu, law, coefficients=coefficients, **more)


@dataclass(frozen=True, eq=False)
class Region:
    """Cells (k,) of another material than the scene's: both linear, or both at large strain.

    Declared it is `where` in words, the cells whose middle lies there, of the body's own material
    but for its modulus, which is `contrast` times the body's; a resolved one has both.
    """

    name: str
    cells: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    material: Material = None  # type: ignore[assignment]
    where: str = quantity("", "1", "box A to B: cells whose middle lies in it")
    contrast: float = quantity(1.0, "1", "its modulus over the body's, where declared")

    def _key(self) -> tuple[object, ...]:
        return self.name, self.cells.tobytes(), self.material, self.where, self.contrast

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Region) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())
