"""Errors of a force and of a displacement over time.

Errors of a displacement over time at one point, by the definitions of the papers. MAE, RMSE and SD
as in paper 003, Tables 1-3: SD is the sample standard deviation (ddof 1) of the absolute error, not
of the signed one. NRMSE as in paper 001: RMSE over the range (largest less smallest) of the
reference; the paper does not print its normaliser.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from validate.arrays import Floats, checked, rms
from validate.compare.score import Counted, Metric, Score
from validate.errors import ComparisonError, RecordingError
from validate.recording.clocks.alignment import coarse_lag, met, refined_lag, step_of
from validate.recording.types import Signal


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


# -------------------------------------------------------------------------------------------------

MIN_MATCHED = 10  # samples of the reference met by the run
_COVERAGE = 0.5  # share of the run that must overlap the reference at every tried lag


@dataclass(frozen=True)
class ForcePair:
    """A run's force and the reference force at the reference's times t (nt,) s, both (nt,) N.

    `run` and `reference` are the whole signals; `lag_within` s bounds the search for the phase;
    `against` names the reference.
    """

    name: str
    t: Floats
    y: Floats
    y_reference: Floats
    run: Signal
    reference: Signal
    lag_within: float
    against: str

    @property
    def where(self) -> str:
        return f"{self.name} at the times of the reference that the run covers"

    @property
    def units(self) -> Mapping[str, object]:
        return {"force": self.run.unit}

    @property
    def track(self) -> TrackError:
        error = self.y - self.y_reference
        return TrackError(self.name, "force", error, float(np.ptp(self.y_reference)))

    def scores(self) -> tuple[Score, ...]:
        """Return the scores `<name>.<metric>` of the force."""
        return tuple(metric.score(self, f"{self.name}.") for metric in FORCE_METRICS)

    @classmethod
    def of(cls, name: str, run: Signal, reference: Signal, lag_within: float, against: str) -> Self:
        """Return the run interpolated at the reference's times that it meets, gaps excluded.

        Raises `ComparisonError` for different units, several columns, or fewer than 10 met samples.
        """
        if run.unit != reference.unit or run.y.shape[1] != 1 or reference.y.shape[1] != 1:
            raise ComparisonError(
                f"{name}: {run.y.shape[1]} columns in {run.unit} against {reference.y.shape[1]} in "
                f"{reference.unit}; choose one column each in one unit"
            )
        if lag_within <= 0:
            raise ComparisonError(f"{name}: lags within {lag_within:g} s; expected a positive time")
        seen = met(run.t, reference.t) if len(run.t) > 1 else np.zeros(len(reference.t), dtype=bool)
        if seen.sum() < MIN_MATCHED:
            raise ComparisonError(
                f"{name}: {int(seen.sum())} of {len(reference.t)} reference samples lie within the "
                f"run, at least {MIN_MATCHED} are needed; check the clocks"
            )
        t = reference.t[seen]
        y = np.interp(t, run.t, run.y[:, 0])
        return cls(name, t, y, reference.y[seen, 0], run, reference, lag_within, against)


def peak_error(force: ForcePair) -> float:
    """Largest |force| of the run less that of the reference; negative = the run stays below."""
    return float(np.abs(force.y).max() - np.abs(force.y_reference).max())


def relative_peak_error(force: ForcePair) -> float:
    """Peak error over the largest |force| of the reference; refuses a reference of zeros."""
    return peak_error(force) / _positive(float(np.abs(force.y_reference).max()), force)


def rms_error(force: ForcePair) -> float:
    return rmse(force.track)


def relative_rms_error(force: ForcePair) -> float:
    """Root mean square error over the root mean square of the reference."""
    return rms_error(force) / _positive(rms(force.y_reference), force)


def phase_error(force: ForcePair) -> float:
    """Return the lag (s) of the run behind the reference, at the best correlation.

    Refined between the samples; independent of scale and offset. Raises `ComparisonError` where
    the two are not alike or one lag does not stand out; of a periodic force, search within less
    than half a period.
    """
    run, reference = force.run, force.reference
    if np.array_equal(run.t, reference.t) and np.array_equal(run.y, reference.y):
        return 0.0  # the refined lag would stop within a thousandth of a sample
    step = min(step_of(run.t), step_of(reference.t))
    try:
        start = coarse_lag(reference, run, step, force.lag_within, _COVERAGE)
        lag, _ = refined_lag(reference, run, start)
    except RecordingError as error:
        raise ComparisonError(f"{force.name}: no phase error: {error}") from error
    return -lag


def _positive(scale: float, force: ForcePair) -> float:
    if scale == 0:
        raise ComparisonError(
            f"{force.name}: the reference force is always 0, so a relative error has no scale"
        )
    return scale


_SAMPLES: Counted[ForcePair] = Counted("samples of the reference", lambda f: len(f.t))


def _of_track(value: Callable[[TrackError], float]) -> Callable[[ForcePair], float]:
    return lambda f: value(f.track)


#: Of a force alone, and MAE, RMSE, SD, NRMSE as for displacements.
FORCE_METRICS: tuple[Metric[ForcePair], ...] = (
    Metric(
        "peak",
        peak_error,
        "{force}",
        "largest |force| of the run minus that of the reference",
        _SAMPLES,
    ),
    Metric(
        "peak.relative",
        relative_peak_error,
        "1",
        "peak error over the reference's largest |force|",
        _SAMPLES,
    ),
    Metric("rms", rms_error, "{force}", "root mean square of run minus reference", _SAMPLES, True),
    Metric(
        "rms.relative",
        relative_rms_error,
        "1",
        "rms error over the reference's root mean square",
        _SAMPLES,
    ),
    Metric(
        "phase",
        phase_error,
        "s",
        "delay of the run against the reference: lag of the best correlation",
        _SAMPLES,
    ),
    *(
        Metric(name, _of_track(value), "{force}" if unit == "m" else unit, words, _SAMPLES)
        for name, value, unit, words in TRACK_METRICS
    ),
)
