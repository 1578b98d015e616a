"""The laws at large strain: which there are, what each can handle, and their further coefficients.

Every law has the Young's modulus and Poisson ratio of its material at small strain; what is left
over is given here as the field writes it. C10 of Mooney-Rivlin and Yeoh and mu_1 of Ogden follow:
2 (C10 + C01) = 2 C10 = mu, sum of mu_p alpha_p = 2 mu. `scene.rubber` makes materials of published
coefficients. The forms are in `fem`, written out in docs/laws.md.
"""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from validate.errors import SceneError
from validate.parameters import quantity

VolumetricName = Literal["split", "coupled"]
StabilityRule = Literal["required", "open"]


@dataclass(frozen=True)
class LawKind:
    """`coefficients`: fields of `Coefficients` that it knows; `volumetric`: its forms.

    `ranged`: it is checked, and used, between the stretches that the coefficients state.
    """

    name: str
    title: str
    coefficients: tuple[str, ...] = ()
    volumetric: tuple[VolumetricName, ...] = ("split", "coupled")
    ranged: bool = True


LAWS: tuple[LawKind, ...] = (
    LawKind("svk", "St. Venant-Kirchhoff", volumetric=(), ranged=False),
    LawKind("neo_hooke", "neo-Hooke", ranged=False),
    LawKind("mooney_rivlin", "Mooney-Rivlin", ("C01",)),
    LawKind("yeoh", "Yeoh", ("C20", "C30")),
    LawKind("ogden", "Ogden", ("ogden_mu", "ogden_alpha")),
)


@dataclass(frozen=True)
class Coefficients:
    """What laws have beyond E and nu; zero, or one term, leaves neo-Hooke.

    `ogden_mu` are those of the terms after the first. `volumetric` "split" is an isochoric part of
    J^(-1/3) F and kappa/4 (J^2 - 1 - 2 ln J), "coupled" the whole of F, - mu ln J and ln^2 J.
    An "open" `stability` is for fits, which must be able to pass through unstable coefficients
    (`scene.stability.lost_stability` says which): a simulation requires it.
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
        known = {name: getattr(self, name) for name in keep}
        if self.volumetric in kind.volumetric:
            known["volumetric"] = self.volumetric
        return Coefficients(**known)

    def require_known(self, law: str) -> None:
        """Raises `SceneError` for a coefficient that the law would not use."""
        known = self.known_to(law)
        if known == self:
            return
        name = next(f.name for f in fields(self) if getattr(self, f.name) != getattr(known, f.name))
        users = [k.name for k in LAWS if self.known_to(k.name) == self]
        instead = f"; take law {' or '.join(users)}" if users else ""
        raise SceneError(
            f"law '{law}' does not know {name} = {getattr(self, name)}: leave it out{instead}"
        )


def law_kind(law: str) -> LawKind:
    """The law of this name; the linear one knows nothing."""
    return next((k for k in LAWS if k.name == law), LawKind(law, law, (), (), ranged=False))


def ogden_terms(c: Coefficients, shear_modulus: float) -> tuple[tuple[float, float], ...]:
    """(mu_p Pa, alpha_p) of all terms; the first modulus makes sum mu_p alpha_p = 2 mu."""
    alpha, rest = c.ogden_alpha, c.ogden_mu
    taken = sum(m * a for m, a in zip(rest, alpha[1:], strict=True))
    first = (2 * shear_modulus - taken) / alpha[0]
    return tuple(zip((first, *rest), alpha, strict=True))
