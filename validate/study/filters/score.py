"""Scores of a filter study and their intervals: true error, withheld data, log-likelihood, NIS."""

from collections import Counter
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


# --- blocks of time as samples -------------------------------------------------------------------

FEWEST = 8  # blocks of an interval
MOST = 20


@dataclass(frozen=True)
class Blocks:
    """`starts` are the first segments of each block; `length_s` s of one block, at least
    `correlation_s` s; `name` is the method whose innovations those are."""

    starts: tuple[int, ...]
    length_s: float
    correlation_s: float
    name: str

    @property
    def count(self) -> int:
        return len(self.starts)

    @property
    def sure(self) -> bool:
        """Whether there are enough for an interval."""
        return self.count >= FEWEST

    @property
    def words(self) -> str:
        text = (
            f"{self.count} blocks of {self.length_s:.3g} s; innovations of {self.name} stay "
            f"correlated for {self.correlation_s:.3g} s"
        )
        return text if self.sure else f"{text}: fewer than {FEWEST} blocks give no interval"

    def sums(self, values: Floats) -> Floats:
        """Of values (..., segments) by block (..., blocks)."""
        return np.asarray(np.add.reduceat(values, self.starts, axis=-1))


def blocks_of(values: Mapping[str, FilterScores]) -> Blocks | None:
    """Blocks by the filter, of results by name, that gave the measurements most likelihood; None
    without innovations."""
    filters = {
        name: v
        for name, v in values.items()
        if v.innovations is not None and v.innovations.correlation_s is not None
    }
    if not filters:
        return None
    name = min(filters, key=lambda n: float(np.mean(filters[n].scores.get(LOG_LOSS, (np.inf,)))))
    best = filters[name]
    assert best.innovations is not None
    assert best.innovations.correlation_s is not None
    return cut(best.innovations.dof.shape[1], best.segment_s, best.innovations.correlation_s, name)


