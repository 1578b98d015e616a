"""Cells on Dask: a local cluster on loopback, or a scheduler that already runs."""

import logging
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import dask
import distributed
from distributed.scheduler import KilledWorker

from validate.errors import UsageError
from validate.fem.threads import cores
from validate.study.job import C, Done, Plan, R, Where, run_batch
from validate.study.store import Record

TASK_S = 0.5  # s of work in one task: a kill loses so much, and Dask's 2 ms a task vanish in it
CONNECT_S = 10.0  # s until a scheduler counts as absent
_AHEAD = 2  # tasks a worker: one that runs and one that waits
# One thread each: two workers with two BLAS threads would only stand in each other's way.
_BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_dask: Any = distributed  # its calls carry no annotations


def run_beside(plan: Plan[C, R], cells: Sequence[C], where: Where, done: Done) -> str:
    """Calls `done` with every cell as it is finished, in no order; returns where they ran.

    Raises `UsageError` when the scheduler cannot be reached, or what opening the experiment raises
    on a worker.
    """
    with _client(where, len(cells)) as client:
        _Drain(plan, client, cells, done, ahead=_AHEAD).run()
        return _named(where, client)


def run_in_turn(plan: Plan[C, R], cells: Sequence[C], where: Where, done: Done) -> str:
    """One at a time, in order, on one worker as long as it lives: their times are measured."""
    with _client(where, len(cells)) as client:
        _Drain(plan, client, cells, done, ahead=0).run()
        return _named(where, client)


def _named(where: Where, client: Any) -> str:
    if where.scheduler:
        return f"Dask at {where.scheduler}"
    return f"{len(client.scheduler_info(n_workers=-1)['workers'])} local"


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
    settings = {
        "distributed.nanny.pre-spawn-environ": dict.fromkeys(_BLAS_THREADS, "1"),
        # In the workers only: numba rereads its own settings, and a process keeps to its first.
        "distributed.nanny.environ": {"NUMBA_NUM_THREADS": "1"},
        "distributed.admin.system-monitor.gil.enabled": False,
        "distributed.worker.profile.enabled": False,  # a thread that looks a hundred times a second
    }
    with dask.config.set(settings):
        with _deaf_to_interrupts():
            cluster = _dask.LocalCluster(
                n_workers=where.workers or min(cores(), cells),
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


class _Drain:
    """Keeps every worker busy with tasks of about `TASK_S`, single cells at first.

    `ahead` tasks a worker; 0: one task in all.
    """

    def __init__(
        self, plan: Plan[C, R], client: Any, cells: Sequence[C], done: Done, ahead: int
    ) -> None:
        self._plan, self._client, self._done, self._ahead = plan, client, done, ahead
        self._waiting: list[Any] = list(reversed(cells))
        self._sent: dict[str, tuple[Any, ...]] = {}
        self._pool = _dask.as_completed()
        self._spent, self._finished = 0.0, 0

    def run(self) -> None:
        self._refill()
        for future in self._pool:
            self._collect(future)
            self._refill()

    def _refill(self) -> None:
        workers = list(self._client.scheduler_info(n_workers=-1)["workers"])
        most = max(1, self._ahead * len(workers))
        size = self._size(most)
        while self._waiting and len(self._sent) < most:
            batch = tuple(self._waiting.pop() for _ in range(min(size, len(self._waiting))))
            self._send(batch, workers)

    def _size(self, most: int) -> int:
        if not (self._ahead and self._spent):
            return 1
        size = int(TASK_S * self._finished / self._spent)
        return max(1, min(size, len(self._waiting) // most))

    def _send(self, batch: tuple[Any, ...], workers: Sequence[str] = ()) -> None:
        """In turn: on the first worker while it is there, so that one machine measures all."""
        pinned = {"workers": sorted(workers)[:1], "allow_other_workers": True}
        future = self._client.submit(
            run_batch, self._plan.open, self._plan.run, self._plan.job, batch, pure=False,
            **({} if self._ahead or not workers else pinned),
        )  # fmt: skip
        self._sent[future.key] = batch
        self._pool.add(future)

    def _collect(self, future: Any) -> None:
        batch = self._sent.pop(future.key)
        for cell, record in zip(batch, _records(future, batch), strict=True):
            if record is None:
                self._send((cell,))
                continue
            self._spent, self._finished = self._spent + record.seconds, self._finished + 1
            self._done(cell, record)


def _records(future: Any, batch: tuple[Any, ...]) -> Sequence[Record[Any] | None]:
    """The batch's records; None for cells to be sent alone, as one of them kills its worker."""
    error = future.exception() if future.status == "error" else None
    if error is None:
        found: Sequence[Record[Any]] = future.result()
        return found
    if not isinstance(error, KilledWorker):
        raise error
    if len(batch) > 1:
        return [None] * len(batch)
    why = f"its worker died {error.allowed_failures + 1} times: out of memory?"
    return [Record(batch[0].key, failed=why, lasting=False)]
