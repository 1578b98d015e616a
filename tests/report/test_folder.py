"""Folders are replaced whole; studies inside a report's folder stay."""

import errno
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from validate.errors import UsageError
from validate.report.stored import folder as folders
from validate.report.stored.folder import MARK, STUDIES, locked, replace_folder


def fill(text: str) -> object:
    def write(folder: Path) -> None:
        (folder / MARK).write_text(text, encoding="utf-8")

    return write


def test_a_new_report_leaves_the_studies_below_it(tmp_path: Path) -> None:
    folder = tmp_path / "kf"
    cell = folder / "study-filters" / "cells" / "1.json"
    cell.parent.mkdir(parents=True)
    cell.write_text("{}", encoding="utf-8")
    for text in ("one", "two"):
        replace_folder(folder, fill(text), (STUDIES,))  # type: ignore[arg-type]
        assert (folder / MARK).read_text("utf-8") == text
        assert cell.read_text("utf-8") == "{}"
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]


@pytest.mark.parametrize(
    ("raised", "caught"),
    [
        (RuntimeError("a bug"), RuntimeError),
        (KeyboardInterrupt(), KeyboardInterrupt),
        (MemoryError(), MemoryError),
        (OSError(errno.ENOSPC, "No space left on device"), UsageError),
        (OSError(errno.EROFS, "Read-only file system"), UsageError),
    ],
)
def test_a_failure_leaves_the_old_folder_and_its_studies(
    raised: BaseException, caught: type[BaseException], tmp_path: Path
) -> None:
    folder = tmp_path / "kf"
    (folder / "study-filters").mkdir(parents=True)
    replace_folder(folder, fill("one"), (STUDIES,))  # type: ignore[arg-type]

    def fail(fresh: Path) -> None:
        (fresh / "half").write_text("", encoding="utf-8")
        raise raised

    with pytest.raises(caught):
        replace_folder(folder, fail, (STUDIES,))
    assert {p.name for p in folder.iterdir()} == {MARK, "study-filters"}
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]


def test_a_folder_of_the_user_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("", encoding="utf-8")
    with pytest.raises(UsageError, match="1 entries but no"):
        replace_folder(tmp_path / "mine", fill(""), (STUDIES,))  # type: ignore[arg-type]


# --- one writer at a time -------------------------------------------------------------------------

HOLD = """
import sys
from pathlib import Path
from validate.report.stored.folder import locked
with locked(Path(sys.argv[1]), shared=len(sys.argv) > 2):
    print("held", flush=True)
    sys.stdin.read()
"""


