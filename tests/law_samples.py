"""One material of every law and volumetric form, with one modulus: what contract tests run over."""

from dataclasses import replace

from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material

#: Law, and its coefficients in units of the shear modulus.
_FORMS: dict[str, tuple[LawName, Coefficients]] = {
    "svk": ("svk", Coefficients()),
    "neo_hooke": ("neo_hooke", Coefficients()),
    "mooney_rivlin": ("mooney_rivlin", Coefficients(C01=0.12)),
    "yeoh": ("yeoh", Coefficients(C20=0.04, C30=0.01)),
    "ogden": ("ogden", Coefficients(ogden_mu=(-0.3, 0.02), ogden_alpha=(1.3, -2.0, 5.0))),
}
NAMES = (*_FORMS, *(f"{name}_coupled" for name in _FORMS if name != "svk"))
SPLIT = tuple(_FORMS)


def sample(name: str, E: float = 15_200.0, nu: float = 0.45) -> Material:
    """The material of that name."""
    law, c = _FORMS[name.removesuffix("_coupled")]
    mu = E / (2 * (1 + nu))
    scaled = replace(
        c, C01=mu * c.C01, C20=mu * c.C20, C30=mu * c.C30,
        ogden_mu=tuple(mu * m for m in c.ogden_mu),
        volumetric="coupled" if name.endswith("_coupled") else "split",
    )  # fmt: skip
    return Material(E, nu, law, coefficients=scaled)
