"""Relative bias and scatter of predictions over many experiments, as in validation of fire models.

McGrattan and Toman (2011), "Quantifying the predictive uncertainty of complex numerical models",
Metrologia 48, 173-180; NUREG-1824, supplement 1 (2016). Measured E and predicted M scatter about
the truth by the relative standard deviations omega_E, which is known, and omega_M, which is not:

    omega_M^2 + omega_E^2 = variance of ln(M/E)
    delta = exp(mean of ln(M/E) + omega_M^2/2 - omega_E^2/2)

so that a prediction M has the truth about M/delta, with the scatter omega_M.

Departures: points of one specimen have much in common, so that means are taken over specimens
first, and intervals rest on how many of these there are: with one point each it is as printed.
Intervals are 95 % by Student's t and by chi-square, with one degree of freedom less than specimens.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from validate.arrays import rms
from validate.compare.residual import Residual
from validate.errors import ComparisonError
from validate.estimate.consistency import chi_square_quantile

# --- How large something was, measured and simulated: what relative bias and scatter are made
# of.

# What a quantity is called in a statement over experiments: by a word of its name, else its unit.
_BY_WORD = (
    "displacement", "position", "force", "stress", "stretch", "frequency", "pressure", "strain",
)  # fmt: skip
_BY_UNIT = {
    "m": "displacement", "N": "force", "N/m": "force", "Pa": "stress", "Hz": "frequency",
    "m2": "area",
}  # fmt: skip
_PLACES = ("contour", "outline", "diameter", "radius", "landmark")


@dataclass(frozen=True)
class Size:
    """Rms lengths in the quantity's unit: measured, and simulated along what was measured.

    The measurement's independent noise is out of both; `u` is the standard uncertainty that it and
    what all points share leave in the measured one. Negative: simulated the other way.
    """

    measured: float
    simulated: float
    u: float


def kind_of(quantity: str, unit: str) -> str:
    """Return the measured quantity in a word; "" where none fits."""
    words = re.split(r"[._]", quantity)
    # An extensometer may be called stretch, and measure metres.
    named = [w for w in words if w in _BY_WORD and (unit == "1" or w not in ("stretch", "strain"))]
    if named:
        return named[0]
    if unit == "m" and words[0] in _PLACES:
        return "position"
    return _BY_UNIT.get(unit, "")


def size_of(residual: Residual) -> Size | None:
    """Return the size of the compared quantity; None without a measured one, or with noise alone.

    Of many points: simulated = b measured, b the least-squares factor of the simulated values on
    the measured ones through zero, <s, m>/<m, m>, with the noise's share c sd^2 out of <m, m>.
    """
    m = residual.reference
    if m is None and residual.measured is not None:
        m = np.array([[residual.measured]])
    if m is None:
        return None
    d, (k, c) = residual.values, residual.values.shape
    noise = c * residual.sd**2 if k * c > 1 else 0.0
    squared = float((m**2).sum() / k) - noise
    if not squared > 0:
        return None
    measured = float(np.sqrt(squared))
    along = (float((d * m).sum() / k) + noise) / measured
    own = residual.sd * np.sqrt(c / (residual.freedom or k * c))
    return Size(measured, measured + along, float(np.hypot(own, residual.systematic)))


# -------------------------------------------------------------------------------------------------

_TAIL = 0.975


@dataclass(frozen=True)
class Predicted:
    """One prediction of a specimen: ln(predicted / measured), and the relative standard uncertainty
    of the measured one."""

    specimen: str
    log_ratio: float
    own: float


@dataclass(frozen=True)
class Estimated:
    """A value with its 95 % interval; None where so few specimens give none."""

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Statement:
    """`bias` is predicted over true (1: none), `scatter` the models' relative standard deviation
    with the measurements' `own` one removed (None: of one point)."""

    bias: Estimated
    scatter: Estimated | None
    own: float
    points: int
    specimens: int


def statement(points: Sequence[Predicted]) -> Statement:
    """Bias and scatter of predictions. Raises `ComparisonError` for none."""
    if not points:
        raise ComparisonError("0 predictions, so there is no bias to report")
    own = rms([p.own for p in points])
    names = dict.fromkeys(p.specimen for p in points)
    groups = [np.array([p.log_ratio for p in points if p.specimen == name]) for name in names]
    means = np.array([g.mean() for g in groups])
    # Of one point: that between the specimens' means, and that within, which means hide.
    if len(groups) > 1:
        within = float(np.mean([g.var() for g in groups]))
        squared = float(means.var(ddof=1)) + within
    elif len(groups[0]) > 1:
        squared = float(groups[0].var(ddof=1))
    else:
        return Statement(Estimated(float(np.exp(means.mean()))), None, own, 1, 1)
    low = high = None
    freedom = len(groups) - 1
    if freedom >= 1:
        ends = (float(chi_square_quantile(p, freedom)) for p in (_TAIL, 1 - _TAIL))
        low, high = (squared * freedom / end for end in ends)
    scatter = Estimated(_without(squared, own), low and _without(low, own),
                        high and _without(high, own))  # fmt: skip
    shift = float(means.mean()) + (scatter.value**2 - own**2) / 2
    bias, value = Estimated(float(np.exp(shift))), float(np.exp(shift))
    if len(means) >= 2:
        off = float(stdtrit(len(means) - 1, _TAIL) * means.std(ddof=1) / np.sqrt(len(means)))
        bias = Estimated(value, value * float(np.exp(-off)), value * float(np.exp(off)))
    return Statement(bias, scatter, own, len(points), len(groups))


def _without(squared: float, own: float) -> float:
    """The models' part of a scatter; 0 where the measurements' own explains all of it."""
    return float(np.sqrt(max(squared - own**2, 0.0)))


def area_metric(error: float, simulated: float, measured: float) -> float:
    """Area between the distributions of a prediction and of a measurement, in the unit of `error`.

    Normal ones, `error` apart, of standard deviations `simulated` and `measured`: the mean of
    |error + (simulated - measured) z| over a standard normal z. Ferson, Oberkampf, Ginzburg (2008),
    "Model validation and predictive capability", Comput. Methods Appl. Mech. Eng. 197, 2408-2430.
    """
    spread = abs(simulated - measured)
    if spread == 0:
        return abs(error)
    at = error / spread
    return float(spread * np.sqrt(2 / np.pi) * np.exp(-(at**2) / 2) + error * (1 - 2 * ndtr(-at)))
