"""Cells on Dask: a local cluster on loopback, or a scheduler that already runs."""

import logging
import signal
import tempfile
import threading
from asyncio import CancelledError
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import sleep
from typing import Any

import dask
import distributed
from distributed.client import FuturesCancelledError
from distributed.comm.core import CommClosedError
from distributed.scheduler import KilledWorker

from validate.child_process import isolating_environment
from validate.errors import UsageError, ValidateError
from validate.fem.threads import cores
from validate.study.code_identity import Identity, OtherCodeError, digest, require_same
from validate.study.job import C, Done, Plan, R, Where, prove, run_batch
from validate.study.store import Record

TASK_S = 0.5  # s of work in one task: a kill loses so much, and Dask's 2 ms a task vanish in it
CONNECT_S = 10.0  # s until a scheduler counts as absent
_MOMENT = 1.0  # s between looks at which workers are there
_REST = 0.2  # s, where no task is out
_DEATHS = 4  # of workers under one cell alone
_AHEAD = 2  # tasks a worker: one that runs and one that waits

_LOST = (CommClosedError, CancelledError, FuturesCancelledError)  # before the client knows it
LOG = logging.getLogger(__name__)
_dask: Any = distributed  # its calls carry no annotations


def run_beside(
    plan: Plan[C, R], cells: Sequence[C], where: Where, done: Done, here: Identity
) -> str:
    """Calls `done` with every cell as it is finished, in no order; returns where they ran.

    Only workers that prove the identity `here` of the code get cells; each other one is refused in
    a line. Raises `UsageError` when the scheduler cannot be reached or none is left, or what
    opening the experiment raises on a worker.
    """
    with _client(where, len(cells)) as client:
        _Drain(plan, client, cells, done, here, ahead=_AHEAD).run()
        return _named(where, client)


def run_in_turn(
    plan: Plan[C, R], cells: Sequence[C], where: Where, done: Done, here: Identity
) -> str:
    """One at a time, in order, on one worker as long as it lives: their times are measured."""
    with _client(where, len(cells)) as client:
        _Drain(plan, client, cells, done, here, ahead=0).run()
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
        with client, _silent(), _until_it_is_gone(client, where.scheduler):
            yield client
        return
    settings = {
        # In the workers only: numba rereads its own settings, and a process keeps to its first.
        "distributed.nanny.environ": {"NUMBA_NUM_THREADS": "1"},
        "distributed.admin.system-monitor.gil.enabled": False,
        "distributed.worker.profile.enabled": False,  # a thread that looks a hundred times a second
    }
    with (
        dask.config.set(settings),
        isolating_environment() as theirs,
        tempfile.TemporaryDirectory(prefix="validate-") as folder,
    ):
        with _deaf_to_interrupts():
            cluster = _dask.LocalCluster(
                n_workers=where.workers or min(cores(), cells),
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                local_directory=folder,
                env=theirs,
                dashboard_address="127.0.0.1:0",  # None would take a fixed port
                silence_logs=logging.CRITICAL,
            )
        with cluster, _dask.Client(cluster) as client:
            yield client


@contextmanager
def _until_it_is_gone(client: Any, address: str) -> Iterator[None]:
    """An error beside a scheduler that no longer answers is that, in a line."""
    try:
        yield
    except (Exception, CancelledError) as error:
        if client.status == "running" and not isinstance(error, _LOST):
            raise
        raise UsageError(
            f"the scheduler at {address} was lost ({type(error).__name__}); finished cells are "
            "kept; start a scheduler and run the same command again to continue"
        ) from error


@contextmanager
def _silent() -> Iterator[None]:
    """Without the log of a client that loses its scheduler."""
    log = logging.getLogger("distributed")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(level)


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


@dataclass(frozen=True)
class _Sent:
    """A task that is out: its cells, and the workers that it may run on."""

    future: Any
    batch: tuple[Any, ...]
    workers: frozenset[str]
    alone: bool


