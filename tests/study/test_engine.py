"""The engine under all studies: nothing is lost, nothing is done twice, timed cells run alone."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from engine_samples import Waited, Waiting, logged, waiting

from validate.errors import UsageError
from validate.study import engine
from validate.study.engine import finish
from validate.study.job import Where, file_sha256
from validate.study.store import Record, key_of, read_records, write_record

HERE = Where(workers=0)


def test_every_cell_is_kept_and_a_second_call_runs_only_what_is_missing(tmp_path: Path) -> None:
    cells = tuple(Waiting(f"c{i}") for i in range(4))
    kept = tmp_path / "cells"
    done = finish(waiting(tmp_path, cells), kept, HERE)
    assert sorted(done.records) == [c.key for c in cells]
    assert (done.reused, len(logged(tmp_path))) == (0, 4)
    (kept / "c1.json").write_text((kept / "c1.json").read_text()[:-9], encoding="utf-8")
    (kept / "c2.json").unlink()
    again = finish(waiting(tmp_path, cells), kept, HERE)
    assert again.reused == 2
    assert [row.key for row in logged(tmp_path)[4:]] == ["c1", "c2"]
    assert {r.value for r in again.records.values()} == {Waited(os.getpid(), 0.0)}


def test_failures_are_records_with_one_line(tmp_path: Path) -> None:
    cells = (Waiting("a", ends="refuse"), Waiting("b", ends="break"), Waiting("c"))
    records = finish(waiting(tmp_path, cells), tmp_path / "cells", HERE).records
    assert (records["a"].refused, records["a"].failed) == ("this cannot be", "")
    assert (records["b"].refused, records["b"].failed) == ("", "ZeroDivisionError: a trap")
    assert (records["c"].why, records["a"].why) == ("", "this cannot be")


def test_progress_counts_what_was_there(tmp_path: Path) -> None:
    cells = tuple(Waiting(f"c{i}") for i in range(3))
    finish(waiting(tmp_path, cells[:1]), tmp_path / "cells", HERE)
    seen: list[tuple[int, int, str]] = []
    finish(
        waiting(tmp_path, cells),
        tmp_path / "cells",
        HERE,
        lambda *told: seen.append(told),
    )
    assert [told[:2] for told in seen] == [(1, 3), (1, 3), (2, 3), (2, 3), (3, 3)]
    assert seen[1][2] == "1 of 3 cells; cell c1"
    assert seen[2][2] == "2 of 3 cells; cell c1 is done"


def test_a_key_knows_all_that_is_put_in() -> None:
    one = Waiting("a", 1.0)
    assert key_of(one, {"b": (1, 2)}) == key_of(one, {"b": (1, 2)})
    others = [key_of(Waiting("a", 2.0), {"b": (1, 2)}), key_of(one, {"b": (1, 3)})]
    assert len({key_of(one, {"b": (1, 2)}), *others}) == 3


def test_a_record_that_is_not_whole_is_not_read(tmp_path: Path) -> None:
    record = Record("k", Waited(1, 0.5), seconds=2.0)
    write_record(tmp_path, Waiting("k"), record)
    assert read_records(tmp_path, ["k"], Waited) == {"k": record}
    content = json.loads((tmp_path / "k.json").read_text("utf-8"))
    del content["record"]["value"]["pid"]
    (tmp_path / "k.json").write_text(json.dumps(content), encoding="utf-8")
    assert read_records(tmp_path, ["k"], Waited) == {}


# --- a scheduler of its own -----------------------------------------------------------------------


class Cluster:
    """A `dask scheduler` and two `dask worker` processes on loopback."""

    def __init__(self, folder: Path) -> None:
        file = folder / "scheduler.json"
        paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
        self._environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        at = ("--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file))
        self.all = [self._started("scheduler", "--port", "0", *at)]
        self.workers = [self._started("worker", "--no-nanny", "--nthreads", "1", *at)
                        for _ in range(2)]  # fmt: skip
        self.address = self._address(file)

    def _started(self, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *arguments]
        quiet = subprocess.DEVNULL
        started = subprocess.Popen(command, env=self._environment, stdout=quiet, stderr=quiet)
        self.all = [*getattr(self, "all", []), started]
        return started

    def _address(self, file: Path, limit: float = 60.0) -> str:
        end = time.monotonic() + limit
        while time.monotonic() < end:
            try:
                return str(json.loads(file.read_text())["address"])
            except (OSError, ValueError):
                time.sleep(0.05)
        raise TimeoutError("no scheduler")

    def stop(self) -> None:
        for process in self.all:
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    found = Cluster(tmp_path_factory.mktemp("cluster"))
    yield found
    found.stop()


@pytest.mark.slow
def test_timed_cells_run_one_at_a_time_on_one_worker(cluster: Cluster, tmp_path: Path) -> None:
    beside = tuple(Waiting(f"b{i}", 0.05) for i in range(4))
    timed = tuple(Waiting(f"t{i}", 0.05, timed=True) for i in range(4))
    where = Where(scheduler=cluster.address)
    done = finish(waiting(tmp_path, (*timed, *beside)), tmp_path / "cells", where)
    assert len(done.records) == 8
    rows = logged(tmp_path)
    assert {row.key[0] for row in rows[:4]} == {"b"}
    assert [row.key for row in rows[4:]] == [c.key for c in timed]
    assert all(one.end <= other.start for one, other in pairwise(rows[4:]))
    assert len({row.pid for row in rows[4:]}) == 1


@pytest.mark.slow
def test_a_killed_worker_loses_no_cell_and_none_is_done_twice(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = tuple(Waiting(f"c{i:02d}", 0.3) for i in range(16))
    written: list[str] = []

    def write(folder: Path, cell: Waiting, record: Record[Waited]) -> None:
        written.append(cell.key)
        write_record(folder, cell, record)

    def kill(done: int, total: int, what: str) -> None:
        if done == 6:
            cluster.workers[0].send_signal(signal.SIGKILL)

    monkeypatch.setattr(engine, "write_record", write)
    where = Where(scheduler=cluster.address)
    done = finish(waiting(tmp_path, cells), tmp_path / "cells", where, kill)
    assert sorted(written) == [c.key for c in cells]
    assert all(r.value is not None for r in done.records.values())
    assert len(list((tmp_path / "cells").glob("*.json"))) == len(cells)
    assert cluster.workers[0].wait(10) == -signal.SIGKILL
    killed = [row.key for row in logged(tmp_path) if row.pid == cluster.workers[0].pid]
    assert 0 < len(killed) < len(cells)  # it had its share, and the other one finished
    assert finish(waiting(tmp_path, cells), tmp_path / "cells", where).reused == len(cells)


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("validate.study.cluster.CONNECT_S", 0.3)
    with pytest.raises(UsageError, match="no scheduler at tcp"):
        finish(
            waiting(tmp_path, (Waiting("a"),)), tmp_path / "cells",
            Where(scheduler="tcp://127.0.0.1:9"),
        )  # fmt: skip
    with pytest.raises(UsageError, match="--workers -1"):
        finish(waiting(tmp_path, (Waiting("a"),)), tmp_path / "cells", Where(workers=-1))


def test_a_file_that_the_experiment_names_is_part_of_it_and_no_other(tmp_path: Path) -> None:
    files = {name: tmp_path / f"{name}.py" for name in ("mine", "helper", "stranger")}
    for path in files.values():
        path.write_text("", encoding="utf-8")
    files["mine"].write_text("import helper", encoding="utf-8")
    first = file_sha256(files["mine"])
    files["stranger"].write_text("x = 1", encoding="utf-8")
    assert file_sha256(files["mine"]) == first
    files["helper"].write_text("x = 1", encoding="utf-8")
    assert file_sha256(files["mine"]) != first
