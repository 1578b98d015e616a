"""Filter consistency: innovations, NIS and NEES against chi-square.

For a consistent filter NIS = y^T S_yy^-1 y is chi-square with as many degrees of freedom as
components were measured, and innovations are white; NEES = e^T P^-1 e likewise over the states
(Bar-Shalom, Li & Kirubarajan 2001, ch. 5.4). NIS sees measured components only: a filter can look
consistent while unmeasured nodes are wrong (as in the experiment kf_cube), so look at NEES or at
nodal errors too.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, gammaincinv

from validate.arrays import Floats, checked
from validate.errors import ComparisonError

Verdict = Literal["over-confident", "consistent", "under-confident"]
# Noise taken for half of what it is gives 4 here, for a third 9: beyond that it is not tuning. A
# model of another kind than the truth gives tens to thousands.
WRONG_CLASS = 10.0
_EIGENVALUE_FLOOR = 1e-12  # of the largest: directions in which P claims no error at all


@dataclass(frozen=True)
class Band:
    """Range in which the mean of a chi-square lies with `probability` if the filter is right."""

    probability: float
    low: float
    high: float

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Consistency:
    """Mean of NIS or NEES over `samples` steps with `dof` degrees of freedom in all.

    `mean` and both bands are per degree of freedom: 1 for a consistent filter. `verdict` is by the
    95 % band, `holds` by the 99.9 % band: the one to show, the other to test with.
    """

    kind: Literal["NIS", "NEES"]
    samples: int
    dof: int
    mean: float
    band_95: Band
    band_999: Band

    @property
    def verdict(self) -> Verdict:
        """Too much error for the claimed covariance is over-confident."""
        if self.mean > self.band_95.high:
            return "over-confident"
        return "under-confident" if self.mean < self.band_95.low else "consistent"

    @property
    def holds(self) -> bool:
        return self.band_999.holds(self.mean)

    @property
    def alarm(self) -> str:
        """ "" or that the model is of a wrong class: far more error than any tuning explains."""
        if self.mean <= WRONG_CLASS:
            return ""
        if self.kind == "NEES":
            return (
                "the claimed covariance is wrong here: NEES per degree of freedom "
                f"{self.mean:.3g} over {self.samples} steps, 1 expected"
            )
        return (
            f"wrong model class: {self.kind} per degree of freedom {self.mean:.3g} over "
            f"{self.samples} steps, 1 expected; above {WRONG_CLASS:g} no tuning can explain it"
        )

    @property
    def line(self) -> str:
        """One line with bands and counts."""
        b = self.band_95
        return (
            f"{self.kind} {self.mean:.3f} per degree of freedom ({self.samples} steps, {self.dof} "
            f"degrees, 95 % band {b.low:.3f}..{b.high:.3f}): {self.verdict}"
        )


def nis_consistency(nis: ArrayLike, dof: ArrayLike) -> Consistency:
    """From the traces "nis" and "nis.dof" (nt,); steps that measured nothing are left out.

    Raises `ComparisonError` when no step measured anything.
    """
    return _consistency("NIS", nis, dof)


def nees_consistency(nees: ArrayLike, dof: ArrayLike) -> Consistency:
    """From NEES (nt,) and its degrees (nt,) where truth is known. Steps of one run are correlated,
    which the bands do not know: judge independent runs, one step of each, or expect more spread.
    """
    return _consistency("NEES", nees, dof)


def nees(error: ArrayLike, P: ArrayLike) -> tuple[float, int]:
    """e^T P^-1 e and its degrees of freedom for error (n,) and covariance P (n, n).

    Directions of (nearly) no claimed variance are left out; the degrees count the rest. Raises
    `ComparisonError` for a P without any variance, or with a negative one.
    """
    e = checked(error, "error", (None,), error=ComparisonError)
    values, vectors = np.linalg.eigh(checked(P, "P", (len(e), len(e)), error=ComparisonError))
    floor = _EIGENVALUE_FLOOR * values[-1]
    if values[-1] <= 0 or values[0] < -floor:
        raise ComparisonError(f"P has eigenvalues {values[0]:.1e}..{values[-1]:.1e}: no covariance")
    kept = values > floor
    return float(((vectors.T @ e)[kept] ** 2 / values[kept]).sum()), int(kept.sum())


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation (lags,) of an innovation over `samples`, and Ljung-Box's Q with its p value.

    A small p: the innovation has memory, so the model or its Q is wrong.
    """

    samples: int
    autocorrelation: Floats
    Q: float
    p: float

    @property
    def white(self) -> bool:
        """At the 99.9 % level."""
        return self.p >= 1e-3


def whiteness(innovation: ArrayLike, sd: ArrayLike, lags: int = 10) -> Whiteness:
    """Of y / sd where sd > 0 (measured), about zero: an innovation's mean is part of its memory.

    Ljung & Box (1978). Raises `ComparisonError` for fewer than three samples a lag.
    """
    sd_ = checked(sd, "innovation sd", (None,), error=ComparisonError)
    y = checked(innovation, "innovation", (len(sd_),), error=ComparisonError)
    e = y[sd_ > 0] / sd_[sd_ > 0]
    n = len(e)
    if n < 3 * lags:
        raise ComparisonError(f"{n} innovations for {lags} lags: at least {3 * lags} are needed")
    r = np.array([e[k:] @ e[:-k] for k in range(1, lags + 1)]) / (e @ e)
    Q = float(n * (n + 2) * (r**2 / (n - np.arange(1, lags + 1))).sum())
    return Whiteness(n, r, Q, float(chdtrc(lags, Q)))


def chi_square_quantile(p: float, dof: ArrayLike) -> Floats:
    """Where chi-square of `dof` degrees has probability p below it; scipy.stats loads in a second.

    The incomplete gamma function's inverse: P(dof/2, x/2) = p.
    """
    return np.asarray(2 * gammaincinv(np.asarray(dof) / 2, p))


def _consistency(kind: Literal["NIS", "NEES"], values: ArrayLike, dof: ArrayLike) -> Consistency:
    degrees = checked(dof, f"{kind} degrees", (None,), error=ComparisonError)
    statistic = checked(values, kind, (len(degrees),), error=ComparisonError)
    measured = degrees > 0
    total = round(float(degrees[measured].sum()))
    if total == 0:
        raise ComparisonError(
            f"{kind} over {len(degrees)} steps: nothing was compared, because no measurement "
            "lies on a step; check the times of the measurements"
        )
    mean = float(statistic[measured].sum()) / total
    bands = (_band(0.95, total), _band(0.999, total))
    return Consistency(kind, int(measured.sum()), total, mean, *bands)


def _band(probability: float, dof: int) -> Band:
    low, high = (
        float(chi_square_quantile(p, dof)) / dof
        for p in (0.5 - probability / 2, 0.5 + probability / 2)
    )
    return Band(probability, low, high)
