"""Constitutive laws at large strain: names, capabilities and further coefficients.

Every law has the Young's modulus and Poisson ratio of its material at small strain; what is left
over is given here as the field writes it. C10 of Mooney-Rivlin and Yeoh and mu_1 of Ogden follow:
2 (C10 + C01) = 2 C10 = mu, sum of mu_p alpha_p = 2 mu. `Material.ogden` and others make them of
published coefficients. The forms are in `fem`, written out in docs/explanation/laws.md.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import quantity
from validate.plugins import Registry, kind_fault

VolumetricName = Literal["split", "coupled"]
StabilityRule = Literal["required", "open"]


@dataclass(frozen=True)
class LawKind:
    """`coefficients`: fields of `Coefficients` that it knows; `volumetric`: its forms.

    `ranged`: it is checked, and used, between the stretches that the coefficients state. A law of a
    plug-in also has `at_point`, which makes its `fem.laws.Law` of (mu Pa, kappa Pa, coefficients);
    those of the package are made in `fem.laws.law`. `holds` is the class of its coefficients, a
    frozen dataclass below `Coefficients` (None: that class itself).
    """

    name: str
    title: str
    coefficients: tuple[str, ...] = ()
    volumetric: tuple[VolumetricName, ...] = ("split", "coupled")
    ranged: bool = True
    at_point: "Callable[[float, float, Coefficients], Any] | None" = None
    holds: "type[Coefficients] | None" = None


def _faults(part: object) -> str:
    """What keeps an object from being the law of a plug-in."""
    if not isinstance(part, LawKind):
        return kind_fault(part, LawKind)
    if part.at_point is None:
        return f"law '{part.name}' has no at_point, which makes the law at a point"
    known = {f.name for f in fields(part.holds or Coefficients)}
    odd = [name for name in part.coefficients if name not in known]
    return f"law '{part.name}': '{odd[0]}' is no field of its coefficients" if odd else ""


_OWN: tuple[LawKind, ...] = (
    LawKind("svk", "St. Venant-Kirchhoff", volumetric=(), ranged=False),
    LawKind("neo_hooke", "neo-Hooke", ranged=False),
    LawKind("mooney_rivlin", "Mooney-Rivlin", ("C01",)),
    LawKind("yeoh", "Yeoh", ("C20", "C30")),
    LawKind("ogden", "Ogden", ("ogden_mu", "ogden_alpha")),
)
LAWS: Registry[LawKind] = Registry("laws", _OWN, lambda kind: kind.name, _faults)


@dataclass(frozen=True)
class Coefficients:
    """What laws have beyond E and nu; zero, or one term, leaves neo-Hooke.

    `ogden_mu` are those of the terms after the first. `volumetric` "split" is an isochoric part of
    J^(-1/3) F and kappa/4 (J^2 - 1 - 2 ln J), "coupled" the whole of F, - mu ln J and ln^2 J.
    An "open" `stability` is for fits, which must be able to pass through unstable coefficients
    (`lost_stability` says which): a simulation requires it.
    """

    C01: float = quantity(0.0, "Pa", "Mooney-Rivlin: of I2 - 3")
    C20: float = quantity(0.0, "Pa", "Yeoh: of (I1 - 3)^2")
    C30: float = quantity(0.0, "Pa", "Yeoh: of (I1 - 3)^3")
    ogden_mu: tuple[float, ...] = quantity((), "Pa", "Ogden: moduli of the terms after the first")
    ogden_alpha: tuple[float, ...] = quantity((2.0,), "1", "Ogden: powers of all terms")
    volumetric: VolumetricName = quantity("split", "1", "volumetric form: split, or coupled (ln J)")
    stretches: tuple[float, ...] = quantity(
        (0.2, 5.0), "1", "principal stretches between which the law is checked and used"
    )
    stability: StabilityRule = quantity(
        "required", "1", "open: a law that loses positive energy there is accepted"
    )

    def __post_init__(self) -> None:
        numbers = np.array(
            [self.C01, self.C20, self.C30, *self.ogden_mu, *self.ogden_alpha, *self.stretches]
        )
        if not np.isfinite(numbers).all():
            odd = numbers[~np.isfinite(numbers)][0]
            raise SceneError(f"coefficients of a law: {odd} among them; give finite numbers")
        if len(self.ogden_alpha) != len(self.ogden_mu) + 1 or not all(self.ogden_alpha):
            raise SceneError(
                f"Ogden with {len(self.ogden_alpha)} powers {self.ogden_alpha} and "
                f"{len(self.ogden_mu)} moduli after the first: expected one power for each "
                "term, none of them 0"
            )
        if len(self.stretches) != 2 or not 0 < self.stretches[0] < 1 < self.stretches[1]:
            raise SceneError(
                f"stretches {self.stretches} of a law: expected two numbers, the first between "
                "0 and 1, the second above 1"
            )

    def known_to(self, law: str) -> "Coefficients":
        """Those that this law knows, the others as at default."""
        kind = law_kind(law)
        keep = (*kind.coefficients, *(("stretches", "stability") if kind.ranged else ()))
        known = {name: getattr(self, name) for name in keep if hasattr(self, name)}
        if self.volumetric in kind.volumetric:
            known["volumetric"] = self.volumetric
        return (kind.holds or Coefficients)(**known)

    def require_known(self, law: str) -> None:
        """Raise `SceneError` for a coefficient that the law would not use."""
        unknown = self._unknown_to(law)
        if not unknown:
            return
        name = unknown[0]
        users = [k.name for k in LAWS if not self._unknown_to(k.name)]
        instead = f"; take law {' or '.join(users)}" if users else ""
        raise SceneError(
            f"law '{law}' does not know {name} = {getattr(self, name)}: leave it out{instead}"
        )

    def _unknown_to(self, law: str) -> list[str]:
        """Names of the coefficients that this law would not use."""
        known = self.known_to(law)
        return [
            f.name for f in fields(self)
            if getattr(self, f.name) != getattr(known, f.name, f.default)
        ]  # fmt: skip

    def lost_stability(self, law: str, mu: float) -> "Lost | None":
        """Where stiffness is lost between the `stretches` for a law; None: nowhere. mu Pa."""
        low, high = (np.log(s) for s in self.stretches)
        logs = np.concatenate([np.linspace(0, end, _POINTS) for end in (low, high)])
        lost = []
        for mode, (first, second) in _MODES.items():
            strains = np.multiply.outer([first, second, -first - second], logs)
            inside = ((strains >= low - 1e-12) & (strains <= high + 1e-12)).all(axis=0)
            # Least eigenvalue Pa of the energy's second derivatives by the logarithms a, b (n,).
            a = first * logs
            b = second * logs
            if law == "ogden":
                terms = [
                    m / alpha * _power_sum(a, b, alpha)[2] for m, alpha in ogden_terms(self, mu)
                ]
                stiffness = np.asarray(np.linalg.eigvalsh(np.sum(terms, axis=0))[:, 0])
            else:
                (s1, g1, D1), (_, _, D2) = (_power_sum(a, b, alpha) for alpha in (2.0, -2.0))
                C10, x = mu / 2 - self.C01, (s1 - 3)[:, None, None]
                slope, curve = (
                    C10 + 2 * self.C20 * x + 3 * self.C30 * x**2,
                    2 * self.C20 + 6 * self.C30 * x,
                )
                H = slope * D1 + curve * g1[:, :, None] * g1[:, None, :] + self.C01 * D2
                stiffness = np.asarray(np.linalg.eigvalsh(H)[:, 0])
            bad = np.flatnonzero(inside & ~(stiffness > 0))
            if len(bad):
                worst = bad[np.argmin(np.abs(logs[bad]))]
                lost.append(Lost(float(np.exp(logs[worst])), mode, float(stiffness[worst])))
        return min(lost, key=lambda one: abs(np.log(one.stretch)), default=None)


def law_kind(law: str) -> LawKind:
    """Return the law of this name; the linear one knows nothing."""
    linear = LawKind("linear", "linear", (), (), ranged=False)
    return next((k for k in (linear, *LAWS.own) if k.name == law), None) or next(
        (k for k in LAWS.further if k.name == law), LawKind(law, law, (), (), ranged=False)
    )


def further_laws() -> tuple[str, ...]:
    """Return the names of the laws that are not the package's own."""
    return tuple(kind.name for kind in LAWS.further)


