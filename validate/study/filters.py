"""The filter sweep: every method and setting over common seeds, ranked with intervals.

from validate.study.filters import study
found = study("kf_cube", ["methods.kf_printed.Q=log:1e-12:1e-6:7"], methods=("kf_printed",))
print(found.best[0].line)
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from validate.errors import ComparisonError, UsageError
from validate.parameters import nearest_names
from validate.replay.experiment import Experiment
from validate.replay.find import find
from validate.replay.options import Options, Report
from validate.study.engine import CELLS, Finished, finish, study_folder
from validate.study.filter_cell import open_bench, run_cell
from validate.study.filter_plan import METHODS, FilterCell, FilterPlan, plan
from validate.study.job import Plan, Where
from validate.study.ranking import Ranked, Ranking, rankings, tied
from validate.study.score import POOLED, FilterScores
from validate.study.sweep import axes

KIND = "filters"
SEEDS = 10  # common samples of the noise: a t interval of them is 2.3 standard errors wide


@dataclass(frozen=True)
class Best:
    """The best filter of one condition, the command that runs it, and how many filters' cells
    cannot be told from it; `edges` are the swept paths whose first or last value it has."""

    ranked: Ranked
    line: str
    ties: int
    edges: tuple[str, ...]

    @property
    def doubts(self) -> str:
        """What speaks against taking it as it is; "" for nothing."""
        found = []
        if self.ranked.score.half is None:
            found.append("one seed tells no two cells apart")
        elif self.ties:
            found.append(f"{self.ties} others cannot be told from it")
        if self.edges:
            found.append(f"at the end of the sweep of {', '.join(self.edges)}: widen it")
        return "; ".join(found)


@dataclass(frozen=True)
class FilterStudy:
    """All cells with their records, and the rankings by the score `by`, one a condition."""

    plan: FilterPlan
    by: str
    done: Finished[FilterScores]
    rankings: tuple[Ranking, ...]

    @property
    def best(self) -> tuple[Best, ...]:
        return tuple(_best(self.plan, r) for r in self.rankings if r.rows)

    @property
    def failed(self) -> int:
        return sum(len(r.failed) for r in self.rankings)


def study(
    experiment: str | Experiment,
    sweeps: Sequence[str] = (),
    *,
    methods: tuple[str, ...] = (),
    values: Mapping[str, str] | None = None,
    seeds: int | tuple[int, ...] = SEEDS,
    by: str = POOLED,
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> FilterStudy:
    """Runs what is not finished yet in `out`/<name>/study-filters/cells, and ranks everything.

    `sweeps` as for `--sweep`, `values` as for `--set`; `out` is the folder of the reports. Raises
    `UsageError` for bad names and values before anything runs, `ComparisonError` when no cell has
    a score.
    """
    found = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    planned = plan(found, Options(dict(values or {}), methods, quick), axes(sweeps), seeds)
    work = Plan(planned.job, planned.cells, open_bench, run_cell, FilterScores)
    done = finish(work, study_folder(found, KIND, out) / CELLS, where, report)
    _require_score(done, by)
    return FilterStudy(planned, by, done, rankings(planned.cells, done.records, by))


def _require_score(done: Finished[FilterScores], by: str) -> None:
    good = [r.value for r in done.records.values() if r.value is not None]
    if not good:
        first = next(iter(done.records.values()))
        raise ComparisonError(
            f"all {len(done.records)} cells failed, 0 compared; the first: {first.why}"
        )
    for value in good:
        if by not in value.scores:
            hint = nearest_names(by, set(value.scores))
            raise UsageError(f"no score '{by}' to rank by; {hint}")


def _best(planned: FilterPlan, ranking: Ranking) -> Best:
    """The first filter (what has innovations); the first of all where there is none."""
    filters = [r for r in ranking.rows if r.result.nis is not None]
    rows = filters or list(ranking.rows)
    ties = sum(tied(r.scores, rows[0].scores)[1] for r in rows[1:])
    cell = rows[0].cell
    return Best(rows[0], run_line(planned, cell), ties, _edges(planned, cell))


def _edges(planned: FilterPlan, cell: FilterCell) -> tuple[str, ...]:
    """Swept settings of three and more numbers of which the cell has the least or the largest."""
    found = []
    for axis in planned.axes:
        numbers = axis.numbers
        if axis.path in dict(cell.settings) and numbers is not None and len(numbers) > 2:
            own = numbers[axis.values.index(cell.values[axis.path])]
            if own in (min(numbers), max(numbers)):
                found.append(axis.path)
    return tuple(found)


def run_line(planned: FilterPlan, cell: FilterCell) -> str:
    """The `validate run` command of a cell, with the methods it is judged beside: the reference
    that speeds are compared with and those whose checks decide, as `cell` alone may have none."""
    experiment = planned.experiment
    beside = [m for m in experiment.methods if m in (*experiment.accepted, experiment.reference)]
    methods = tuple(dict.fromkeys((*beside, cell.method)))
    values = {**dict(planned.job.values), **cell.values}
    kept = {k: v for k, v in values.items() if _concerns(k, methods)}
    parts = ["validate", "run", experiment.name]
    for path, value in kept.items():
        parts += ["--set", f"{path}={value}"]
    return shlex.join([*parts, "--methods", ",".join(methods)])


def _concerns(path: str, methods: Sequence[str]) -> bool:
    mine = tuple(f"{METHODS}{m}." for m in methods)
    return not path.startswith(METHODS) or path.startswith(mine)