@contextmanager
def held_elsewhere(folder: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    """Another process has the lock until it is ended."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder), *more],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        if process.stdin is not None:
            process.stdin.close()


def test_a_second_writer_is_told_who_has_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "kf"
    with held_elsewhere(folder) as other:
        with pytest.raises(UsageError, match=rf"kf is being written by .*process {other.pid} on"):
            replace_folder(folder, fill("two"), ())  # type: ignore[arg-type]
        with (
            pytest.raises(UsageError, match="is being written by"),
            locked(folder / "study-x"),  # a study's page lies in it
        ):
            raise AssertionError
    replace_folder(folder, fill("two"), ())  # type: ignore[arg-type]  # its lock ended with it
    assert (folder / MARK).read_text("utf-8") == "two"
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]


def test_studies_share_a_report_s_folder_and_no_run_replaces_it_meanwhile(tmp_path: Path) -> None:
    folder = tmp_path / "kf"
    with held_elsewhere(folder, "shared"):
        with locked(folder / "study-x"), locked(folder / "study-y"):
            pass
        with pytest.raises(UsageError, match="is being written by"):
            replace_folder(folder, fill("two"), ())  # type: ignore[arg-type]


def test_a_process_may_lock_a_folder_again_and_nothing_is_left(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "kf"
    with locked(folder), locked(folder):
        assert [p.name for p in folder.parent.iterdir()] == [".kf.lock"]
    assert not (tmp_path / "deep").exists()


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with (
        pytest.raises(UsageError, match=r"cannot write at .*; choose another"),
        locked(tmp_path / "file" / "kf"),
    ):
        raise AssertionError


# --- interrupted processes ------------------------------------------------------------------------


def page(folder: Path, text: str, *studies: str) -> Path:
    folder.mkdir(parents=True)
    (folder / MARK).write_text(text, encoding="utf-8")
    for name in studies:
        (folder / name / "cells").mkdir(parents=True)
        (folder / name / "cells" / "1.json").write_text(name, encoding="utf-8")
    return folder


def test_what_was_interrupted_is_put_back_or_removed_with_a_line(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """After the exchange, before studies were moved; a half-filled folder; a trial."""
    folder = page(tmp_path / "kf", "new")
    page(tmp_path / ".kf.new-00000000", "old", "study-a")
    (tmp_path / ".kf.new-11111111").mkdir()
    (tmp_path / ".kf.try-22222222").mkdir()
    page(folder / ".study-b.new-33333333", "half")
    page(folder / "study-b", "whole", "cells")
    (tmp_path / ".kf.new").mkdir()  # the user's
    with locked(folder):
        assert (folder / MARK).read_text("utf-8") == "new"
        assert (folder / "study-a" / "cells" / "1.json").read_text("utf-8") == "study-a"
        assert (folder / "study-b" / MARK).read_text("utf-8") == "whole"
    assert sorted(p.name for p in tmp_path.iterdir()) == [".kf.new", "kf"]
    assert sorted(p.name for p in folder.iterdir()) == [MARK, "study-a", "study-b"]
    assert caplog.messages == ["kf: 4 left-overs of interrupted commands removed"]


def test_between_two_renames_the_old_folder_is_put_back(tmp_path: Path) -> None:
    page(tmp_path / ".kf.old-00000000", "old", "study-a")
    page(tmp_path / ".kf.new-11111111", "new")
    with locked(tmp_path / "kf"):
        assert (tmp_path / "kf" / MARK).read_text("utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]
    assert sorted(p.name for p in (tmp_path / "kf").iterdir()) == [MARK, "study-a"]


@pytest.mark.parametrize("in_one_step", [True, False])
def test_folders_are_exchanged_with_and_without_the_system_s_step(
    in_one_step: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not in_one_step:
        monkeypatch.setattr(folders, "exchange", lambda *_: False)
    folder = page(tmp_path / "kf", "old", "study-a")
    replace_folder(folder, fill("new"), (STUDIES,))  # type: ignore[arg-type]
    assert (folder / MARK).read_text("utf-8") == "new"
    assert sorted(p.name for p in folder.iterdir()) == [MARK, "study-a"]
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]


def test_the_exchange_says_where_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = page(tmp_path / "a", "a"), page(tmp_path / "b", "b")
    assert folders.exchange(one, other)
    assert (one / MARK).read_text("utf-8") == "b"
    with pytest.raises(OSError, match="No such file"):
        folders.exchange(one, tmp_path / "absent")
    monkeypatch.setattr(folders.ctypes, "get_errno", lambda: errno.ENOSYS)
    assert not folders.exchange(one, tmp_path / "absent")
    monkeypatch.setattr(folders.ctypes, "CDLL", lambda *_, **__: object())
    assert not folders.exchange(one, other)


def test_two_renames_are_undone_where_the_second_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = page(tmp_path / "kf", "old", "study-a")
    monkeypatch.setattr(folders, "exchange", lambda *_: False)
    rename = Path.rename

    def second_fails(self: Path, target: Path) -> Path:
        if ".new-" in self.name:
            raise OSError(errno.EIO, "disk is gone")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", second_fails)
    with pytest.raises(UsageError, match="disk is gone; its old content is kept"):
        replace_folder(folder, fill("new"), (STUDIES,))  # type: ignore[arg-type]
    assert (folder / MARK).read_text("utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["kf"]


@pytest.mark.slow
def test_commands_that_are_killed_leave_the_old_or_the_new(project_root: Path) -> None:
    """Some calls of each; all of them: `benchmarks/killed.py`."""
    done = subprocess.run(
        [sys.executable, str(project_root / "benchmarks" / "killed.py"), "--seeded", "2"],
        capture_output=True, text=True, timeout=230, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" 0 wrong") == 5
