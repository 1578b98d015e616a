"""Identification of an experiment's parameters: starts and profiles in parallel, stored at once.

from validate.study.identify.study import identification
found = identification("silicone_beam", wanted=("material.E=1e5:1e6",))
for one in found.calibrated:
    print(one.found.estimates)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from validate.arrays import Floats
from validate.engine.cell import C, Plan, R, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.engine.pool import Pool
from validate.engine.store import key_of
from validate.errors import ComparisonError
from validate.identify.identification import Identification, identify
from validate.identify.least_squares import Fit, Space
from validate.identify.profile import Side
from validate.pipeline.calibration.calibrated import Identify, identified
from validate.pipeline.calibration.free_parameters import asked
from validate.pipeline.calibration.problem import Calibrated, Problem
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.job import Job, file_sha256
from validate.pipeline.run.named_run import study_folder
from validate.study.identify.cell import (
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

KIND = "identify"
STARTS, QUICK_STARTS = 10, 4
STARTS_OF_ONE = 5  # of a single parameter: every fifth of its range has one
SEED = 1


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
    """Evaluates fits and profiles as the cells of a study; counts them. `after`: so many runs will
    follow."""

    def __init__(
        self, experiment: Experiment, options: Options, wanted: Sequence[str], starts: int | None,
        out: Path | None, where: Where | Pool | None, report: Report | None, after: int = 0,
    ) -> None:  # fmt: skip
        self._path, self._options = Path(str(experiment.path)), options
        self._wanted, self._starts = tuple(wanted), starts
        self._folder = study_folder(experiment, KIND, out) / CELLS
        self._where, self._report, self._after = where, report, after
        self._known: Known = ()
        self.done: Finished[Any] = Finished({}, 0, 0.0, "")

    def __call__(self, number: int, problem: Problem) -> Identification:
        """As `validate.pipeline.calibration.calibrated.Identify`."""
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
        """Return the cells' values in order."""
        found = finish(
            replace(plan, shares=True, after=self._after), self._folder, self._where, self._report
        )
        new = {k: r for k, r in found.records.items() if k not in self.done.records}
        reused = max(0, found.reused - (len(found.records) - len(new)))
        own: Finished[Any] = Finished(new, reused, found.seconds, found.workers)
        self.done = own.and_also(self.done) if new else self.done.and_also(own)
        return [_value(found, cell) for cell in plan.cells]


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
        cells = []
        for i, sign in wanted:
            label = f"profile of {self._names[i]}, {'upwards' if sign > 0 else 'downwards'}"
            cells.append(_keyed(self._job, SideCell(self._of, best, i, sign, scale, label)))
        return self._owner.finished(Plan(self._job, tuple(cells), open_bench, run_side, Side))


def _keyed(job: Job, cell: Any) -> Any:
    return replace(cell, key=key_of(job, replace(cell, label="")))


def beside(
    experiment: Experiment,
    options: Options,
    out: Path | None = None,
    report: Report | None = None,
    where: Where | Pool | None = None,
) -> Identify:
    """For the pipeline: what stands open, by the cells that `validate identify` keeps."""
    return InCells(experiment, options, (), None, out, where, report, after=len(experiment.methods))


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
    """Run what is not finished yet in `out`/<name>/study-identify/cells.

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