def cut(segments: int, segment_s: float, correlation_s: float, name: str) -> Blocks:
    """At most `MOST` blocks of whole segments, each as long as the correlation or longer; what is
    left over belongs to the last one."""
    each = max(1, int(np.ceil(correlation_s / segment_s - 1e-9)), int(np.ceil(segments / MOST)))
    count = max(1, segments // each)
    starts = tuple(each * i for i in range(count))
    return Blocks(starts, each * segment_s, correlation_s, name)


# --- intervals of one recording -------------------------------------------------------------------


def score_interval(value: FilterScores, by: str, blocks: Blocks | None) -> SeedInterval:
    """Of a score: over the seeds, or over the blocks of one recording."""
    scores = value.scores[by]
    means = _block_means(value, by, blocks)
    if len(scores) > 1 or means is None:
        return interval(scores)
    half = interval(means.tolist()).half
    half = None if half is None else half / _slope(by, scores[0], scores[0])
    return SeedInterval(scores[0], half, len(means))


def score_difference(
    one: FilterScores, other: FilterScores, by: str, blocks: Blocks | None
) -> SeedInterval:
    """Of one score less the other, seed by seed or block by block."""
    scores, others = one.scores[by], other.scores[by]
    differences = [a - b for a, b in zip(scores, others, strict=True)]
    means = _block_means(one, by, blocks), _block_means(other, by, blocks)
    if len(scores) > 1 or means[0] is None or means[1] is None:
        return interval(differences)
    half = interval((means[0] - means[1]).tolist()).half
    half = None if half is None else half / _slope(by, scores[0], others[0])
    return SeedInterval(differences[0], half, len(means[0]))


def _slope(by: str, one: float, other: float) -> float:
    """How much a mean square moves with its root: a^2 - b^2 = (a + b) (a - b)."""
    return 1.0 if by == LOG_LOSS else max(one + other, np.finfo(float).tiny)


def _block_means(value: FilterScores, by: str, blocks: Blocks | None) -> Floats | None:
    """Mean squares of one recording by block; None where there is no interval: too few blocks, or
    innovations that stay correlated for longer than one."""
    totals = value.sums(by)
    if blocks is None or not blocks.sure or totals is None or len(totals[0]) > 1:
        return None
    correlation_s = value.innovations.correlation_s if value.innovations is not None else None
    if (correlation_s or 0.0) > blocks.length_s * (1 + 1e-9):
        return None
    sums, counts = (blocks.sums(x[0]) for x in totals)
    return np.asarray(sums[counts > 0] / counts[counts > 0])


# --- nested choice --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Nested:
    """What settings that are chosen on some blocks and markers are worth on the others.

    `error` of the choices with its interval over the blocks (or seeds), `beside` that of baselines
    on the same data; `chosen` counts how often each was. `split`: choosing and reporting used
    different markers too.
    """

    error: SeedInterval
    chosen: Mapping[str, int]
    beside: Mapping[str, float]
    blocks: int
    split: bool


def nested(
    filters: Mapping[str, FilterScores],
    baselines: Mapping[str, FilterScores],
    by: str,
    blocks: Blocks | None,
) -> Nested | None:
    """None with fewer than two blocks, filters, or without what was withheld."""
    parts = [_parts(v, by) for v in filters.values()]
    common = sorted(set.intersection(*parts)) if parts else []
    if blocks is None or blocks.count < 2 or len(filters) < 2 or not common:
        return None
    halves = [common[::2], common[1::2]] if len(common) > 1 else [common, common]
    folds = [(halves[0], halves[1]), (halves[1], halves[0])] if len(common) > 1 else [tuple(halves)]
    seeds = len(next(iter(filters.values())).scores[by])
    squares, counts = np.zeros((seeds, blocks.count)), np.zeros((seeds, blocks.count))
    chosen: Counter[str] = Counter()
    every = {**filters, **baselines}
    others = {name: np.zeros(2) for name in baselines}
    for choose, report in folds:
        sums = {n: _by_block(v, by, choose, blocks) for n, v in filters.items()}
        reported = {n: _by_block(v, by, report, blocks) for n, v in every.items()}
        for s in range(seeds):
            for b in range(blocks.count):
                pick = min(sums, key=lambda n: _without(sums[n], s, b))
                chosen[pick] += 1
                squares[s, b] += reported[pick][0][s, b]
                counts[s, b] += reported[pick][1][s, b]
        for name, totals in others.items():
            totals += [reported[name][0].sum(), reported[name][1].sum()]
    beside = {n: _root(by, float(q / c)) for n, (q, c) in others.items() if c}
    if seeds > 1:
        means = squares.sum(axis=1) / counts.sum(axis=1)
        error = interval([_root(by, float(mean)) for mean in means])
    else:
        sampled = counts[0] > 0
        means = squares[0, sampled] / counts[0, sampled]
        score = _root(by, float(squares.sum() / counts.sum()))
        half = interval(means.tolist()).half if blocks.sure else None
        half = None if half is None else half / _slope(by, score, score)
        error = SeedInterval(score, half, int(sampled.sum()))
    return Nested(error, chosen, beside, blocks.count, len(common) > 1)


def _parts(value: FilterScores, by: str) -> set[str]:
    """The names of what a score is made of; the likelihood is one part."""
    if by == LOG_LOSS:
        return {LOG_LOSS} if value.innovations is not None else set()
    return {w.name for w in of_score(value.withheld, by)}


def _by_block(
    value: FilterScores, by: str, names: Sequence[str], blocks: Blocks
) -> tuple[Floats, Floats]:
    if by == LOG_LOSS:
        totals = value.sums(by)
    else:
        totals = summed([w for w in of_score(value.withheld, by) if w.name in names])
    if totals is None:
        none = np.zeros((len(value.scores[by]), blocks.count))
        return none, none
    return blocks.sums(totals[0]), blocks.sums(totals[1])


def _without(sums: tuple[Floats, Floats], seed: int, block: int) -> float:
    """Mean square, or mean log loss, of a seed over all blocks but one."""
    squares, counts = (np.delete(x[seed], block).sum() for x in sums)
    return float(squares / counts) if counts else np.inf


def _root(by: str, mean: float) -> float:
    """A score of the mean over its samples: log loss is that mean, an rms its root."""
    return mean if by == LOG_LOSS else float(np.sqrt(mean))
