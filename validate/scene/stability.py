"""Whether a law's coefficients keep its energy positive, over the stretches that it is meant for.

The isochoric energy of an incompressible body, as a function of the logarithms of its stretches,
must be convex (Hill 1970; Drucker's criterion of commercial codes) along uniaxial, equibiaxial and
planar stretch. From the state of rest on, that makes the energy positive, the stress rise with the
stretch and the larger stress go with the larger stretch (Baker & Ericksen 1954).
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.laws import Coefficients, ogden_terms

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


def lost_stability(law: str, c: Coefficients, mu: float) -> Lost | None:
    """Where stiffness is lost between the coefficients' `stretches`; None: nowhere. mu Pa."""
    low, high = (np.log(s) for s in c.stretches)
    logs = np.concatenate([np.linspace(0, end, _POINTS) for end in (low, high)])
    lost = []
    for mode, (first, second) in _MODES.items():
        strains = np.multiply.outer([first, second, -first - second], logs)
        inside = ((strains >= low - 1e-12) & (strains <= high + 1e-12)).all(axis=0)
        stiffness = _least_stiffness(law, c, mu, first * logs, second * logs)
        bad = np.flatnonzero(inside & ~(stiffness > 0))
        if len(bad):
            worst = bad[np.argmin(np.abs(logs[bad]))]
            lost.append(Lost(float(np.exp(logs[worst])), mode, float(stiffness[worst])))
    return min(lost, key=lambda one: abs(np.log(one.stretch)), default=None)


def require_stable(law: str, c: Coefficients, mu: float, kappa: float) -> None:
    """Raises `SceneError` at the stretch nearest to 1 where stiffness is lost, and says in which
    stretch; mu, kappa Pa."""
    lost = lost_stability(law, c, mu)
    if lost:
        raise SceneError(
            f"law '{law}' with {_words(law, c, mu)} loses positive energy at stretch "
            f"{lost.stretch:.4g} ({lost.mode}): stiffness {lost.stiffness:.3g} Pa there; use "
            "other coefficients, or give with `stretches` the range in which it is used"
        )
    if c.volumetric == "coupled":
        _require_stiff_volume(law, c, mu, kappa)


def coupled_lambda(c: Coefficients, mu: float, kappa: float) -> float:
    """Factor Pa of ln^2 J/2 in the coupled form: Lame's lambda less what the shear terms bring."""
    return kappa - 2 * mu / 3 - 4 * c.C01 - 8 * c.C20


def _require_stiff_volume(law: str, c: Coefficients, mu: float, kappa: float) -> None:
    factor = coupled_lambda(c, mu, kappa)
    if factor < 0 and c.known_to("neo_hooke") != c:
        raise SceneError(
            f"law '{law}' with {_words(law, c, mu)} loses positive energy in volume: the "
            f"coupled form needs lambda - 4 C01 - 8 C20 >= 0, it is {factor:.4g} Pa; use "
            "volumetric 'split' or a Poisson ratio nearer to .5"
        )


def _words(law: str, c: Coefficients, mu: float) -> str:
    if law == "ogden":
        return "mu, alpha = " + ", ".join(f"{m:.4g} Pa, {a:g}" for m, a in ogden_terms(c, mu))
    terms = {"C10": mu / 2 - c.C01, "C01": c.C01, "C20": c.C20, "C30": c.C30}
    return ", ".join(f"{k} = {v:.4g} Pa" for k, v in terms.items() if v or k == "C10")


def _least_stiffness(law: str, c: Coefficients, mu: float, a: Floats, b: Floats) -> Floats:
    """Least eigenvalue Pa of the energy's second derivatives by the logarithms a, b (n,)."""
    if law == "ogden":
        terms = [m / alpha * _power_sum(a, b, alpha)[2] for m, alpha in ogden_terms(c, mu)]
        return np.asarray(np.linalg.eigvalsh(np.sum(terms, axis=0))[:, 0])
    (s1, g1, D1), (_, _, D2) = (_power_sum(a, b, alpha) for alpha in (2.0, -2.0))
    C10, x = mu / 2 - c.C01, (s1 - 3)[:, None, None]
    slope, curve = C10 + 2 * c.C20 * x + 3 * c.C30 * x**2, 2 * c.C20 + 6 * c.C30 * x
    H = slope * D1 + curve * g1[:, :, None] * g1[:, None, :] + c.C01 * D2
    return np.asarray(np.linalg.eigvalsh(H)[:, 0])


def _power_sum(a: Floats, b: Floats, alpha: float) -> tuple[Floats, Floats, Floats]:
    """e^(alpha a) + e^(alpha b) + e^(-alpha (a + b)) (n,), its slopes (n, 2) and second derivatives
    (n, 2, 2)."""
    x, y, z = np.exp(alpha * a), np.exp(alpha * b), np.exp(-alpha * (a + b))
    second = np.stack([np.stack([x + z, z], -1), np.stack([z, y + z], -1)], -2)
    return x + y + z, alpha * np.stack([x - z, y - z], -1), alpha**2 * second
