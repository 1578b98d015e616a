"""Cells on Dask: a local cluster on loopback, or an existing scheduler."""

import logging
import os
import tempfile
from asyncio import CancelledError
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from time import sleep
from typing import Any

import dask
import distributed
from distributed.client import FuturesCancelledError
from distributed.comm.core import CommClosedError
from distributed.scheduler import KilledWorker

from validate.child_process import users_variables
from validate.engine.cell import Done, Plan, Record, Where, prove, run_batch
from validate.engine.identity import Identity, OtherCodeError, digest, require_same
from validate.engine.queue import Batch, Queue
from validate.errors import UsageError, ValidateError

TASK_S = 0.5  # s of work in one task: a kill loses so much, and Dask's 2 ms a task vanish in it
CONNECT_S = 10.0  # s until a scheduler counts as absent
_MOMENT = 1.0  # s between looks at which workers are there
_REST = 0.2  # s, where no task is out
_DEATHS = 4  # of workers under one cell alone
AHEAD = 2  # tasks a worker: one that runs and one that waits

_LEFT_BEHIND = {"PYTHONHASHSEED", "__DASK_PARENT_PID"}  # by Dask in this process's variables
_LOST = (CommClosedError, CancelledError, FuturesCancelledError)  # before the client knows it
LOG = logging.getLogger(__name__)
_dask: Any = distributed  # its calls carry no annotations


@contextmanager
def connected(where: Where, count: int) -> Iterator[Any]:
    """A client of so many local workers, or of the scheduler that runs.

    It may be left by another thread than the one that entered it. Raises `UsageError` when the
    scheduler cannot be reached.
    """
    with ExitStack() as stack:
        try:
            to = where.scheduler or stack.enter_context(_local_cluster(count))
        except RuntimeError as error:
            raise UsageError(
                f"{count} workers did not start ({error}); run with --workers 1, or, in a script, "
                'start the run below `if __name__ == "__main__":`'
            ) from error
        try:
            client = _dask.Client(to, timeout=CONNECT_S)
        except (OSError, ValueError) as error:
            raise UsageError(f"no scheduler at {to}: {error}") from error
        stack.callback(client.close)
        yield client


@contextmanager
def _local_cluster(count: int) -> Iterator[Any]:
    settings = {
        "distributed.worker.multiprocessing-method": "forkserver",  # of `engine.pool`
        "distributed.nanny.pre-spawn-environ": {},  # would be this process's own, and stay so
        "distributed.admin.system-monitor.gil.enabled": False,
        "distributed.admin.tick.interval": "1s",  # each of five event loops looks at the clock
        "distributed.worker.memory.monitor-interval": "1s",
        "distributed.scheduler.worker-saturation": 1.0,  # none waits behind a long one
        "distributed.worker.profile.enabled": False,  # a thread that looks a hundred times a second
    }
    before = set(os.environ)
    with (
        dask.config.set(settings),
        tempfile.TemporaryDirectory(prefix="validate-") as folder,
        _dask.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            local_directory=folder,
            env=users_variables(),
            dashboard_address="127.0.0.1:0",  # None would take a fixed port
            silence_logs=logging.CRITICAL,
        ) as cluster,
    ):
        for name in _LEFT_BEHIND - before:
            os.environ.pop(name, None)
        yield cluster


def side_by_side(
    client: Any, function: Callable[[Any, Any], Any], shared: Any, items: Iterable[Any]
) -> Callable[[], list[Any]]:
    """Begin `function(shared, item)` of every item on all workers, each as soon as one is free."""
    (there,) = client.scatter([shared], broadcast=True, hash=False)  # a tuple would be divided
    sent = [(client.submit(function, there, item, pure=False, retries=0), item) for item in items]

    def finished() -> list[Any]:
        values = []
        for future, item in sent:
            try:
                values.append(future.result())
            except (KilledWorker, *_LOST):
                values.append(function(shared, item))
        return values

    return finished


@contextmanager
def until_it_is_gone(client: Any, address: str) -> Iterator[None]:
    """An error beside a scheduler that no longer answers is that, in a line, without the log of a
    client that loses it. Local workers ("") answer to this process alone."""
    log = logging.getLogger("distributed")
    level = log.level
    try:
        log.setLevel(logging.CRITICAL if address else level)
        yield
    except (Exception, CancelledError) as error:
        if not address or (client.status == "running" and not isinstance(error, _LOST)):
            raise
        raise UsageError(
            f"the scheduler at {address} was lost ({type(error).__name__}); finished cells are "
            "kept; start a scheduler and run the same command again to continue"
        ) from error
    finally:
        log.setLevel(level)


