"""What all cells of a study share, and what a worker does with some of them."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any, Generic, Protocol, TypeVar

from validate.errors import UsageError, ValidateError
from validate.replay.declaration import from_json, holds_code, to_json
from validate.replay.experiment import Experiment
from validate.replay.find import load_file, sources_of
from validate.replay.options import folder_of
from validate.study.code_identity import Identity, digest, identity_of, proven_installation
from validate.study.store import Record


class Keyed(Protocol):
    """A cell, small enough to be sent; `timed`: its times are what it is run for, `label` what it
    runs, in a few words."""

    @property
    def key(self) -> str: ...
    @property
    def label(self) -> str: ...
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
    values set, quick, command lines of guests.

    A `declaration` without code is all that a worker needs: it executes no file. The hash is then
    that of the declaration.
    """

    path: str
    sha256: str
    recordings: tuple[str, ...] = ()
    values: tuple[tuple[str, str], ...] = ()
    quick: bool = False
    guests: tuple[str, ...] = ()
    declaration: str = ""

    def experiment(self) -> Experiment:
        """Raises `UsageError` when the file is not the one that the study began with."""
        path = Path(self.path)
        if self.declaration:
            return from_json(self.declaration, path)
        if file_sha256(path) != self.sha256:
            raise UsageError(
                f"{path.name} has changed since the study started; start the study again"
            )
        return load_file(path)


def job_of(
    experiment: Experiment, values: Mapping[str, str] | None = None, quick: bool = False
) -> Job:
    """Raises what loading the experiment's recordings does."""
    folder, path = folder_of(experiment), Path(str(experiment.path))
    loaded = experiment.load(experiment.parameters, folder)
    hashes = tuple(r.source.sha256 for r in loaded)
    set_ = tuple(sorted((values or {}).items()))
    text = to_json(experiment)
    if holds_code(text):
        return Job(str(path), file_sha256(path), hashes, set_, quick)
    digest_ = hashlib.sha256(text.encode()).hexdigest()
    return Job(str(path), digest_, hashes, set_, quick, declaration=text)


def file_sha256(path: Path) -> str:
    """Of an experiment's file and of those beside it that it names."""
    return hashlib.sha256(b"".join(f.read_bytes() for f in sources_of(path))).hexdigest()


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


def run_batch(
    open_: Callable[[Job], Any], run: Callable[[Any, C], R], job: Job, cells: Sequence[C]
) -> list[Record[R]]:
    """On a worker: the records of some cells, each with the hash of the code that made it. Raises
    what opening the experiment raises."""
    bench = _opened(open_, job)
    code = digest(_identity(job))
    return [replace(_guarded(run, bench, cell), code=code) for cell in cells]


def prove(open_: Callable[[Job], Any], job: Job, here: Identity) -> Identity:
    """On a worker: its identity; the experiment is opened only where the installation is `here`'s.
    Raises what opening the experiment raises."""
    mine = proven_installation()
    if any(here[name] != mine[name] for name in mine):
        return mine
    _opened(open_, job)
    return _identity(job)


@lru_cache(maxsize=2)
def _identity(job: Job) -> Identity:
    """Of the code that is loaded, so that a file that is edited meanwhile changes nothing."""
    return identity_of(Path(job.path))


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
