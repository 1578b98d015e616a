"""Batches of cells on Dask: what a dead worker, other code and a broken plan make of them."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from distributed.scheduler import KilledWorker
from engine_samples import Waited, Waiting, waiting

from validate.engine import cluster
from validate.engine.cell import Record, Where
from validate.engine.cluster import Drain
from validate.engine.identity import digest
from validate.engine.queue import Queue
from validate.errors import UsageError

# private: _dask, _size: replaced, to bring a case about.

HERE = {"validate": "a" * 64}
CELLS = (Waiting("a"), Waiting("b"))


def given(cell: Waiting, code: str = digest(HERE)) -> Record[Waited]:
    return Record(cell.key, Waited(1, 0.0), seconds=0.0, code=code)


class Scheduler:
    """A scheduler whose workers answer at once, by `answer` of the cells of a task."""

    def __init__(self, answer: Callable[[Sequence[Waiting]], Any], *workers: str) -> None:
        self.answer, self.workers = answer, list(workers or ("w1", "w2"))
        self.sent: list[tuple[str, ...]] = []

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        return {"workers": dict.fromkeys(self.workers)}

    def submit(self, function: Any, *given: Any, workers: list[str], **_: Any) -> Any:
        if function is cluster.prove:
            return SimpleNamespace(status="finished", result=lambda **_: HERE)
        cells = given[3]
        self.sent.append(tuple(cell.key for cell in cells))
        found = self.answer(cells)
        error = found if isinstance(found, Exception) else None
        return SimpleNamespace(
            status="error" if error else "finished", exception=lambda: error,
            result=lambda **_: found, cancel=lambda: None,
        )  # fmt: skip


def drained(scheduler: Scheduler, monkeypatch: pytest.MonkeyPatch, size: int = 1) -> Counter[str]:
    """What was finished, and how often; `size` cells go in a task at first."""
    done: list[Record[Waited]] = []
    monkeypatch.setattr(cluster, "_dask", SimpleNamespace(wait=lambda *_, **__: None))
    plan = waiting(Path(), CELLS)
    drain = Drain(plan, scheduler, lambda _, r: done.append(r), HERE, ahead=2)
    monkeypatch.setattr(drain, "_size", lambda waiting, most: size)
    drain.run(Queue(CELLS))
    return Counter(f"{r.key} {r.why}".strip() for r in done)


def test_cells_of_a_batch_whose_worker_died_are_sent_again_each_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Which of the two killed it is not known: neither is lost, neither is done twice."""
    dead = KilledWorker("task", None, 2)
    scheduler = Scheduler(lambda cells: dead if len(cells) == 2 else [given(c) for c in cells])
    assert drained(scheduler, monkeypatch, size=2) == {"a": 1, "b": 1}
    assert scheduler.sent[0] == ("a", "b")
    assert sorted(scheduler.sent[1:]) == [("a",), ("b",)]


def test_a_cell_that_kills_every_worker_is_a_failure_and_the_other_is_done(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def answer(cells: Sequence[Waiting]) -> Any:
        keys = [c.key for c in cells]
        return KilledWorker("task", None, 2) if "b" in keys else [given(c) for c in cells]

    scheduler = Scheduler(answer)
    why = "its worker process died 4 times: out of memory?"
    assert drained(scheduler, monkeypatch, size=2) == {"a": 1, f"b {why}": 1}
    assert scheduler.sent.count(("b",)) == 4


def test_records_of_other_code_are_thrown_away_and_asked_for_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter(["other", digest(HERE), digest(HERE)])
    scheduler = Scheduler(lambda cells: [given(c, next(answers)) for c in cells])
    assert drained(scheduler, monkeypatch) == {"a": 1, "b": 1}
    assert len(scheduler.sent) == 3


def test_a_refusal_counts_as_an_answer_of_proven_code_only(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter(["other", digest(HERE), digest(HERE)])
    scheduler = Scheduler(
        lambda cells: [replace(given(c, next(answers)), value=None, refused="no") for c in cells]
    )
    assert drained(scheduler, monkeypatch) == {"a no": 1, "b no": 1}


def test_what_opening_the_experiment_raises_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="no experiment 'x'"):
        drained(Scheduler(lambda _: UsageError("no experiment 'x'")), monkeypatch)


def test_a_result_that_is_gone_with_its_worker_is_computed_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The task is finished, and the worker that holds what it gave dies before it is fetched."""
    scheduler = Scheduler(lambda cells: [given(c) for c in cells], "w1")
    submit = scheduler.submit

    def lost(**_: object) -> None:
        scheduler.workers = ["w2"]
        raise TimeoutError

    def first_is_lost(function: Any, *given: Any, **more: Any) -> Any:
        future = submit(function, *given, **more)
        if function is not cluster.prove and len(scheduler.sent) == 1:
            future.result = lost
        return future

    monkeypatch.setattr(scheduler, "submit", first_is_lost)
    assert drained(scheduler, monkeypatch) == {"a": 1, "b": 1}
    assert scheduler.sent.count(("a",)) == 2


class Free:
    """A client whose workers answer at once; one that dies under `dies`."""

    def __init__(self, dies: object) -> None:
        self.dies, self.done = dies, list[object]()

    def scatter(self, data: Any, **_: Any) -> Any:
        """As Dask does it: item by item."""
        return list(data)

    def submit(self, function: Any, shared: Any, item: Any, **_: Any) -> Any:
        def result() -> Any:
            if item == self.dies:
                raise KilledWorker("task", None, 2)
            self.done.append(item)
            return function(shared, item)

        return SimpleNamespace(result=result)


def test_what_a_worker_died_of_is_done_here_and_values_keep_their_order() -> None:
    client = Free(dies=2)
    assert cluster.side_by_side(client, divmod, 17, [1, 2, 5])() == [(17, 0), (8, 1), (3, 2)]
    assert client.done == [1, 5]
    with pytest.raises(ZeroDivisionError):
        cluster.side_by_side(client, divmod, 17, [1, 0])()


@pytest.mark.slow
def test_what_is_shared_arrives_whole_on_real_workers() -> None:
    """Dask scatters a tuple, list or dictionary item by item, and none of an empty one."""
    with cluster.connected(Where(1), 1) as client:
        for shared in ((), (1, (2,)), {}, [3], "one", {"a": 1}):
            found = cluster.side_by_side(client, both, shared, [7, 9])()
            assert found == [(shared, 7), (shared, 9)]


def both(shared: object, item: int) -> tuple[object, int]:
    return shared, item
