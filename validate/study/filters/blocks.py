"""Blocks of time as samples: intervals of a score on one recording, nested choice of settings.

Errors of neighbouring samples are not independent. A block is at least as long as the innovations
of the best predictor stay correlated; with fewer than eight blocks there is no interval.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.study.filters.score import (
    LOG_LOSS,
    FilterScores,
    SeedInterval,
    interval,
    of_score,
    summed,
)

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
    return Nested(
        _reported(squares, counts, by, blocks), chosen, beside, blocks.count, len(common) > 1
    )


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


def _reported(squares: Floats, counts: Floats, by: str, blocks: Blocks) -> SeedInterval:
    if len(squares) > 1:
        totals = squares.sum(axis=1) / counts.sum(axis=1)
        return interval([_root(by, float(mean)) for mean in totals])
    sampled = counts[0] > 0
    means = squares[0, sampled] / counts[0, sampled]
    score = _root(by, float(squares.sum() / counts.sum()))
    half = interval(means.tolist()).half if blocks.sure else None
    half = None if half is None else half / _slope(by, score, score)
    return SeedInterval(score, half, int(sampled.sum()))