def ogden_terms(c: Coefficients, shear_modulus: float) -> tuple[tuple[float, float], ...]:
    """(mu_p Pa, alpha_p) of all terms; the first modulus makes sum mu_p alpha_p = 2 mu."""
    alpha, rest = c.ogden_alpha, c.ogden_mu
    taken = sum(m * a for m, a in zip(rest, alpha[1:], strict=True))
    first = (2 * shear_modulus - taken) / alpha[0]
    return tuple(zip((first, *rest), alpha, strict=True))


# --- Whether a law's coefficients keep its energy positive, over the stretches that it is meant
# for.
#
# The isochoric energy of an incompressible body, as a function of the logarithms of its
# stretches, must be convex (Hill 1970; Drucker's criterion of commercial codes) along uniaxial,
# equibiaxial and planar stretch. From the state of rest on, that makes the energy positive, the
# stress rise with the stretch and the larger stress go with the larger stretch (Baker & Ericksen
# 1954).

_POINTS = 801  # in the logarithm of the stretch, to either side
# Of the logarithm of the stretch: those of the first two directions.
_MODES = {"uniaxial": (1.0, -0.5), "equibiaxial": (1.0, 1.0), "planar": (1.0, 0.0)}


@dataclass(frozen=True)
class Lost:
    """Where a law loses positive energy: the stretch nearest to 1, in which mode, and the stiffness
    Pa there."""

    stretch: float
    mode: str
    stiffness: float


