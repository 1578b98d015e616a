"""Places are tried before any work, and what fails while writing leaves nothing half-written."""

import errno
import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from validate.errors import RecordingError, UsageError
from validate.places import (
    free_bytes,
    of_the_place,
    size_of,
    try_file,
    try_folder,
    why_not,
    write_whole,
)
from validate.recording.mcap.schemas import to_bytes
from validate.recording.mcap.write import (
    WrittenChannel,
    WrittenMessage,
    json_schema,
    write_channels,
)
from validate.report.stored.folder import MARK, replace_folder, try_results


@contextmanager
def small_files(most: int) -> Iterator[None]:
    """A real error of the system while writing: no file may become larger than `most` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def one_line(caught: pytest.ExceptionInfo[Exception]) -> str:
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_trial_leaves_nothing_not_even_the_folders_above(tmp_path: Path) -> None:
    try_folder(tmp_path / "a" / "b" / "report", needed=1)
    try_file(tmp_path / "x.mcap", needed=1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["file/report", "file/deep/report"])
def test_a_file_where_a_folder_must_be_is_one_line(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("mine", "utf-8")
    with pytest.raises(UsageError) as caught:
        try_folder(tmp_path / place)
    assert "choose another folder with --out" in one_line(caught)
    assert (tmp_path / "file").read_text("utf-8") == "mine"


def test_what_the_system_forbids_is_one_line() -> None:
    """/proc refuses the superuser too."""
    for attempt in (try_folder, try_file):
        with pytest.raises(UsageError) as caught:
            attempt(Path("/proc/x"))
        assert "cannot write at /proc/x" in one_line(caught)


def test_a_trial_writes_bytes(tmp_path: Path) -> None:
    """Making a folder is not enough: a full disk often still takes that."""
    with small_files(100), pytest.raises(UsageError) as caught:
        try_folder(tmp_path / "report", needed=1)
    assert "File too large: more than 4.1 kB are needed" in one_line(caught)
    assert list(tmp_path.iterdir()) == []


def test_too_little_room_names_what_is_needed_and_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=5_000_000))
    try_folder(tmp_path / "report", needed=5_000_000)
    with pytest.raises(UsageError) as caught:
        try_folder(tmp_path / "report")
    assert "20.0 MB are needed, 5.0 MB are free; make room" in one_line(caught)


def test_results_need_as_much_room_as_those_that_stay_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "report"
    (folder / "study-filters").mkdir(parents=True)
    (folder / MARK).write_bytes(bytes(300_000))
    (folder / "study-filters" / "cell").write_bytes(bytes(500_000))  # stays where it is
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=300_000))
    try_results(folder, ("study-*",))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=299_999))
    with pytest.raises(UsageError, match=r"300\.0 kB are needed"):
        try_results(folder, ("study-*",))


def test_a_folder_of_the_user_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("", "utf-8")
    with pytest.raises(UsageError, match="1 entries but no"):
        try_results(tmp_path, ())


def test_a_disk_that_fills_up_leaves_the_old_report_and_says_how_much(tmp_path: Path) -> None:
    folder = tmp_path / "report"
    replace_folder(folder, lambda f: (f / MARK).write_text("old", "utf-8") and None, ())

    def fill(fresh: Path) -> None:
        (fresh / MARK).write_text("new", "utf-8")
        (fresh / "figure").write_bytes(bytes(300_000))

    with small_files(200_000), pytest.raises(UsageError) as caught:
        replace_folder(folder, fill, ())
    said = one_line(caught)
    assert "more than 200.0 kB are needed" in said
    assert "are free; its old content is kept" in said
    assert (folder / MARK).read_text("utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["report"]


def test_an_error_that_is_ours_stays_a_bug(tmp_path: Path) -> None:
    def fill(fresh: Path) -> None:
        (fresh / "no" / "such").write_text("", "utf-8")

    with pytest.raises(FileNotFoundError):
        replace_folder(tmp_path / "report", fill, ())


def test_a_recording_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    channel = WrittenChannel("a", json_schema("s", {"type": "object"}))
    texts = [{"text": f"{i * 7919 % 10007}" * 60} for i in range(2000)]
    messages = [WrittenMessage("a", i, to_bytes(text)) for i, text in enumerate(texts)]
    with small_files(4000), pytest.raises(RecordingError) as caught:
        write_channels(path, [channel], messages, {})
    assert "cannot be written (File too large: more than 4" in one_line(caught)
    assert list(tmp_path.iterdir()) == []


def test_a_text_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    write_whole(path, "old")
    with small_files(1000), pytest.raises(UsageError) as caught:
        write_whole(path, "new" * 1000)
    assert "3.0 kB are needed" in one_line(caught)
    assert path.read_text("utf-8") == "old"
    assert size_of(tmp_path) == 3


def test_the_reason_is_that_of_the_system(tmp_path: Path) -> None:
    read_only = OSError(errno.EROFS, "Read-only file system")
    assert why_not(read_only, tmp_path) == "Read-only file system"
    assert of_the_place(read_only)
    full = why_not(OSError(errno.ENOSPC, "No space left on device"), tmp_path / "not" / "there", 7)
    assert full.startswith("No space left on device: more than 7 bytes are needed, ")
    assert not of_the_place(FileNotFoundError(errno.ENOENT, "No such file"))
    assert free_bytes(tmp_path / "not" / "there") > 0


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=f"{tmp_path} is a folder; name a file"):
        try_file(tmp_path)
