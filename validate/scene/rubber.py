"""Published rubber materials: coefficients of papers and handbooks, with a Poisson ratio.

Young's modulus at small strain follows; incompressible sources are met by nu up to .4999.
"""

from dataclasses import replace
from typing import Any

from validate.errors import SceneError
from validate.scene.laws import Coefficients, VolumetricName
from validate.scene.material import LawName, Material


def mooney_rivlin(
    C10: float, C01: float, nu: float, volumetric: VolumetricName = "split", **more: Any
) -> Material:
    """C10, C01 Pa of I1 - 3 and I2 - 3 (Mooney 1940; Rivlin 1948): mu = 2 (C10 + C01)."""
    return _rubber("mooney_rivlin", 2 * (C10 + C01), nu, Coefficients(C01=C01), volumetric, more)


def yeoh(
    C10: float, C20: float, C30: float, nu: float, volumetric: VolumetricName = "split", **more: Any
) -> Material:
    """C10, C20, C30 Pa of the powers of I1 - 3 (Yeoh 1993): mu = 2 C10."""
    return _rubber("yeoh", 2 * C10, nu, Coefficients(C20=C20, C30=C30), volumetric, more)


def ogden(
    mu: tuple[float, ...],
    alpha: tuple[float, ...],
    nu: float,
    volumetric: VolumetricName = "split",
    **more: Any,
) -> Material:
    """Terms mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3), mu_p Pa (Ogden 1972): the
    shear modulus is sum mu_p alpha_p / 2. Codes that write 2 mu_p/alpha_p^2 print mu_p alpha_p/2.

    Raises `SceneError` for another number of moduli than of powers.
    """
    if len(mu) != len(alpha) or not mu:
        raise SceneError(f"Ogden: {len(mu)} moduli for {len(alpha)} powers; give one for each term")
    shear = sum(m * a for m, a in zip(mu, alpha, strict=True)) / 2
    more_terms = Coefficients(ogden_mu=tuple(mu[1:]), ogden_alpha=tuple(alpha))
    return _rubber("ogden", shear, nu, more_terms, volumetric, more)


def _rubber(
    law: LawName, shear: float, nu: float, known: Coefficients, form: VolumetricName,
    more: dict[str, Any],
) -> Material:  # fmt: skip
    """`more`: other fields of `Material`, and `stretches` of its coefficients."""
    stretches = more.pop("stretches", known.stretches)
    coefficients = replace(known, volumetric=form, stretches=stretches)
    return Material(2 * shear * (1 + nu), nu, law, coefficients=coefficients, **more)
