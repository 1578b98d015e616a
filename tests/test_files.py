"""The guarded way to open a file, and the one policy for names that a file holds."""

import os
import socket
from pathlib import Path

import numpy as np
import pytest

from validate.errors import RecordingError
from validate.files import (
    first_bytes,
    inside,
    json_value,
    member,
    members,
    npz_arrays,
    open_file,
    read_bytes,
)


@pytest.fixture
def odd(tmp_path: Path) -> dict[str, Path]:
    """Paths that are no regular file."""
    os.mkfifo(tmp_path / "pipe")
    place = socket.socket(socket.AF_UNIX)
    place.bind(str(tmp_path / "socket"))
    place.close()
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "zero").symlink_to("/dev/zero")
    (tmp_path / "folder").mkdir()
    names = ("pipe", "socket", "loop", "zero", "folder", "absent", "a\0b", "x" * 300)
    return {name: tmp_path / name for name in names}


def test_only_regular_files_are_opened(odd: dict[str, Path]) -> None:
    for path in odd.values():
        with pytest.raises(RecordingError):
            open_file(path)
        assert first_bytes(path, 4) == b""
    with pytest.raises(RecordingError, match="pipe: a folder, pipe or device"):
        read_bytes(odd["pipe"])


def test_every_read_has_a_limit(tmp_path: Path) -> None:
    file = tmp_path / "ten"
    file.write_bytes(b"0123456789")
    assert read_bytes(file, 10) == b"0123456789"
    with pytest.raises(RecordingError, match="ten: 10 bytes, the limit is 9; split it"):
        read_bytes(file, 9)
    endless = Path("/proc/self/environ")  # states no size
    if endless.is_file() and endless.read_bytes():
        with pytest.raises(RecordingError, match="1 bytes, the limit is 0"):
            read_bytes(endless, 0)


def test_members_of_a_folder_are_few_and_in_order(tmp_path: Path) -> None:
    for name in ("b", "a", ".hidden"):
        (tmp_path / name).touch()
    (tmp_path / "below").mkdir()
    assert [p.name for p in members(tmp_path)] == ["a", "b"]
    with pytest.raises(RecordingError, match="over 1 entries; split the folder"):
        members(tmp_path, most=1)
    with pytest.raises(RecordingError, match="cannot be read"):
        members(tmp_path / "absent")


def test_names_are_followed_inside_their_folder_only(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    (folder / "below").mkdir(parents=True)
    (folder / "below" / "b.raw").touch()
    (tmp_path / "secret").touch()
    (folder / "link").symlink_to(tmp_path / "secret")
    (folder / "out").symlink_to(tmp_path)
    (folder / "in").symlink_to("below/b.raw")
    assert inside(folder, "below/b.raw") == folder / "below" / "b.raw"
    assert inside(folder, "below\\b.raw") == folder / "below" / "b.raw"
    assert inside(folder, "in") == folder / "below" / "b.raw"
    assert inside(folder, "not there") == folder / "not there"
    for name in ("../secret", "/etc/passwd", "link", "out/secret", "C:\\x", "below/../../secret"):
        with pytest.raises(RecordingError, match="is outside its folder 'data'"):
            inside(folder, name)
    for name in ("", "  ", "a\0b", "a\nb"):
        with pytest.raises(RecordingError, match="is not a file name"):
            inside(folder, name)
    with pytest.raises(RecordingError, match="cannot be followed"):
        inside(folder, "x" * 300)
    with pytest.raises(RecordingError, match="'link' is outside"):
        member(folder / "link")


def test_json_of_any_depth_and_digits_is_a_value_or_an_error() -> None:
    assert json_value('{"a": [1, 2.5]}') == {"a": [1, 2.5]}
    assert json_value("123456789012345678") == 123456789012345678
    assert json_value("9" * 400) == float("inf")
    with pytest.raises(ValueError, match="nested too deeply"):
        json_value("[" * 100_000 + "]" * 100_000)


def test_arrays_are_read_whole_or_not(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    np.savez_compressed(file, zeros=np.zeros(10_000))
    assert npz_arrays(file, 100_000)["zeros"].shape == (10_000,)
    with pytest.raises(RecordingError, match=r"a\.npz: 80\d+ bytes .* 80000"):
        npz_arrays(file, 80_000)
    whole = file.read_bytes()
    file.write_bytes(whole[:-30])
    with pytest.raises(RecordingError, match=r"a\.npz: not an archive of arrays"):
        npz_arrays(file, 100_000)
    np.savez(file, o=np.array([{}], dtype=object))
    with pytest.raises(RecordingError, match="allow_pickle"):
        npz_arrays(file, 100_000)
