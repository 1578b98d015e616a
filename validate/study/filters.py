"""The filter sweep: every method and setting over common seeds, ranked with intervals.

from validate.study.filters import study
found = study("kf_cube", ["methods.kf_printed.Q=log:1e-12:1e-6:7"], methods=("kf_printed",))
print(found.best[0].line)
"""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from validate.errors import ComparisonError, UsageError
from validate.parameters import nearest_names
from validate.replay.experiment import Experiment
from validate.replay.find import find, root_of
from validate.replay.options import Options
from validate.study.outcome import CellResult, read_cells, write_cell
from validate.study.plan import METHODS, Cell, Plan, plan
from validate.study.ranking import Ranked, Ranking, rankings, tied
from validate.study.score import POOLED
from validate.study.sweep import axes

KIND = "study-filters"
CELLS = "cells"
SEEDS = 10  # common samples of the noise: a t interval of them is 2.3 standard errors wide

Report = Callable[[int, int, str], None]


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
class Study:
    """All cells with their results by key, and the rankings by the score `by`, one a condition.

    `reused` of them were finished before; `seconds` is what this call took.
    """

    plan: Plan
    by: str
    results: Mapping[str, CellResult]
    rankings: tuple[Ranking, ...]
    reused: int
    seconds: float
    workers: str

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
    workers: int | None = None,
    scheduler: str = "",
    report: Report | None = None,
) -> Study:
    """Runs what is not finished yet in `out`/<name>/study-filters/cells, and ranks everything.

    `sweeps` as for `--sweep`, `values` as for `--set`; `out` is the folder of the reports. Raises
    `UsageError` for bad names and values before anything runs, `ComparisonError` when no cell has
    a score.
    """
    start = perf_counter()
    found = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    planned = plan(found, Options(dict(values or {}), methods, quick), axes(sweeps), seeds)
    folder = cells_folder(found, out)
    folder.mkdir(parents=True, exist_ok=True)
    before = read_cells(folder, planned.cells)
    results, where = _finish(planned, folder, before, workers, scheduler, report or _silent)
    _require_score(planned, results, by)
    ranked = rankings(planned.cells, results, by)
    seconds = perf_counter() - start
    return Study(planned, by, results, ranked, len(before), seconds, where)


def _finish(
    planned: Plan,
    folder: Path,
    before: Mapping[str, CellResult],
    workers: int | None,
    scheduler: str,
    tell: Report,
) -> tuple[dict[str, CellResult], str]:
    """Runs the cells that are not in `before`, keeping each in `folder`; all results, and where."""
    from validate.study.workers import Where, cores, run_all  # a second to import

    results = dict(before)
    left = [c for c in planned.cells if c.key not in before]

    def done(cell: Cell, result: CellResult) -> None:
        results[cell.key] = result
        if result.lasting:
            write_cell(folder, cell, result)
        tell(len(results), len(planned.cells), cell.method)

    tell(len(results), len(planned.cells), "workers")
    run_all(planned.job, left, Where(workers, scheduler), done)
    local = f"{workers or min(cores(), len(left))} local"
    return results, f"Dask at {scheduler}" if scheduler else local


def study_folder(experiment: Experiment, out: Path | None) -> Path:
    """`out`/<name>/study-filters, by default in the reports/ of the experiment's clone."""
    reports = out or root_of(experiment, Path.cwd()) / "reports"
    return reports / experiment.name / KIND


def cells_folder(experiment: Experiment, out: Path | None) -> Path:
    return study_folder(experiment, out) / CELLS


def _silent(done: int, total: int, text: str) -> None:
    pass


def _require_score(planned: Plan, results: Mapping[str, CellResult], by: str) -> None:
    good = [r for r in results.values() if not r.failed]
    if not good:
        first = next(iter(results.values()))
        raise ComparisonError(
            f"all {len(results)} cells failed, 0 compared; the first: {first.failed}"
        )
    for result in good:
        if by not in result.scores:
            hint = nearest_names(by, set(result.scores))
            raise UsageError(f"no score '{by}' to rank by; {hint}")


def _best(planned: Plan, ranking: Ranking) -> Best:
    """The first filter (what has innovations); the first of all where there is none."""
    filters = [r for r in ranking.rows if r.result.nis is not None]
    rows = filters or list(ranking.rows)
    ties = sum(tied(r.scores, rows[0].scores)[1] for r in rows[1:])
    cell = rows[0].cell
    return Best(rows[0], run_line(planned, cell), ties, _edges(planned, cell))


def _edges(planned: Plan, cell: Cell) -> tuple[str, ...]:
    """Swept settings of three and more numbers of which the cell has the least or the largest."""
    found = []
    for axis in planned.axes:
        numbers = axis.numbers
        if axis.path in dict(cell.settings) and numbers is not None and len(numbers) > 2:
            own = numbers[axis.values.index(cell.values[axis.path])]
            if own in (min(numbers), max(numbers)):
                found.append(axis.path)
    return tuple(found)


def run_line(planned: Plan, cell: Cell) -> str:
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
