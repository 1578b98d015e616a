"""The engine: nothing is lost, nothing is done twice, timed cells run alone."""

import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import distributed
import pytest
from engine_samples import Waited, Waiting, logged, waiting

from validate.checksums import sealed, unsealed
from validate.engine import execution as finish_module
from validate.engine.cell import Record, Where
from validate.engine.execution import finish
from validate.engine.identity import PACKAGE, OtherCodeError, digest, require_same
from validate.engine.store import key_of, read_records, write_record
from validate.errors import UsageError
from validate.pipeline.experiment.find import module_name
from validate.pipeline.run.job import Job, file_sha256

HERE = Where(workers=0)


def test_every_cell_is_kept_and_a_second_call_runs_only_what_is_missing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cells = tuple(Waiting(f"c{i}") for i in range(4))
    kept = tmp_path / "cells"
    done = finish(waiting(tmp_path, cells), kept, HERE)
    assert sorted(done.records) == [c.key for c in cells]
    assert (done.reused, len(logged(tmp_path))) == (0, 4)
    (kept / "c1.json").write_text((kept / "c1.json").read_text()[:-9], encoding="utf-8")
    (kept / "c2.json").unlink()
    again = finish(waiting(tmp_path, cells), kept, HERE)
    assert again.reused == 2
    assert re.search(r"c1\.json: ignored .* computed again", caplog.text)
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


def test_a_record_is_believed_where_its_seal_and_its_code_hold(tmp_path: Path) -> None:
    record = Record("k", Waited(1, 0.5), seconds=2.0, code="ours")
    file = tmp_path / "k.json"

    def read(code: str = "ours") -> tuple[dict[str, Record[Waited]], str]:
        found = read_records(tmp_path, ["k", "absent"], Waited, code)
        return found.records, "".join(found.doubts)

    write_record(tmp_path, Waiting("k"), record)
    assert read() == ({"k": record}, "")
    assert read("other") == (
        {},
        "k.json: computed by a different version of the code; the cell is computed again",
    )
    written = file.read_text("utf-8")
    file.write_text(written.replace('"seconds": 0.5', '"seconds": 0.6'), encoding="utf-8")
    assert file.read_text("utf-8") != written
    assert read()[0] == {}
    assert "ignored (its content does not match its checksum" in read()[1]
    lacking = unsealed(json.loads(written))
    del lacking["record"]["value"]["pid"]
    file.write_text(json.dumps(sealed(lacking)), encoding="utf-8")
    assert read() == ({}, "k.json: it contains no record; the cell is computed again")


# --- a scheduler of its own -----------------------------------------------------------------------


class Cluster:
    """A `dask scheduler` and two `dask worker` processes on loopback."""

    def __init__(self, folder: Path) -> None:
        file = folder / "scheduler.json"
        self._paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
        at = ("--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file))
        self.all = [self._started("scheduler", "--port", "0", *at)]
        self._of_worker = ("worker", "--no-nanny", "--nthreads", "1", *at)
        self.workers = [self._started(*self._of_worker) for _ in range(2)]
        self.address = self._address(file)

    def worker_with(self, package: Path) -> subprocess.Popen[bytes]:
        """One more worker, whose package is another."""
        return self._started(*self._of_worker, first=str(package))

    def _started(self, *arguments: str, first: str = "") -> subprocess.Popen[bytes]:
        command = [sys.executable, "-P", "-m", "dask", *arguments]
        quiet = subprocess.DEVNULL
        paths = os.pathsep.join([first, *self._paths] if first else self._paths)
        started = subprocess.Popen(
            command, env={**os.environ, "PYTHONPATH": paths}, stdout=quiet, stderr=quiet
        )
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

    monkeypatch.setattr(finish_module, "write_record", write)
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
def test_a_scheduler_that_dies_is_one_line_and_the_cells_are_kept(tmp_path: Path) -> None:
    own = Cluster(tmp_path)
    cells = tuple(Waiting(f"c{i:02d}", 0.2) for i in range(16))

    def kill(done: int, total: int, what: str) -> None:
        if done == 4:
            own.all[0].kill()

    try:
        with pytest.raises(UsageError, match=r"at tcp://\S+ was lost .* continue"):
            finish(waiting(tmp_path, cells), tmp_path / "cells", Where(scheduler=own.address), kill)
    finally:
        own.stop()
    again = finish(waiting(tmp_path, cells), tmp_path / "cells", HERE)
    assert (again.reused >= 4, len(again.records)) == (True, 16)


@pytest.mark.slow
def test_a_worker_with_other_code_is_refused_in_a_line_and_computes_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    copy = tmp_path / "other"
    shutil.copytree(PACKAGE, copy / "validate", ignore=shutil.ignore_patterns("__pycache__"))
    with (copy / "validate" / "fem" / "elastic.py").open("a") as file:
        file.write("\nOTHER = 1.5\n")
    own = Cluster(tmp_path)
    try:
        other = own.worker_with(copy)
        with distributed.Client(own.address) as client:
            client.wait_for_workers(3, timeout=60)
        cells = tuple(Waiting(f"c{i:02d}", 0.05) for i in range(24))
        where = Where(scheduler=own.address)
        done = finish(waiting(tmp_path, cells), tmp_path / "cells", where)
        assert len(done.records) == 24
        assert {row.pid for row in logged(tmp_path)} == {w.pid for w in own.workers}
        here = Job(str(tmp_path), "").identity()
        assert {r.code for r in done.records.values()} == {digest(here)}
        (line,) = [r.getMessage() for r in caplog.records if "refused" in r.getMessage()]
        assert re.search(
            rf"worker tcp://\S+ is refused: .*validate {here['validate'][:12]}, ", line
        )
        for worker in own.workers:
            worker.kill()
            worker.wait()
        more = waiting(tmp_path, (*cells, Waiting("late")))
        with pytest.raises(UsageError, match="all 1 workers are refused"):
            finish(more, tmp_path / "cells", where)
        assert other.poll() is None
    finally:
        own.stop()


def test_what_differs_is_named_and_an_answer_of_other_code_is_thrown_away() -> None:
    here = {"validate": "a" * 64, "numpy": "2.4.0"}
    require_same(here, {**here, "more": "1"}, "w")
    with pytest.raises(OtherCodeError, match=r"^w is refused: .*2\.4\.0, there 1\.26\)$"):
        require_same(here, {**here, "numpy": "1.26"}, "w")
    with pytest.raises(OtherCodeError, match="validate aaaaaaaaaaaa, there"):
        require_same(here, {}, "w")


def test_the_user_s_own_modules_are_part_of_the_identity(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "deep_law.py").write_text("K = 1\n")
    (tmp_path / "my_law.py").write_text("import deep_law\ndef law(): return deep_law.K\n")
    path = tmp_path / "mine.py"
    path.write_text("from my_law import law\nimport numpy\n")
    spec = importlib.util.spec_from_file_location(module_name(path), path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, module_name(path), module)
    spec.loader.exec_module(module)
    first = Job(str(path), "").identity()
    (tmp_path / "deep_law.py").write_text("K = 1.5\n")
    assert Job(str(path), "").identity()["modules"] != first["modules"]
    assert {**Job(str(path), "").identity(), "modules": ""} == {**first, "modules": ""}


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("validate.engine.cluster.CONNECT_S", 0.3)
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


def test_fewer_workers_than_none_are_refused(tmp_path: Path) -> None:
    plan = waiting(tmp_path, (Waiting("a"),))
    with pytest.raises(UsageError, match=r"--workers -1: expected 0 \(in.*process\)"):
        finish(plan, tmp_path / "cells", Where(workers=-1))
