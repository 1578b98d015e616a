"""One engine under all studies: cells that are not in the store run, and are kept as they finish.

A study plans its cells, says how a worker opens the experiment and runs a cell, and makes its page
of the records. Cells whose time is measured run one at a time with nothing else beside them.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any, Generic, Protocol, TypeVar

from validate.errors import UsageError, ValidateError
from validate.replay.experiment import Experiment
from validate.replay.find import load_file, root_of
from validate.replay.options import Report, folder_of
from validate.study.store import Record, read_records, write_record

CELLS = "cells"


class Keyed(Protocol):
    """A cell, small enough to be sent; `timed`: its times are what it is run for."""

    @property
    def key(self) -> str: ...
    @property
    def timed(self) -> bool: ...


C = TypeVar("C", bound=Keyed)
R = TypeVar("R")
Done = Callable[[Any, Record[Any]], None]


@dataclass(frozen=True)
class Where:
    """`workers` local processes (None: one a core, at most the cells; 0: in this process), or the
    address of a Dask scheduler that runs."""

    workers: int | None = None
    scheduler: str = ""


@dataclass(frozen=True)
class Job:
    """What all cells of a study share: the experiment's file, its hash and those of its recordings,
    values set, quick."""

    path: str
    sha256: str
    recordings: tuple[str, ...] = ()
    values: tuple[tuple[str, str], ...] = ()
    quick: bool = False

    def experiment(self) -> Experiment:
        """Raises `UsageError` when the file is not the one that the study began with."""
        path = Path(self.path)
        if file_sha256(path) != self.sha256:
            raise UsageError(
                f"{path.name} is not the file that the study began with; start it again"
            )
        return load_file(path)


def job_of(
    experiment: Experiment, values: Mapping[str, str] | None = None, quick: bool = False
) -> Job:
    """Raises what loading the experiment's recordings does."""
    folder, path = folder_of(experiment), Path(str(experiment.path))
    loaded = experiment.load(experiment.parameters, folder)
    hashes = tuple(r.source.sha256 for r in loaded)
    return Job(str(path), file_sha256(path), hashes, tuple(sorted((values or {}).items())), quick)


def file_sha256(path: Path) -> str:
    """Of an experiment's file and of those beside it that it names."""
    text = path.read_text(encoding="utf-8")
    beside = [f for f in sorted(path.parent.glob("*.py")) if f != path and f.stem in text]
    return hashlib.sha256(b"".join(f.read_bytes() for f in (path, *beside))).hexdigest()


@dataclass(frozen=True)
class Plan(Generic[C, R]):
    """`open(job)` makes what a worker keeps between cells, `run(bench, cell)` a value of `kind`.

    Both are functions of a module, so that they can be sent.
    """

    job: Job
    cells: tuple[C, ...]
    open: Callable[[Job], Any]
    run: Callable[[Any, C], R]
    kind: type[R]


@dataclass(frozen=True)
class Finished(Generic[R]):
    """All records by key; `reused` were there before, `seconds` is what the rest took, `workers`
    says where."""

    records: Mapping[str, Record[R]]
    reused: int
    seconds: float
    workers: str


def finish(
    plan: Plan[C, R], folder: Path, where: Where | None = None, report: Report | None = None
) -> Finished[R]:
    """Runs the cells that are not in `folder` yet, keeping each as it is finished.

    Raises `UsageError` when no scheduler answers, and what opening the experiment raises.
    """
    start, where = perf_counter(), where or Where()
    folder.mkdir(parents=True, exist_ok=True)
    records = read_records(folder, (c.key for c in plan.cells), plan.kind)
    reused = len(records)

    def done(cell: C, record: Record[R]) -> None:
        records[cell.key] = record
        if record.lasting:
            write_record(folder, cell, record)
        if report:
            report(len(records), len(plan.cells), "cells")

    left = [c for c in plan.cells if c.key not in records]
    if report:
        report(reused, len(plan.cells), "workers")
    said = _run(plan, left, where, done)
    return Finished(records, reused, perf_counter() - start, said)


def _run(plan: Plan[C, R], left: Sequence[C], where: Where, done: Done) -> str:
    """Side by side, then those that are timed one by one; on this machine, in this process."""
    beside, timed = [c for c in left if not c.timed], [c for c in left if c.timed]
    if where.workers is not None and where.workers < 0:
        raise UsageError(f"--workers {where.workers}: 0 (in this process) or more")
    if where.scheduler or (beside and where.workers != 0):
        from validate.study.cluster import run_beside, run_in_turn  # Dask takes a second

        said = run_beside(plan, beside, where, done) if beside else ""
        if where.scheduler:
            return run_in_turn(plan, timed, where, done) if timed else said
        _run_here(plan, timed, done)
        return said
    _run_here(plan, left, done)
    return "this process"


def _run_here(plan: Plan[C, R], cells: Sequence[C], done: Done) -> None:
    for cell in cells:
        done(cell, *run_batch(plan.open, plan.run, plan.job, (cell,)))


def run_batch(
    open_: Callable[[Job], Any], run: Callable[[Any, C], R], job: Job, cells: Sequence[C]
) -> list[Record[R]]:
    """On a worker: the records of some cells. Raises what opening the experiment raises."""
    bench = _opened(open_, job)
    return [_guarded(run, bench, cell) for cell in cells]


@lru_cache(maxsize=2)
def _opened(open_: Callable[[Job], Any], job: Job) -> Any:
    return open_(job)


def _guarded(run: Callable[[Any, C], R], bench: Any, cell: C) -> Record[R]:
    """One cell must not end a study of thousands: an error becomes a record with its line."""
    start = perf_counter()
    record: Record[R]
    try:
        record = Record(cell.key, run(bench, cell))
    except ValidateError as error:
        record = Record(cell.key, refused=" ".join(str(error).split()))
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        record = Record(cell.key, failed=" ".join(text.split()))
    return replace(record, seconds=perf_counter() - start)


def study_folder(experiment: Experiment, kind: str, out: Path | None) -> Path:
    """`out`/<name>/study-<kind>, by default in the reports/ of the experiment's clone."""
    reports = out or root_of(experiment, Path.cwd()) / "reports"
    return reports / experiment.name / f"study-{kind}"
