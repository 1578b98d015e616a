"""Ranking of cells within a condition of the twin, with ties and the Pareto front."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from validate.engine.cell import Record
from validate.study.filters.plan import FilterCell
from validate.study.filters.score import (
    LOG_LOSS,
    POOLED,
    WITHHELD,
    Blocks,
    FilterScores,
    Nested,
    SeedInterval,
    blocks_of,
    interval,
    nested,
    of_score,
    score_difference,
    score_interval,
)
from validate.study.sweep import named

# --- What a ranking without truth picks, where the truth is known: its true error against the
# best.

NEAR = 1.1  # times the best true error: as good


@dataclass(frozen=True)
class TruthPick:
    """On one recording: the setting of least error at what was withheld, its true error m, and the
    setting of the least true error."""

    condition: tuple[tuple[str, str], ...]
    seed: int
    cell: FilterCell
    error: float
    best: FilterCell
    least: float

    @property
    def ratio(self) -> float:
        if self.error == self.least:
            return 1.0
        return self.error / self.least if self.least > 0 else float("inf")

    @property
    def near(self) -> bool:
        return self.ratio <= NEAR


def picks(values: Mapping[FilterCell, FilterScores]) -> tuple[TruthPick, ...]:
    """One for every condition and seed, among filters; none where no truth is known."""
    filters = {
        c: v for c, v in values.items()
        if v.nis is not None and not c.baseline and POOLED in v.scores and WITHHELD in v.scores
    }  # fmt: skip
    picked = []
    for condition in dict.fromkeys(c.condition for c in filters):
        same = {c: v for c, v in filters.items() if c.condition == condition}
        if len(same) < 2:
            continue
        for i, seed in enumerate(next(iter(same)).seeds):
            true = {c: v.scores[POOLED][i] for c, v in same.items()}
            pick = min(same, key=lambda c: same[c].scores[WITHHELD][i])
            best = min(true, key=lambda c: true[c])
            picked.append(TruthPick(condition, seed, pick, true[pick], best, true[best]))
    return tuple(picked)


# -------------------------------------------------------------------------------------------------

# Ratio of median step times below which they are equal: noise of a shared machine.
SAME_TIME = 1.25
SAME_ERROR = 1 + 1e-6

Condition = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Ranked:
    """A cell's place by one score; `overlaps` are the places whose intervals overlap its interval.

    `from_best` is its score less the best one's over common seeds, or blocks of one recording;
    `tied` when that interval holds zero, or there are too few to say. `dominated_by` is the place
    of a cell with less error and less time a step (see `SAME_TIME`); None on the Pareto front.
    """

    place: int
    cell: FilterCell
    result: FilterScores
    score: SeedInterval
    overlaps: tuple[int, ...]
    from_best: SeedInterval
    tied: bool
    dominated_by: int | None


@dataclass(frozen=True)
class Ranking:
    """All cells of one condition, best first, and those that failed; `blocks` of one recording,
    and what a choice on some of its data is worth on the rest."""

    condition: Condition
    rows: tuple[Ranked, ...]
    failed: tuple[tuple[FilterCell, str], ...]
    blocks: Blocks | None = None
    nested: Nested | None = None

    @property
    def front(self) -> tuple[Ranked, ...]:
        """The Pareto front, fastest first; what has no time is not on it."""
        timed = [r for r in self.rows if r.result.step_s is not None]
        free = [r for r in timed if r.dominated_by is None]
        return tuple(sorted(free, key=lambda r: (_time(r.result), r.place)))


def _time(scores: FilterScores) -> float:
    """Seconds of a step; infinite for what is not timed."""
    return math.inf if scores.step_s is None else scores.step_s


def rankings(
    cells: Sequence[FilterCell], records: Mapping[str, Record[FilterScores]], by: str
) -> tuple[Ranking, ...]:
    """One ranking per condition, in the order of the grid."""
    conditions = dict.fromkeys(c.condition for c in cells)
    return tuple(
        _ranking(condition, [c for c in cells if c.condition == condition], records, by)
        for condition in conditions
    )


def _ranking(
    condition: Condition,
    cells: Sequence[FilterCell],
    records: Mapping[str, Record[FilterScores]],
    by: str,
) -> Ranking:
    scored = [(c, value) for c in cells if (value := records[c.key].value) is not None]
    failed = [(c, records[c.key].why) for c in cells if records[c.key].value is None]
    # Those scored on the most markers, and the others with the reason: fewer are another score
    on = {c.key: frozenset(w.name for w in of_score(v.withheld, by)) for c, v in scored}
    most = max(on.values(), key=len, default=frozenset())
    kept = [(c, v) for c, v in scored if by in v.scores and (on[c.key] == most or by == LOG_LOSS)]
    rest = [(c, v) for c, v in scored if c.key not in {k.key for k, _ in kept}]
    other = [(c, _why_not(v, by, on[c.key], most)) for c, v in rest]
    order = sorted(kept, key=lambda one: interval(one[1].scores[by]).mean)
    values = {c.key: value for c, value in order}
    names = {c.key: f"{c.name} ({named(c.settings)})" if c.settings else c.name for c, _ in order}
    blocks = blocks_of({names[key]: v for key, v in values.items()})
    means = [score_interval(value, by, blocks) for _, value in order]
    times = [_time(value) for _, value in order]
    rows = []
    for i, (cell, value) in enumerate(order):
        better = dominator(i, [m.mean for m in means], times)
        difference = score_difference(value, order[0][1], by, blocks)
        overlaps = tuple(j + 1 for j, s in enumerate(means) if j != i and means[i].overlaps(s))
        rows.append(
            Ranked(
                i + 1,
                cell,
                value,
                means[i],
                overlaps,
                difference,
                tied(difference),
                None if better is None else better + 1,
            )
        )
    of_filters = {names[c.key]: v for c, v in order if v.nis is not None and not c.baseline}
    others = {names[c.key]: v for c, v in order if v.nis is None or c.baseline}
    chosen = nested(
        of_filters,
        others,
        by if values and any(v.sums(by) is not None for _, v in order) else WITHHELD,
        blocks,
    )
    return Ranking(condition, tuple(rows), (*failed, *other), blocks, chosen)


ScoredCells = list[tuple[FilterCell, FilterScores]]


def _why_not(value: FilterScores, by: str, names: frozenset[str], most: frozenset[str]) -> str:
    if by == LOG_LOSS and value.predictions is not None:
        return f"no {by}: its variance needs samples in two blocks of time"
    if by == LOG_LOSS or (by not in value.scores and not most):
        return f"no innovations, so no {by}"
    return (
        f"scored on {', '.join(sorted(names)) or 'nothing'}, other cells on "
        f"{', '.join(sorted(most))}: give it two markers or more, or name --hold-out"
    )


def tied(difference: SeedInterval) -> bool:
    """Return whether the interval of a difference holds zero, or there is none (one sample)."""
    return difference.half is None or abs(difference.mean) <= difference.half


def dominator(i: int, errors: Sequence[float], times: Sequence[float]) -> int | None:
    """Return the first that has less error than i in at most its time, or no more error in less
    time; times within `SAME_TIME` are equal, and so are errors within `SAME_ERROR`: two solvers of
    one system differ by rounding. None on the Pareto front."""
    for j, (error, time) in enumerate(zip(errors, times, strict=True)):
        better = SAME_ERROR * error < errors[i] and time <= SAME_TIME * times[i]
        faster = error <= SAME_ERROR * errors[i] and SAME_TIME * time < times[i]
        if j != i and (better or faster):
            return j
    return None
