"""Batches of cells on Dask: what a dead worker and a broken plan make of them."""

from types import SimpleNamespace

import pytest
from distributed.scheduler import KilledWorker
from engine_samples import Waited, Waiting

from validate.errors import UsageError
from validate.study.cluster import _records
from validate.study.store import Record

CELLS = (Waiting("a"), Waiting("b"))


def future(error: Exception | None = None, result: object = None) -> SimpleNamespace:
    return SimpleNamespace(
        status="error" if error else "finished", exception=lambda: error, result=lambda: result
    )


def test_a_finished_batch_is_its_records() -> None:
    records = [Record("a", Waited(1, 0.5)), Record("b", refused="this cannot be")]
    assert _records(future(result=records), CELLS) == records


@pytest.mark.parametrize("count", [2, 1])
def test_a_dead_worker_fails_only_a_cell_that_was_alone(count: int) -> None:
    """Which of two cells killed it is not known: both are sent again, each alone."""
    dead = future(KilledWorker("task", None, 2))
    alone = [Record("a", failed="its worker died 3 times: out of memory?", lasting=False)]
    assert _records(dead, CELLS[:count]) == ([None, None] if count == 2 else alone)


def test_what_opening_the_experiment_raises_is_raised() -> None:
    with pytest.raises(UsageError, match="no experiment 'x'"):
        _records(future(UsageError("no experiment 'x'")), CELLS)
