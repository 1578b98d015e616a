"""Execution of cells: compute those that are not stored, and store each at once.

Whoever plans cells says how a worker opens the job and runs a cell, and reads the records. Cells
whose time is measured run with little or nothing beside them.
"""

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from time import perf_counter, sleep
from typing import Any, Generic, TypeVar

import numpy as np

from validate.engine.cell import C, Done, Plan, R, Record, Where, opened, recorded
from validate.engine.identity import Identity, digest
from validate.engine.pool import Pool
from validate.engine.queue import Queue
from validate.engine.store import read_records, write_record
from validate.places import try_folder

CELLS = "cells"  # folder of the records
LOG = logging.getLogger(__name__)
_LOOK = 0.02  # s between looks for a cell that may start
_PATIENCE = 0.25  # s until it is asked whether workers are worth their start
_WORTH = 4.0  # s of work: less is done here, for workers take as long to begin

Report = Callable[[int, int, str], None]  # done, total, what comes next
Tell = Callable[[str], None]


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
    plan: Plan[C, R],
    folder: Path,
    where: Where | Pool | None = None,
    report: Report | None = None,
    done: Done | None = None,
) -> Finished[R]:
    """Compute the cells that are not in `folder` yet, keeping each as it is finished; `done` is
    told of each, too.

    A `Pool` is left open for the next plan. Raises `UsageError` when no scheduler answers, and what
    opening the job raises.
    """
    start = perf_counter()
    try_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    here = plan.job.identity()
    found = read_records(folder, (c.key for c in plan.cells), plan.kind, digest(here))
    records = {}
    for c in plan.cells:
        record = found.records.get(c.key)
        if record and (record.value is None or plan.enough(c, record.value)):
            records[c.key] = record
    reused = len(records)
    for line in found.doubts:
        LOG.warning(line)
    lock = threading.Lock()

    def kept(cell: C, record: Record[R]) -> None:
        with lock:
            records[cell.key] = record
            if record.lasting:
                write_record(folder, cell, record)
            if done:
                done(cell, record)
            tell(f"{cell.label} is done")

    def tell(what: str) -> None:
        count, total = len(records), len(plan.cells)
        if report:
            report(count, total, f"{count} of {total} cells; {what}")

    left = [c for c in plan.cells if c.key not in records]
    tell("starts the workers" if left else "all cells were already finished")
    if isinstance(where, Pool):
        said = _run(plan, left, where, kept, tell, here)
    else:
        with Pool(where or Where(), (plan.run.__module__,), shares=plan.shares) as pool:
            said = _run(plan, left, pool, kept, tell, here)
    return Finished(records, reused, perf_counter() - start, said)


def _run(
    plan: Plan[C, R], left: list[C], pool: Pool, done: Done, tell: Tell, here: Identity
) -> str:
    """Where they ran: on workers what runs side by side, then one by one what is timed alone."""
    own = _Here(plan, done, tell, here)
    beside, timed = [c for c in left if not c.timed], [c for c in left if c.timed]
    if not pool.used or not (len(left) > 1 if plan.shares else beside or pool.address):
        own.run(left)
        return "this process"
    from validate.engine.cluster import Drain, until_it_is_gone  # Dask takes a second

    if plan.shares and not pool.address:
        return _shared(plan, pool, Queue([*timed, *beside], plan.beside), own, done, here)
    client = pool.client(len(beside) or 1)
    with until_it_is_gone(client, pool.address):
        Drain(plan, client, done, here).run(Queue(beside))
        said = pool.words
        if pool.address:
            Drain(plan, client, done, here, ahead=0).run(Queue(timed))
    if not pool.address:
        own.run(timed)
    return said


class _Here:
    """Computes cells in this process, on what is open already."""

    def __init__(self, plan: Plan[C, R], done: Done, tell: Tell, here: Identity) -> None:
        self._plan, self._done, self._tell, self._code = plan, done, tell, digest(here)

    def run(self, cells: Sequence[Any]) -> None:
        plan = self._plan
        for cell in cells:
            self._tell(cell.label)
            bench = plan.bench if plan.bench is not None else opened(plan.open, plan.job)
            self._done(cell, recorded(plan.run, bench, cell, self._code))


def _shared(
    plan: Plan[C, R], pool: Pool, queue: Queue, own: _Here, done: Done, here: Identity
) -> str:
    """This process computes until workers have started, where the work is worth that. What stops
    the workers is raised here."""
    raised: list[BaseException] = []
    cells = len(queue)

    def by_workers() -> None:
        try:
            # Whether the rest, and what comes after, takes longer than workers take to start, by
            # what was done until now
            start = perf_counter()
            while len(queue):
                sleep(_PATIENCE)
                gone, finished = perf_counter() - start, cells - len(queue) - queue.running
                if gone * (len(queue) + plan.after) > _WORTH * max(finished, 0.5):
                    break
            else:
                return  # nothing is left
            from validate.engine.cluster import Drain

            Drain(plan, pool.client(), done, here, ahead=1).run(queue)
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=by_workers, daemon=True)
    thread.start()
    try:
        # Once workers run this process only talks to them, which would disturb what is timed.
        while thread.is_alive() and not raised:
            batch = () if pool.busy else queue.take()
            if batch:
                own.run(batch)
                queue.ended(batch)
            else:
                thread.join(_PATIENCE if pool.busy else _LOOK)
        while not raised and (batch := queue.take()):
            own.run(batch)
            queue.ended(batch)
    finally:
        queue.close()
    thread.join()
    if raised:
        raise raised[0]
    return pool.words if pool.busy else "this process"


# --- cache of a worker between cells: the last few values by key ---------------------------------

V = TypeVar("V")


class Kept(Generic[V]):
    """At most `most` values; a value that is asked for again becomes the youngest."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: OrderedDict[Hashable, V] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        if key not in self._values:
            self._values[key] = make()
            if len(self._values) > self._most:
                self._values.popitem(last=False)
        self._values.move_to_end(key)
        return self._values[key]


def fingerprint(value: Any) -> str:
    """Equal for equal content of nested dataclasses, mappings, tuples, arrays and plain values."""
    found = sha256()
    for part in _parts(value):
        found.update(part)
    return found.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif is_dataclass(value):
        yield type(value).__name__.encode()
        for f in fields(value):
            yield from _parts(getattr(value, f.name))
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield repr(key).encode()
            yield from _parts(inner)
    elif isinstance(value, tuple | list):
        yield f"{len(value)} of".encode()
        for inner in value:
            yield from _parts(inner)
    else:
        yield repr(value).encode()
