"""The laws that are identified: their coefficients as parameters, and the material they make."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

from validate.parameters import known, quantity
from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material

LawCard = Literal["svk", "neo_hooke", "mooney_rivlin", "yeoh", "ogden", "ogden_two"]
# A fit may pass through unstable coefficients, at any stretch that was measured.
_STRETCHES = (1e-3, 1e3)


@dataclass(frozen=True)
class ShearModulus:
    mu: float | None = quantity(None, "Pa", "shear modulus; none: identified")


@dataclass(frozen=True)
class MooneyRivlin:
    C10: float | None = quantity(None, "Pa", "of I1 - 3; none: identified")
    C01: float | None = quantity(None, "Pa", "of I2 - 3; none: identified")


@dataclass(frozen=True)
class Yeoh:
    C10: float | None = quantity(None, "Pa", "of I1 - 3; none: identified")
    C20: float | None = quantity(None, "Pa", "of (I1 - 3)^2; none: identified")
    C30: float | None = quantity(None, "Pa", "of (I1 - 3)^3; none: identified")


@dataclass(frozen=True)
class OgdenTerm:
    """G = mu_1 alpha_1/2 is the shear modulus; any G above 0 is stable."""

    G: float | None = quantity(None, "Pa", "shear modulus; none: identified")
    alpha: float | None = quantity(None, "1", "power of the stretches; none: identified")


@dataclass(frozen=True)
class OgdenTerms:
    """Of two terms, one of a power above and one of a power below zero, as rubbers need."""

    G_1: float | None = quantity(None, "Pa", "shear modulus of the first; none: identified")
    alpha_1: float | None = quantity(None, "1", "its power, above 0; none: identified")
    G_2: float | None = quantity(None, "Pa", "shear modulus of the second; none: identified")
    alpha_2: float | None = quantity(None, "1", "its power, below 0; none: identified")


def as_card(name: str) -> LawCard:
    """The law that a method of this name has; raises `StopIteration` for none."""
    found: LawCard = next(law for law in get_args(LawCard) if law == name)
    return found


def material(law: LawCard, card: Any, nu: float) -> Material:
    """The material of a law's parameters; raises `UsageError` while one of them stands open."""
    v = {name: known(value, f"{law}.{name}") for name, value in vars(card).items()}
    if law == "svk":
        return Material(2 * v["mu"] * (1 + nu), nu, "svk")
    if law == "neo_hooke":
        return Material(2 * v["mu"] * (1 + nu), nu, "neo_hooke")
    if law == "mooney_rivlin":
        return _open(law, 2 * (v["C10"] + v["C01"]), nu, C01=v["C01"])
    if law == "yeoh":
        return _open(law, 2 * v["C10"], nu, C20=v["C20"], C30=v["C30"])
    if law == "ogden":
        return _open("ogden", v["G"], nu, ogden_alpha=(v["alpha"],))
    second = 2 * v["G_2"] / v["alpha_2"]
    alphas = (v["alpha_1"], v["alpha_2"])
    return _open("ogden", v["G_1"] + v["G_2"], nu, ogden_mu=(second,), ogden_alpha=alphas)


def _open(law: LawName, shear: float, nu: float, **more: Any) -> Material:
    c = Coefficients(**more, stretches=_STRETCHES, stability="open")
    return Material(2 * shear * (1 + nu), nu, law, coefficients=c)
