"""Errors of a displacement over time at one point, by the definitions of the papers.

MAE, RMSE and SD as in paper 003, Tables 1-3: SD is the sample standard deviation (ddof 1) of the
absolute error, not of the signed one. NRMSE as in paper 001: RMSE over the range (largest less
smallest) of the reference; the paper does not print its normaliser.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, checked, rms
from validate.compare.score import Score
from validate.errors import ComparisonError


@dataclass(frozen=True)
class TrackError:
    """Estimate less reference (nt,) m of one displacement component; `spread` m is the range of
    the reference over the same times."""

    name: str
    component: str
    values: Floats
    spread: float

    def __post_init__(self) -> None:
        values = checked(self.values, f"error at {self.name}", (None,), error=ComparisonError)
        if len(values) < 2:
            raise ComparisonError(
                f"{self.name}: {len(values)} compared times, at least 2 needed; check the clocks"
            )
        object.__setattr__(self, "values", values)


def track_error(name: str, component: str, estimate: Floats, reference: Floats) -> TrackError:
    """Return the error of traces (nt,) m at equal times; raises `ComparisonError` for other
    lengths."""
    if estimate.shape != reference.shape:
        raise ComparisonError(
            f"{name}: {len(estimate)} estimated and {len(reference)} reference times; a run that "
            "ended early has no error over the whole time"
        )
    return TrackError(name, component, estimate - reference, float(np.ptp(reference)))


def mae(error: TrackError) -> float:
    return float(np.abs(error.values).mean())


def rmse(error: TrackError) -> float:
    return rms(error.values)


def sd_of_absolute(error: TrackError) -> float:
    return float(np.abs(error.values).std(ddof=1))


def largest(error: TrackError) -> float:
    return float(np.abs(error.values).max())


def nrmse(error: TrackError) -> float:
    """Raise `ComparisonError` where the reference does not move."""
    if error.spread <= 0:
        raise ComparisonError(f"{error.name}: the reference does not move, so NRMSE is not defined")
    return rmse(error) / error.spread


TRACK_METRICS: tuple[tuple[str, Callable[[TrackError], float], str, str], ...] = (
    ("mae", mae, "m", "mean absolute error"),
    ("rmse", rmse, "m", "root mean square error"),
    ("sd", sd_of_absolute, "m", "sample sd (ddof 1) of the absolute error"),
    ("max", largest, "m", "largest absolute error"),
    ("nrmse", nrmse, "1", "root mean square error over the range of the reference"),
)


def track_scores(error: TrackError, against: str, condition: str = "") -> tuple[Score, ...]:
    """Scores `<node>.<statistic>[@condition]` of one component."""
    end = f"@{condition}" if condition else ""
    return tuple(
        Score(
            f"{error.name}.{name}{end}",
            statistic(error),
            unit,
            len(error.values),
            against,
            f"{error.component} displacement at {error.name}, estimate minus reference; {words}",
        )
        for name, statistic, unit, words in TRACK_METRICS
    )
