"""Scores of a filter study: true error, error at withheld data, log-likelihood and NIS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from validate.arrays import Floats
from validate.compare.force_error import rmse, track_error
from validate.estimate.consistency import Consistency, nis_consistency
from validate.study.filters.withheld_errors import Innovations, PredictionErrors, Withheld

# --- Units in which a study shows its scores.


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which a score of `unit` (SI) is shown."""
    return (1e3, "mm") if unit == "m" else (1.0, unit)


def unit_text(unit: str) -> str:
    """Return a shown unit after a number in a sentence: " mm"; "" for a number without unit."""
    return "" if unit == "1" else f" {unit}"


# --- Means over seeds with Student's t intervals, alone and in pairs.

LEVEL = 0.95


@dataclass(frozen=True)
class SeedInterval:
    """A mean of `count` independent numbers; `half` is half the 95 % interval, None for one."""

    mean: float
    half: float | None
    count: int

    @property
    def low(self) -> float:
        return self.mean - (self.half or 0.0)

    @property
    def high(self) -> float:
        return self.mean + (self.half or 0.0)

    def overlaps(self, other: "SeedInterval") -> bool:
        return self.low <= other.high and other.low <= self.high


def interval(values: Sequence[float]) -> SeedInterval:
    """Of the mean of independent, equally distributed values (n,), n >= 1."""
    n = len(values)
    mean = float(np.mean(values))
    if n < 2:
        return SeedInterval(mean, None, n)
    spread = float(np.std(values, ddof=1)) / np.sqrt(n)
    return SeedInterval(mean, float(student.ppf((1 + LEVEL) / 2, n - 1) * spread), n)


# -------------------------------------------------------------------------------------------------

POOLED = "all.rmse"
NIS = "nis.per_dof"
WITHHELD = "withheld.rmse"  # of all markers: those held out, and the next samples of the others
HELD_OUT = "held_out.rmse"  # of markers that no filter was given, or that were held out in turn
AHEAD = "ahead.rmse"  # of markers that were given: each sample from those before it
LOG_LOSS = "log_loss"  # minus log-likelihood of a measured component, its density in metres
WORDS = {
    POOLED: "rms error against the truth of the twin along one axis, over its probes and all steps",
    WITHHELD: "rms distance from measurements that the filter was not given: held-out "
    "markers, and the next sample of given markers (noise included)",
    HELD_OUT: "rms distance from the measurements of held-out markers (noise included)",
    AHEAD: "rms distance of a given marker's next sample from its prediction (noise included)",
    LOG_LOSS: "minus log-likelihood of the innovations per measured component, densities in "
    "metres; without innovations, of a Gaussian with the error variance of the other blocks",
}


@dataclass(frozen=True)
class FilterScores:
    """Scores by name, one number per seed (SI, `units` by name); step_s s is the median step and
    step_p99_s its 99 % quantile, None for runs that are smoothed: they are none for real time.

    `nis` is that of all seeds with `nis_dof` degrees of freedom, None without innovations.
    `frozen` is the step from which a linear filter's gains repeat. `shared`: all seeds were run at
    once with one set of gains. `withheld` are the squared errors at what the method was not given,
    in segments of `segment_s` s. `predictions` are the errors of a method without innovations at
    what filters were given.
    """

    scores: Mapping[str, tuple[float, ...]]
    units: Mapping[str, str]
    nis: float | None = None
    nis_dof: int = 0
    step_s: float | None = None
    step_p99_s: float | None = None
    setup_s: float | None = None
    steps: int = 0
    frozen: int | None = None
    shared: bool = False
    withheld: tuple[Withheld, ...] = ()
    innovations: Innovations | None = None
    predictions: PredictionErrors | None = None
    segment_s: float = 0.0

    @property
    def consistency(self) -> Consistency | None:
        """NIS of all seeds together; None for a method without innovations."""
        if self.nis is None or not self.nis_dof:
            return None
        return nis_consistency([self.nis], [self.nis_dof])

    def sums(self, by: str) -> tuple[Floats, Floats] | None:
        """What a score is the mean of: sums and counts (seeds, segments); None for one against the
        truth, whose segments are not kept."""
        if by == LOG_LOSS:
            i = self.innovations
            return None if i is None else (-i.log_likelihood, i.dof)
        return summed(of_score(self.withheld, by))


def of_score(withheld: Sequence[Withheld], by: str) -> list[Withheld]:
    """Return the quantities that a score is made of."""
    if by == WITHHELD:
        return [w for w in withheld if w.marker]
    if by in (HELD_OUT, AHEAD):
        return [w for w in withheld if w.marker and w.ahead == (by == AHEAD)]
    return [w for w in withheld if name_of(w) == by]


def summed(withheld: Sequence[Withheld]) -> tuple[Floats, Floats] | None:
    """Sums of squares and counts (seeds, segments) of some quantities; None for none."""
    if not withheld:
        return None
    return sum(w.squares for w in withheld), sum(w.counts for w in withheld)  # type: ignore[return-value]


def name_of(w: Withheld) -> str:
    """Return the name of the score of one quantity."""
    return f"{w.name}.{AHEAD if w.ahead else HELD_OUT}"


def withheld_scores(
    withheld: Sequence[Withheld], innovations: Innovations | None
) -> tuple[dict[str, tuple[float, ...]], dict[str, str]]:
    """Scores by name, one number per seed, and their units."""
    scores: dict[str, tuple[float, ...]] = {}
    units: dict[str, str] = {}
    named = {n: of_score(withheld, n) for n in (WITHHELD, HELD_OUT, AHEAD)}
    for name, parts in (named | {name_of(w): [w] for w in withheld}).items():
        sums = summed(parts)
        if sums is None or not (sums[1].sum(axis=1) > 0).all():
            continue
        squares, counts = (x.sum(axis=1) for x in sums)
        scores[name], units[name] = tuple(np.sqrt(squares / counts).tolist()), parts[0].unit
    if innovations is not None and (dof := innovations.dof.sum(axis=1)).all():
        loss = -innovations.log_likelihood.sum(axis=1) / dof
        scores[LOG_LOSS], units[LOG_LOSS] = tuple(loss.tolist()), "1"
    return scores, units


def error_scores(
    estimates: Mapping[str, Floats], truth: Mapping[str, Floats], axis: str
) -> dict[str, float]:
    """`<probe>.rmse` m and `all.rmse` m from traces (nt,) m and truths (nt, d) m by probe."""
    c = "xyz".index(axis)
    scores, squares = {}, []
    for probe, reference in truth.items():
        error = track_error(probe, axis, estimates[probe], reference[:, c])
        scores[f"{probe}.rmse"] = rmse(error)
        squares.append(error.values**2)
    return {POOLED: float(np.sqrt(np.mean(squares))), **scores}
