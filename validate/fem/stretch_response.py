"""Stress against stretch of a material point: what a testing machine sees of a law, exactly.

F = diag(stretch, second, free), the free stretches found so that their stress vanishes: Newton on
S_33(h) = P_33/F_33, h = F_33 - 1, which has no root at a collapsed point as P_33 has.
"""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import SceneError
from validate.fem.laws import Law, law_of
from validate.fem.tensors import volume_change
from validate.scene.material_point import MaterialPoint, StretchMode

_ITERATIONS = 50
_SETTLED = 1e-14  # of the free stretch; Newton squares its error, so that one more step is rounding
_COLLAPSED = 1e-6  # a free stretch on its way to none
_TWO, _THREE = np.diag([0.0, 1.0, 0.0]), np.diag([0.0, 0.0, 1.0])
# What the stretch and the free stretch move of H.
_MOVES: Mapping[StretchMode, tuple[Floats, Floats]] = {
    "uniaxial": (np.diag([1.0, 0.0, 0.0]), _TWO + _THREE),
    "equibiaxial": (np.diag([1.0, 1.0, 0.0]), _THREE),
    "pure_shear": (np.diag([1.0, 0.0, 0.0]), _THREE),
}


def response(point: MaterialPoint, stretches: Floats) -> dict[str, Floats]:
    """What the point answers to stretches (nt,): each (nt,), by name.

    "nominal_stress" Pa, force over the area at rest, tension positive; "free_stretch" -, of the
    third direction; "volume_ratio" -. Raises `SceneError` for a law without large strain, a stretch
    below the law's least, and where no free stretch is without stress (St. Venant-Kirchhoff pulled
    far).
    """
    law = law_of(point.material)
    stretch = checked(stretches, "stretches", (None,), error=SceneError)
    for value in (stretch.min(), stretch.max()) if len(stretch) else ():
        if not law.least_stretch < value <= law.most_stretch:
            ends = f"above {law.least_stretch:.4g}"
            ends += f" up to {law.most_stretch:.4g}" if law.most_stretch < np.inf else ""
            raise SceneError(
                f"stretch {value:.4g}: the law '{point.material.law}' has sense {ends}"
            )
    drive, free = _MOVES[point.mode]
    driven = (stretch - 1)[:, None, None] * drive
    h = _free_strain(law, driven, free, _first_guess(point, stretch))
    H = driven + h[:, None, None] * free
    stress = np.asarray(law.stress(H)[:, 0, 0])
    return {"nominal_stress": stress, "free_stretch": 1 + h, "volume_ratio": 1 + volume_change(H)}


def _first_guess(point: MaterialPoint, stretch: Floats) -> Floats:
    """h of logarithmic strains that are as in small strain."""
    nu = point.material.nu
    ratio = {"uniaxial": nu, "equibiaxial": 2 * nu / (1 - nu), "pure_shear": nu / (1 - nu)}
    return np.expm1(-ratio[point.mode] * np.log(stretch))


def _free_strain(law: Law, driven: Floats, free: Floats, h: Floats) -> Floats:
    """h (nt,) without stress P_33 at F = I + driven + h free."""
    for _ in range(_ITERATIONS):
        H = driven + h[:, None, None] * free
        stress, slope = _free_stress(law, H, free, 1 + h)
        # A step may not cross zero length.
        change = np.maximum(-stress / slope, -0.9 * (1 + h))
        h = h + change
        if (np.abs(change) <= _SETTLED * (1 + h)).all():
            return h
        if (1 + h < _COLLAPSED).any():
            break
    worst = int(np.argmax(np.abs(change) / (1 + h)))
    raise SceneError(
        f"at stretch {1 + driven[worst, 0, 0]:.4g} no free stretch is without stress: "
        "the law has no state there; stretch less"
    )


def _free_stress(law: Law, H: Floats, free: Floats, length: Floats) -> tuple[Floats, Floats]:
    """S_33 = P_33/F_33 (nt,) Pa and its slope along `free`."""
    P = law.stress(H)[:, 2, 2]
    dP = np.einsum("njK,jK->n", law.tangent(H)[:, 2, 2], free)
    return P / length, (dP - P / length) / length
