"""Which cells are best: ranked within a condition of the twin, ties stated, Pareto beside."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from validate.study.filter_plan import FilterCell
from validate.study.interval import SeedInterval, interval, paired
from validate.study.score import FilterScores
from validate.study.store import Record

# Medians of one step on a machine that does other things too: closer than this is the same time.
SAME_TIME = 1.25
SAME_ERROR = 1 + 1e-6

Condition = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Ranked:
    """A cell's place by one score; `overlaps` are the places whose intervals overlap its own.

    `from_best` is its score less the best one's over common seeds; `tied` when that interval holds
    zero, or there are too few seeds to say. `dominated_by` is the place of a cell with less error
    and less time a step (see `SAME_TIME`); None on the Pareto front.
    """

    place: int
    cell: FilterCell
    result: FilterScores
    score: SeedInterval
    overlaps: tuple[int, ...]
    from_best: SeedInterval
    tied: bool
    dominated_by: int | None
    scores: tuple[float, ...]


@dataclass(frozen=True)
class Ranking:
    """All cells of one condition, best first, and those that failed."""

    condition: Condition
    rows: tuple[Ranked, ...]
    failed: tuple[tuple[FilterCell, str], ...]

    @property
    def front(self) -> tuple[Ranked, ...]:
        """The Pareto front, fastest first; what has no time is not on it."""
        timed = [r for r in self.rows if r.result.step_s is not None]
        free = [r for r in timed if r.dominated_by is None]
        return tuple(sorted(free, key=lambda r: (_time(r.result), r.place)))


def _time(scores: FilterScores) -> float:
    """Seconds of a step; one that cannot keep up with a clock takes for ever."""
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
    found = [(c, value) for c in cells if (value := records[c.key].value) is not None]
    failed = tuple((c, records[c.key].why) for c in cells if records[c.key].value is None)
    order = sorted(found, key=lambda one: interval(one[1].scores[by]).mean)
    scores = [value.scores[by] for _, value in order]
    means = [interval(s) for s in scores]
    times = [_time(value) for _, value in order]
    rows = []
    for i, (cell, value) in enumerate(order):
        better = dominator(i, [m.mean for m in means], times)
        rows.append(
            Ranked(
                i + 1, cell, value, means[i], _overlaps(i, means), *tied(scores[i], scores[0]),
                None if better is None else better + 1, scores[i],
            )
        )  # fmt: skip
    return Ranking(condition, tuple(rows), failed)


def _overlaps(i: int, scores: Sequence[SeedInterval]) -> tuple[int, ...]:
    mine = scores[i]
    return tuple(j + 1 for j, s in enumerate(scores) if j != i and mine.overlaps(s))


def tied(mine: Sequence[float], best: Sequence[float]) -> tuple[SeedInterval, bool]:
    """`mine` less `best` over common seeds, and whether that interval holds zero (or there is none:
    one seed tells nothing)."""
    apart = paired(mine, best)
    return apart, apart.half is None or abs(apart.mean) <= apart.half


def dominator(i: int, errors: Sequence[float], times: Sequence[float]) -> int | None:
    """The first that has less error than i in at most its time, or no more error in less time;
    times within `SAME_TIME` are equal, and so are errors within `SAME_ERROR`: two solvers of one
    system differ by rounding. None on the Pareto front."""
    for j, (error, time) in enumerate(zip(errors, times, strict=True)):
        better = SAME_ERROR * error < errors[i] and time <= SAME_TIME * times[i]
        faster = error <= SAME_ERROR * errors[i] and SAME_TIME * time < times[i]
        if j != i and (better or faster):
            return j
    return None