def require_stable(law: str, c: Coefficients, mu: float, kappa: float) -> None:
    """Raise `SceneError` at the stretch nearest to 1 where stiffness is lost, and say in which
    stretch; mu, kappa Pa."""
    lost = c.lost_stability(law, mu)
    if lost:
        raise SceneError(
            f"law '{law}' with {_words(law, c, mu)} loses positive energy at stretch "
            f"{lost.stretch:.4g} ({lost.mode}): stiffness {lost.stiffness:.3g} Pa there; use "
            "other coefficients, or give with `stretches` the range in which it is used"
        )
    if c.volumetric == "coupled":
        factor = coupled_lambda(c, mu, kappa)
        if factor < 0 and c.known_to("neo_hooke") != c:
            raise SceneError(
                f"law '{law}' with {_words(law, c, mu)} loses positive energy in volume: the "
                f"coupled form needs lambda - 4 C01 - 8 C20 >= 0, it is {factor:.4g} Pa; use "
                "volumetric 'split' or a Poisson ratio nearer to .5"
            )


def coupled_lambda(c: Coefficients, mu: float, kappa: float) -> float:
    """Factor Pa of ln^2 J/2 in the coupled form: Lame's lambda less what the shear terms bring."""
    return kappa - 2 * mu / 3 - 4 * c.C01 - 8 * c.C20


def _words(law: str, c: Coefficients, mu: float) -> str:
    if law == "ogden":
        return "mu, alpha = " + ", ".join(f"{m:.4g} Pa, {a:g}" for m, a in ogden_terms(c, mu))
    terms = {"C10": mu / 2 - c.C01, "C01": c.C01, "C20": c.C20, "C30": c.C30}
    return ", ".join(f"{k} = {v:.4g} Pa" for k, v in terms.items() if v or k == "C10")


def _power_sum(a: Floats, b: Floats, alpha: float) -> tuple[Floats, Floats, Floats]:
    """e^(alpha a) + e^(alpha b) + e^(-alpha (a + b)) (n,), its slopes (n, 2) and second derivatives
    (n, 2, 2)."""
    x, y, z = np.exp(alpha * a), np.exp(alpha * b), np.exp(-alpha * (a + b))
    second = np.stack([np.stack([x + z, z], -1), np.stack([z, y + z], -1)], -2)
    return x + y + z, alpha * np.stack([x - z, y - z], -1), alpha**2 * second
