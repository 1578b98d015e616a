"""Cells that wait: none is lost or taken twice, and timed ones have little beside them."""

import os
import time
from dataclasses import replace
from pathlib import Path

import pytest
from engine_samples import Waiting, logged, waiting
from hypothesis import given
from hypothesis import strategies as st

from validate.engine.cell import Where
from validate.engine.execution import finish
from validate.engine.pool import Pool
from validate.engine.queue import Queue


@given(
    st.lists(st.booleans(), max_size=12), st.integers(1, 3),
    st.lists(st.tuples(st.integers(1, 4), st.booleans()), max_size=60),
)  # fmt: skip
def test_every_cell_is_taken_once_and_timed_ones_with_at_most_so_many_beside(
    timed: list[bool], beside: int, acts: list[tuple[int, bool]]
) -> None:
    cells = [Waiting(str(i), timed=t) for i, t in enumerate(timed)]
    queue, out, taken = Queue(cells, beside), list[tuple[Waiting, ...]](), list[str]()
    for most, end_first in [*acts, *[(1, False)] * 60]:
        if end_first and out:
            queue.ended(out.pop(0))
        batch = queue.take(most)
        if batch:
            out.append(batch)
            taken += [c.key for c in batch]
            assert len(batch) <= most
        elif out:
            queue.ended(out.pop(0))
        if any(c.timed for one in out for c in one):
            assert len(out) <= beside
            assert all(len(one) == 1 for one in out if any(c.timed for c in one))
    assert taken == [c.key for c in cells]
    assert len(queue) == 0


def test_a_cell_that_was_lost_is_the_next_one() -> None:
    queue = Queue([Waiting("a"), Waiting("b")])
    (lost,) = batch = queue.take()
    queue.ended(batch)
    queue.again(lost)
    assert [queue.take(5)] == [(Waiting("a"), Waiting("b"))]


@pytest.mark.slow
def test_this_process_begins_and_its_workers_go_on(tmp_path: Path) -> None:
    cells = (
        *(Waiting(f"t{i}", 0.3, timed=True) for i in range(4)),
        *(Waiting(f"c{i:02d}", 0.3) for i in range(24)),
    )
    plan = replace(waiting(tmp_path, cells), shares=True, beside=2)
    done = finish(plan, tmp_path / "cells", Where(workers=2))
    assert (len(done.records), done.workers) == (28, "2 local")
    rows = logged(tmp_path)
    assert len(rows) == 28
    assert rows[0].pid == os.getpid()  # this process began while the workers started
    assert len({row.pid for row in rows}) == 3
    timed = [row for row in rows if row.key.startswith("t")]
    others = [row for row in rows if not row.key.startswith("t")]
    for one in timed:
        assert sum(o.start < one.start < o.end for o in [*timed, *others] if o is not one) <= 1


def test_what_stops_the_workers_is_raised_and_finished_cells_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(self: Pool, most: int | None = None) -> None:
        end = time.monotonic() + 60
        while not (tmp_path / "runs").exists():
            assert time.monotonic() < end, "no cell ran in 60 s"
            time.sleep(0.01)
        raise OSError("no more processes")

    monkeypatch.setattr(Pool, "client", broken)
    cells = tuple(Waiting(f"c{i}", 0.05) for i in range(400))
    plan = replace(waiting(tmp_path, cells), shares=True, beside=2)
    with pytest.raises(OSError, match="no more processes"):
        finish(plan, tmp_path / "cells", Where(workers=2))
    kept = {path.stem for path in (tmp_path / "cells").glob("*.json")}
    assert kept == {row.key for row in logged(tmp_path)}
    assert 0 < len(kept) < len(cells)
