"""Types of the engine: cells, plans and records."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from time import perf_counter
from typing import Any, Generic, Protocol, TypeVar

from validate.engine.identity import Identity, digest, proven_installation
from validate.errors import ValidateError
from validate.memory import imports_stay


class Keyed(Protocol):
    """A cell, small enough to be sent; `timed`: its times are what it is run for, `label` what it
    runs, in a few words."""

    @property
    def key(self) -> str: ...
    @property
    def label(self) -> str: ...
    @property
    def timed(self) -> bool: ...


class CellJob(Protocol):
    """What all cells of a plan share; equal and hashable by content, so that a worker opens it
    once."""

    def identity(self) -> Identity:
        """Of the code that computes the cells in the process that asks."""
        ...


C = TypeVar("C", bound=Keyed)
R = TypeVar("R")


@dataclass(frozen=True)
class Record(Generic[R]):
    """What a cell gave: its `value`, or why there is none.

    `refused` is a known error's line, `error` its class, `failed` a bug's or a dead worker's.
    `seconds` is what the whole cell took. `lasting` is False for a failure that another try may not
    have. `code` is the hash of the code that made it, as its worker proved it.
    """

    key: str
    value: R | None = None
    refused: str = ""
    failed: str = ""
    seconds: float = 0.0
    lasting: bool = True
    code: str = ""
    error: str = ""

    @property
    def why(self) -> str:
        """Why there is no value; "" where there is one."""
        return self.refused or self.failed


Done = Callable[[Any, Record[Any]], None]


def _always(cell: Any, value: Any) -> bool:
    return True


@dataclass(frozen=True)
class Plan(Generic[C, R]):
    """`open(job)` makes what a process keeps between cells, `run(bench, cell)` a value of `kind`.

    Both are functions of a module, so that they can be sent. `bench` is what `open` would make,
    where this process has it already. `enough(cell, value)`: whether a stored value says all that
    is asked of the cell. `shares`: this process computes until workers have started, with at
    most `beside` cells at once while one of them is timed. `after`: so many cells will follow in
    other plans, for which workers may start now.
    """

    job: Any
    cells: tuple[C, ...]
    open: Callable[[Any], Any]
    run: Callable[[Any, C], R]
    kind: type[R]
    bench: Any = None
    enough: Callable[[Any, Any], bool] = _always
    shares: bool = False
    beside: int = 1
    after: int = 0


@dataclass(frozen=True)
class Where:
    """`workers` local processes (None: one an idle core, at most the cells; 0: in this process), or
    the address of a Dask scheduler that runs."""

    workers: int | None = None
    scheduler: str = ""


def run_batch(
    open_: Callable[[Any], Any], run: Callable[[Any, C], R], job: Any, cells: Sequence[C]
) -> list[Record[R]]:
    """On a worker: the records of some cells, each with the hash of the code that made it. Raises
    what opening the job raises."""
    bench = opened(open_, job)
    return [recorded(run, bench, cell, digest(_identity(job))) for cell in cells]


def recorded(run: Callable[[Any, C], R], bench: Any, cell: C, code: str) -> Record[R]:
    """One cell must not end a study of thousands: an error becomes a record with its line."""
    start = perf_counter()
    record: Record[R]
    try:
        record = Record(cell.key, run(bench, cell))
    except ValidateError as error:
        record = Record(cell.key, refused=str(error), error=type(error).__name__)
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        record = Record(cell.key, failed=" ".join(text.split()))
    return replace(record, seconds=perf_counter() - start, code=code)


def prove(open_: Callable[[Any], Any], job: Any, here: Identity) -> Identity:
    """On a worker: its identity; the job is opened only where the installation is `here`'s. Raises
    what opening the job raises."""
    imports_stay()
    mine = proven_installation()
    if any(here[name] != mine[name] for name in mine):
        return mine
    opened(open_, job)
    return _identity(job)


@lru_cache(maxsize=2)
def _identity(job: Any) -> Identity:
    """Of the code that is loaded, so that a file that is edited meanwhile changes nothing."""
    found: Identity = job.identity()
    return found


@lru_cache(maxsize=2)
def opened(open_: Callable[[Any], Any], job: Any) -> Any:
    """What a process keeps between the cells of a job."""
    return open_(job)