class _Drain:
    """Keeps every proven worker busy with tasks of about `TASK_S`, single cells at first.

    `ahead` tasks a worker; 0: one task in all. A task runs on workers that proved their code and
    nowhere else, so that one whose workers are gone is sent again from here.
    """

    def __init__(
        self, plan: Plan[C, R], client: Any, cells: Sequence[C], done: Done, here: Identity,
        ahead: int,
    ) -> None:  # fmt: skip
        self._plan, self._client, self._done, self._ahead = plan, client, done, ahead
        self._here, self._code = here, digest(here)
        self._waiting: list[tuple[Any, ...]] = [(cell,) for cell in reversed(cells)]
        self._sent: list[_Sent] = []
        self._spent, self._finished = 0.0, 0
        self._proven: set[str] = set()
        self._refused: set[str] = set()
        self._deaths: Counter[str] = Counter()

    def run(self) -> None:
        while self._waiting or self._sent:
            self._refill()
            self._wait([one.future for one in self._sent])
            there = frozenset(self._there())
            for one in tuple(self._sent):
                if one.future.status == "error" or one.workers & there:
                    if one.future.status in ("finished", "error") and self._collect(one):
                        self._sent.remove(one)
                else:  # also where it was finished: its result is gone with its workers
                    self._sent.remove(one)
                    one.future.cancel()
                    self._bury(one)

    def _wait(self, futures: list[Any]) -> None:
        """Until one of them ends, or a moment, after which who is there is looked at again.

        Workers that start anew need the processor: without futures nothing is asked meanwhile.
        """
        if not futures:
            sleep(_REST)
            return
        try:
            _dask.wait(futures, timeout=_MOMENT, return_when="FIRST_COMPLETED")
        except TimeoutError:
            return

    def _refill(self) -> None:
        workers = self._workers() if self._waiting else []
        most = max(1, self._ahead * len(workers))
        size = self._size(most)
        while workers and self._waiting and len(self._sent) < most:
            suspect = self._waiting[-1][0].key in self._deaths
            if suspect and self._sent:
                return  # it runs alone, so that its death is no other cell's
            batch = self._waiting.pop()
            while len(batch) < size and self._waiting and not self._deaths:
                batch += self._waiting.pop()
            self._send(batch, workers, alone=suspect)
            if suspect:
                return

    def _there(self) -> list[str]:
        return sorted(self._client.scheduler_info(n_workers=-1)["workers"])

    def _workers(self) -> list[str]:
        """Workers that proved their code, new ones asked for it; raises `UsageError` where all are
        refused."""
        there = self._there()
        for worker in there:
            if worker not in self._proven | self._refused:
                self._ask(worker)
        trusted = [worker for worker in there if worker in self._proven]
        if there and not trusted and self._refused.issuperset(there):
            raise UsageError(
                f"all {len(there)} workers are refused; install the same version of validate "
                "on them as in the study"
            )
        return trusted

    def _ask(self, worker: str) -> None:
        """Has a worker prove its code, in a task of its own; one that goes away did not."""
        asked = self._client.submit(
            prove, self._plan.open, self._plan.job, self._here, pure=False, workers=[worker],
            allow_other_workers=False,
        )  # fmt: skip
        while asked.status == "pending":
            self._wait([asked])
            if worker not in self._there():
                asked.cancel()
                return
        error = asked.exception() if asked.status == "error" else None
        if isinstance(error, ValidateError):
            raise error  # of the experiment: any worker's
        if asked.status == "cancelled":
            return
        try:
            there = asked.result(timeout=_MOMENT) if error is None else {}
            require_same(self._here, there, f"worker {worker}")
        except OtherCodeError as other:
            self._refused.add(worker)
            LOG.warning(str(other))
            return
        except TimeoutError:  # gone since: asked again where it comes back
            return
        self._proven.add(worker)

    def _size(self, most: int) -> int:
        if not (self._ahead and self._spent):
            return 1
        size = int(TASK_S * self._finished / self._spent)
        return max(1, min(size, len(self._waiting) // most))

    def _send(self, batch: tuple[Any, ...], workers: Sequence[str], *, alone: bool) -> None:
        """In turn: on the first worker while it is there, so that one machine measures all."""
        on = list(workers if self._ahead else workers[:1])
        future = self._client.submit(
            run_batch, self._plan.open, self._plan.run, self._plan.job, batch, pure=False,
            workers=on, allow_other_workers=False,
        )  # fmt: skip
        self._sent.append(_Sent(future, batch, frozenset(on), alone))

    def _collect(self, one: _Sent) -> bool:
        """Takes the records that proven code made; others are asked for again, of all workers.
        False where they do not come: their worker may be gone."""
        error = one.future.exception() if one.future.status == "error" else None
        if isinstance(error, KilledWorker):
            self._bury(one)
            return True
        if error is not None:
            raise error
        try:
            records = one.future.result(timeout=_MOMENT)
        except TimeoutError:
            return False
        for cell, record in zip(one.batch, records, strict=True):
            if record.code != self._code:
                self._proven.clear()
                self._waiting.append((cell,))
                continue
            self._spent, self._finished = self._spent + record.seconds, self._finished + 1
            self._done(cell, record)
        return True

    def _bury(self, one: "_Sent") -> None:
        """The workers of a batch died: its cells are sent again, each alone, and one under which
        workers die `_DEATHS` times is a failure."""
        for cell in one.batch:
            self._deaths[cell.key] += one.alone
            if self._deaths[cell.key] < _DEATHS:
                self._waiting.append((cell,))
                continue
            why = f"its worker process died {_DEATHS} times: out of memory?"
            self._done(cell, Record(cell.key, failed=why, lasting=False))
