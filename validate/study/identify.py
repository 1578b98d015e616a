"""Identification of an experiment's parameters: starts and profiles side by side, kept as they end.

from validate.study.identify import identification
found = identification("silicone_beam", wanted=("material.E=1e5:1e6",))
for one in found.calibrated:
    print(one.found.estimates)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time
from typing import Any

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.identify.identification import Identification, identify
from validate.identify.least_squares import Fit
from validate.identify.profile import Side
from validate.identify.space import Space
from validate.replay.asked import asked
from validate.replay.calibrated import Identify, identified
from validate.replay.experiment import Experiment
from validate.replay.find import find
from validate.replay.options import Options, Report
from validate.replay.problem import Calibrated, Problem
from validate.study.engine import CELLS, Finished, finish, study_folder
from validate.study.identify_cell import (
    IdentifyBench,
    Known,
    LinearCell,
    Of,
    SideCell,
    StartCell,
    open_bench,
    run_linear,
    run_side,
    run_start,
)
from validate.study.job import C, Job, Plan, R, Where, file_sha256
from validate.study.store import key_of

KIND = "identify"
STARTS, QUICK_STARTS = 10, 4
STARTS_OF_ONE = 5  # of a single parameter: every fifth of its range has one
SEED = 1
_ALONE = 30.0  # s: less work than this is done here, for workers take as long to begin
_TRIED = 2  # cells that are done here first


@dataclass(frozen=True)
class IdentifyStudy:
    """Every calibration that was asked for; `done` counts its cells, `failed` says why methods
    that are calibrated each by itself could not be."""

    experiment: Experiment
    calibrated: tuple[Calibrated, ...]
    done: Finished[Any]
    quick: bool
    failed: Mapping[str, str] = field(default_factory=dict)

    @property
    def identified(self) -> bool:
        return not self.failed and all(
            e.identified for c in self.calibrated for e in c.found.estimates
        )


class InCells:
    """Evaluates fits and profiles as the cells of a study; counts them."""

    def __init__(
        self, experiment: Experiment, options: Options, wanted: Sequence[str], starts: int | None,
        out: Path | None, where: Where | None, report: Report | None,
    ) -> None:  # fmt: skip
        self._path, self._options = Path(str(experiment.path)), options
        self._wanted, self._starts = tuple(wanted), starts
        self._folder = study_folder(experiment, KIND, out) / CELLS
        self._where, self._report = where or Where(), report
        self._known: Known = ()
        self.done: Finished[Any] = Finished({}, 0, 0.0, "")

    def __call__(self, number: int, problem: Problem) -> Identification:
        """As `validate.replay.calibrated.Identify`."""
        of = Of(number, self._wanted, self._known)
        alone = len(problem.space.ranges) == 1
        usual = STARTS_OF_ONE if alone else STARTS
        usual = QUICK_STARTS if self._options.quick else usual
        starts = usual if self._starts is None else self._starts
        found = identify(problem.space, _Cells(self, of, problem), starts, SEED)
        values = {e.name: e.value for e in found.estimates}
        self._known = (*self._known, *values.items())
        return found

    def job(self, problem: Problem) -> Job:
        hashes = tuple(r.source.sha256 for part in problem.parts for r in part.recordings)
        values = tuple(sorted(self._options.values.items()))
        return Job(str(self._path), file_sha256(self._path), hashes, values, self._options.quick)

    def finished(self, plan: Plan[C, R]) -> list[R]:
        """The cells' values in order; the first two here, whose quicker one says where the rest
        goes: the very first also sets up what all share."""
        first, done = replace(plan, cells=plan.cells[:_TRIED]), self._finish
        where = self._where
        if where.workers is None and not where.scheduler:
            start = process_time()
            begun = done(first, Where(0))
            # Seconds of work: a busy machine must not start workers, which make it busier.
            fresh = len(first.cells) - begun.reused
            work = [(process_time() - start) / fresh] if fresh > 0 else []
            seconds = min([*work, *(r.seconds for r in begun.records.values())])
            where = Where(0) if seconds * (len(plan.cells) - _TRIED) < _ALONE else where
        found = done(plan, where)
        return [_value(found, cell) for cell in plan.cells]

    def _finish(self, plan: Plan[C, R], where: Where) -> Finished[R]:
        found = finish(plan, self._folder, where, self._report)
        new = {k: r for k, r in found.records.items() if k not in self.done.records}
        reused = max(0, found.reused - (len(found.records) - len(new)))
        own: Finished[Any] = Finished(new, reused, found.seconds, found.workers)
        self.done = own.and_also(self.done) if new else self.done.and_also(own)
        return found


def _value(found: Finished[R], cell: Any) -> R:
    record = found.records[cell.key]
    if record.value is None:
        raise ComparisonError(f"{cell.label}: {record.why}")
    return record.value


class _Cells:
    """The fits and sides of one problem."""

    def __init__(self, owner: InCells, of: Of, problem: Problem) -> None:
        self._owner, self._of = owner, of
        self._names, self._job = problem.space.names, owner.job(problem)

    def linear(self, space: Space) -> Fit:
        cell = _keyed(self._job, LinearCell(self._of, f"closed form of {self._names[0]}"))
        plan = Plan(self._job, (cell,), open_bench, run_linear, Fit)
        return self._owner.finished(plan)[0]

    def fits(self, starts: Floats) -> Sequence[Fit]:
        method = f"start {{}} of {len(starts)}, {', '.join(self._names)}"
        cells = tuple(
            _keyed(self._job, StartCell(self._of, tuple(x.tolist()), method.format(i + 1)))
            for i, x in enumerate(starts)
        )
        return self._owner.finished(Plan(self._job, cells, open_bench, run_start, Fit))

    def sides(self, best: Fit, wanted: Sequence[tuple[int, int]], scale: float) -> Sequence[Side]:
        cells = tuple(
            _keyed(self._job, SideCell(self._of, best, i, sign, scale, self._words(i, sign)))
            for i, sign in wanted
        )
        return self._owner.finished(Plan(self._job, cells, open_bench, run_side, Side))

    def _words(self, i: int, sign: int) -> str:
        return f"profile of {self._names[i]}, {'upwards' if sign > 0 else 'downwards'}"


def _keyed(job: Job, cell: Any) -> Any:
    return replace(cell, key=key_of(job, replace(cell, label="")))


def beside(
    experiment: Experiment, options: Options, out: Path | None = None, report: Report | None = None
) -> Identify:
    """For the road: what stands open, by the cells that `validate identify` keeps."""
    return InCells(experiment, options, (), None, out, None, report)


def identification(
    experiment: str | Experiment,
    values: Mapping[str, str] | None = None,
    wanted: Sequence[str] = (),
    *,
    starts: int | None = None,
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> IdentifyStudy:
    """Runs what is not finished yet in `out`/<name>/study-identify/cells.

    Raises children of `ValidateError` for bad input, and where no start converges.
    """
    found = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    options = Options(dict(values or {}), (), quick)
    bench = IdentifyBench(found, options)
    cells = InCells(found, options, wanted, starts, out, where, report)
    calibrating, free = asked(bench.experiment, bench.parameters, wanted)
    done, failed = identified(
        calibrating, bench.parameters, bench.methods, bench.recordings, cells, free
    )
    return IdentifyStudy(calibrating, done, cells.done, quick, failed)