@dataclass(frozen=True)
class _Sent:
    """A task that is out: its cells, and the workers that it may run on."""

    future: Any
    batch: Batch
    workers: frozenset[str]
    alone: bool


class Drain:
    """Keeps every proven worker busy with tasks of about `TASK_S`, single cells at first.

    Calls `done` with every cell as it is finished, in no order. Only workers that prove the
    identity `here` of the code get cells; each other one is refused in a line. `ahead` tasks a
    worker; 0: one task in all, on one worker as long as it lives. A task runs on workers that
    proved their code and nowhere else, so that one whose workers are gone is sent again from here.
    """

    def __init__(
        self, plan: Plan[Any, Any], client: Any, done: Done, here: Identity, ahead: int = AHEAD
    ) -> None:
        self._plan, self._client, self._done, self._ahead = plan, client, done, ahead
        self._here, self._code = here, digest(here)
        self._sent: list[_Sent] = []
        self._spent, self._finished = 0.0, 0
        self._proven: set[str] = set()
        self._refused: set[str] = set()
        self._deaths: Counter[str] = Counter()

    def run(self, queue: Queue) -> None:
        """Until the queue is empty.

        Raises `UsageError` when no worker is left, or what opening the job raises on a worker.
        """
        while len(queue) or self._sent:
            self._refill(queue)
            self._wait([one.future for one in self._sent])
            there = frozenset(self._there())
            for one in tuple(self._sent):
                if one.future.status == "error" or one.workers & there:
                    if one.future.status in ("finished", "error") and self._collect(one, queue):
                        self._end(one, queue)
                else:  # also where it was finished: its result is gone with its workers
                    one.future.cancel()
                    self._bury(one, queue)
                    self._end(one, queue)

    def _end(self, one: _Sent, queue: Queue) -> None:
        self._sent.remove(one)
        queue.ended(one.batch)

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

    def _refill(self, queue: Queue) -> None:
        if not len(queue):
            return
        # Workers that proved their code; new ones are asked for it
        there = self._there()
        for worker in there:
            if worker not in self._proven | self._refused:
                self._ask(worker)
        workers = [worker for worker in there if worker in self._proven]
        if there and not workers and self._refused.issuperset(there):
            raise UsageError(
                f"all {len(there)} workers are refused; install the same version of validate "
                "on them as in the study"
            )
        most = max(1, self._ahead * len(workers))
        size = self._size(len(queue), most)
        while workers and len(self._sent) < most:
            first = queue.first
            suspect = first is not None and first.key in self._deaths
            if suspect and self._sent:
                return  # it runs alone, so that its death is no other cell's
            batch = queue.take(1 if self._deaths else size)
            if not batch:
                return
            # In turn: on the first worker while it is there, so that one machine measures all
            on = list(workers if self._ahead else workers[:1])
            future = self._client.submit(
                run_batch, self._plan.open, self._plan.run, self._plan.job, batch, pure=False,
                workers=on, allow_other_workers=False,
            )  # fmt: skip
            self._sent.append(_Sent(future, batch, frozenset(on), suspect))
            if suspect:
                return

    def _there(self) -> list[str]:
        return sorted(self._client.scheduler_info(n_workers=-1)["workers"])

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

    def _size(self, waiting: int, most: int) -> int:
        if not (self._ahead and self._spent):
            return 1
        size = int(TASK_S * self._finished / self._spent)
        return max(1, min(size, waiting // most))

    def _collect(self, one: _Sent, queue: Queue) -> bool:
        """Takes the records that proven code made; others are asked for again, of all workers.
        False where they do not come: their worker may be gone."""
        error = one.future.exception() if one.future.status == "error" else None
        if isinstance(error, KilledWorker):
            self._bury(one, queue)
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
                queue.again(cell)
                continue
            self._spent, self._finished = self._spent + record.seconds, self._finished + 1
            self._done(cell, record)
        return True

    def _bury(self, one: _Sent, queue: Queue) -> None:
        """The workers of a batch died: its cells are sent again, each alone, and one under which
        workers die `_DEATHS` times is a failure."""
        for cell in one.batch:
            self._deaths[cell.key] += one.alone
            if self._deaths[cell.key] < _DEATHS:
                queue.again(cell)
                continue
            why = f"its worker process died {_DEATHS} times: out of memory?"
            self._done(cell, Record(cell.key, failed=why, lasting=False))
