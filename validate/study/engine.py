"""One engine under all studies: cells that are not in the store run, and are kept as they finish.

A study plans its cells, says how a worker opens the experiment and runs a cell, and makes its page
of the records. Cells whose time is measured run one at a time with nothing else beside them.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Generic

from validate.errors import UsageError
from validate.places import try_folder
from validate.replay.experiment import Experiment
from validate.replay.named_run import reports_of
from validate.replay.options import Report
from validate.report.folder import CELLS as CELLS
from validate.solve.march import Tell
from validate.study.code_identity import Identity, digest, identity_of
from validate.study.job import C, Done, Plan, R, Where, run_batch
from validate.study.store import Record, read_records, write_record

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Finished(Generic[R]):
    """All records by key; `reused` were there before, `seconds` is what the rest took, `workers`
    says where."""

    records: Mapping[str, Record[R]]
    reused: int
    seconds: float
    workers: str

    def and_also(self, more: "Finished[R]") -> "Finished[R]":
        """Both, the workers of the first."""
        records = {**self.records, **more.records}
        reused, seconds = self.reused + more.reused, self.seconds + more.seconds
        return Finished(records, reused, seconds, self.workers or more.workers)


def finish(
    plan: Plan[C, R], folder: Path, where: Where | None = None, report: Report | None = None
) -> Finished[R]:
    """Runs the cells that are not in `folder` yet, keeping each as it is finished.

    Raises `UsageError` when no scheduler answers, and what opening the experiment raises.
    """
    start, where = perf_counter(), where or Where()
    try_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    here = identity_of(Path(plan.job.path))
    found = read_records(folder, (c.key for c in plan.cells), plan.kind, digest(here))
    records, reused = found.records, len(found.records)
    for line in found.doubts:
        LOG.warning(line)

    def done(cell: C, record: Record[R]) -> None:
        records[cell.key] = record
        if record.lasting:
            write_record(folder, cell, record)
        tell(f"{cell.label} is done")

    def tell(what: str) -> None:
        done, total = len(records), len(plan.cells)
        if report:
            report(done, total, f"{done} of {total} cells; {what}")

    left = [c for c in plan.cells if c.key not in records]
    tell("starts the workers" if left else "all cells were already finished")
    said = _run(plan, left, where, done, tell, here)
    return Finished(records, reused, perf_counter() - start, said)


def _run(
    plan: Plan[C, R], left: Sequence[C], where: Where, done: Done, tell: Tell, here: Identity
) -> str:
    """Side by side, then those that are timed one by one; on this machine, in this process."""
    beside, timed = [c for c in left if not c.timed], [c for c in left if c.timed]
    if where.workers is not None and where.workers < 0:
        raise UsageError(f"--workers {where.workers}: expected 0 (in this process) or more")
    if where.scheduler or (beside and where.workers != 0):
        from validate.study.cluster import run_beside, run_in_turn  # Dask takes a second

        said = run_beside(plan, beside, where, done, here) if beside else ""
        if where.scheduler:
            return run_in_turn(plan, timed, where, done, here) if timed else said
        _run_here(plan, timed, done, tell)
        return said
    _run_here(plan, left, done, tell)
    return "this process"


def _run_here(plan: Plan[C, R], cells: Sequence[C], done: Done, tell: Tell) -> None:
    for cell in cells:
        tell(cell.label)
        done(cell, *run_batch(plan.open, plan.run, plan.job, (cell,)))


def study_folder(experiment: Experiment, kind: str, out: Path | None) -> Path:
    """`out`/<name>/study-<kind>, by default in the reports/ of the experiment's clone."""
    return reports_of(experiment.path, out) / experiment.name / f"study-{kind}"
