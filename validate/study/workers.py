"""Cells on Dask: a local cluster on loopback, or a scheduler that already runs."""

import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import dask
import distributed
from distributed.scheduler import KilledWorker

from validate.errors import UsageError
from validate.study.cell import run_cells
from validate.study.outcome import CellResult
from validate.study.plan import Cell, Job

TASK_S = 0.5  # s of work in one task: a kill loses so much, and Dask's 2 ms a task vanish in it
CONNECT_S = 10.0  # s until a scheduler counts as absent
_AHEAD = 2  # tasks a worker: one that runs and one that waits
# One thread each: two workers with two BLAS threads would only stand in each other's way.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_dask: Any = distributed  # its calls carry no annotations
Done = Callable[[Cell, CellResult], None]
T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Where:
    """`workers` local processes (None: one a core, at most the cells), or a scheduler's address."""

    workers: int | None = None
    scheduler: str = ""


def run_all(job: Job, cells: Sequence[Cell], where: Where, done: Done) -> None:
    """Calls `done` with every cell as it is finished, in no order.

    Raises `UsageError` when the scheduler cannot be reached, or what loading the experiment raises
    on a worker.
    """
    if not cells:
        return
    with _client(where, len(cells)) as client:
        _drain(client, job, list(cells), done)


def run_each(
    work: Callable[[T], R], items: Sequence[T], where: Where, done: Callable[[T, R], None]
) -> None:
    """Calls `done` with every item's result as it is finished: one task each, of about a second.

    Raises `UsageError` when no scheduler answers or a worker dies, or what `work` raises.
    """
    if not items:
        return
    with _client(where, len(items)) as client:
        sent = {client.submit(work, item, pure=False): item for item in items}
        for future in _dask.as_completed(list(sent)):
            if future.status == "error" and isinstance(future.exception(), KilledWorker):
                raise UsageError(f"a worker died on {sent[future]}: out of memory? fewer --workers")
            done(sent[future], future.result())


def cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _client(where: Where, cells: int) -> Iterator[Any]:
    if where.scheduler:
        try:
            client = _dask.Client(where.scheduler, timeout=CONNECT_S)
        except (OSError, ValueError) as error:
            raise UsageError(f"no scheduler at {where.scheduler}: {error}") from error
        with client:
            yield client
        return
    count = where.workers or min(cores(), cells)
    if count < 1:
        raise UsageError(f"--workers {count}: at least 1")
    settings = {
        "distributed.nanny.pre-spawn-environ": dict.fromkeys(_THREADS, "1"),
        "distributed.admin.system-monitor.gil.enabled": False,
    }
    with dask.config.set(settings):
        with _deaf_to_interrupts():
            cluster = _dask.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # None would take a fixed port
                silence_logs=logging.CRITICAL,
            )
        with cluster, _dask.Client(cluster) as client:
            yield client


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes started here leave Ctrl-C to their parent, which ends them in order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _drain(client: Any, job: Job, cells: list[Cell], done: Done) -> None:
    """Keeps every worker busy with tasks of about `TASK_S`, single cells at first."""
    waiting, sent, pool = list(reversed(cells)), dict[str, tuple[Cell, ...]](), _dask.as_completed()
    spent, finished = 0.0, 0

    def send(batch: tuple[Cell, ...]) -> None:
        future = client.submit(run_cells, job, batch, pure=False)
        sent[future.key] = batch
        pool.add(future)

    def refill() -> None:
        workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        size = max(1, int(TASK_S * finished / spent)) if spent > 0 else 1
        size = min(size, max(1, len(waiting) // (_AHEAD * workers)))
        while waiting and len(sent) < _AHEAD * workers:
            send(tuple(waiting.pop() for _ in range(min(size, len(waiting)))))

    refill()
    for future in pool:
        batch = sent.pop(future.key)
        for cell, result in zip(batch, _results(future, batch), strict=True):
            if result is None:
                send((cell,))
                continue
            spent, finished = spent + result.seconds, finished + 1
            done(cell, result)
        refill()


def _results(future: Any, batch: tuple[Cell, ...]) -> Sequence[CellResult | None]:
    """The batch's results; None for cells to be sent alone, as one of them kills its worker."""
    error = future.exception() if future.status == "error" else None
    if error is None:
        found: Sequence[CellResult] = future.result()
        return found
    if not isinstance(error, KilledWorker):
        raise error
    if len(batch) > 1:
        return [None] * len(batch)
    why = f"its worker died {error.allowed_failures + 1} times: out of memory?"
    return [CellResult(batch[0].key, failed=why, lasting=False)]
