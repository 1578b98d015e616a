"""Output folders: tested before any work, and messages when writing fails.

A place is tried by doing there what will be done: folders made, a file written and removed. Rights
alone say nothing for the superuser, for a mounted or a full disk.
"""

import errno
import fcntl
import glob
import logging
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

from platformdirs import user_cache_path

from validate.errors import UsageError

REPORT_BYTES = 20_000_000  # reports of the shipped experiments take 7 to 17 MB
RECORDING_BYTES = 1_000_000  # twins take up to 550 kB
LOG = logging.getLogger(__name__)
_TRIED = 4096  # bytes that are written for trial

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# What the place forbids, as against a bug of ours: those are errors of a path that does not exist.
_OF_THE_PLACE = (
    *_FULL, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.ENAMETOOLONG, errno.ENOTDIR,
)  # fmt: skip


def cache(name: str) -> Path:
    """The folder of that name in the user's cache; it may not be there yet."""
    return user_cache_path("validate") / name


def try_folder(folder: Path, needed: int = REPORT_BYTES) -> None:
    """Makes a folder beside `folder`, writes a file in it and removes both, and made parents too.

    Raises `UsageError` in one line where that fails, or where fewer than `needed` bytes are free.
    """
    folder = folder.resolve()
    with _parents(folder, "choose another folder with --out"):
        trial = folder.with_name(f".{folder.name[:200]}.try-{uuid4().hex[:8]}")
        try:
            trial.mkdir()
            _written(trial / "trial")
        finally:
            shutil.rmtree(trial, ignore_errors=True)
        _require_free(folder, needed, "choose another folder with --out")


def try_file(path: Path, needed: int = RECORDING_BYTES) -> None:
    """Writes a file beside `path`, in a folder that must exist, and removes it; as `try_folder`."""
    path = path.resolve()
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a file")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: no folder {path.parent}; make it, or name another file")
    with _parents(path, "name another file"):
        trial = _part_of(path)
        try:
            _written(trial)
        finally:
            with suppress(OSError):
                trial.unlink()
        _require_free(path, needed, "name another file")


def write_whole(path: Path, text: str) -> None:
    """Writes a text file whole or not at all, on the disk; `UsageError` if not."""
    try:
        with replacing(path) as stream:
            stream.write(text.encode("utf-8"))
    except OSError as error:
        why = why_not(error, path, need=len(text.encode()))
        raise UsageError(f"{path}: cannot be written ({why})") from error


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file beside `path` that takes its place once all is written and on the disk; else nothing
    is left. Those that ended processes left there are removed."""
    for old in path.parent.glob(f".{glob.escape(path.name[:200])}.????????.part"):
        _remove_unheld(old)
    part = _part_of(path)
    try:
        with part.open("xb") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)  # ends with this process
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
            part.replace(path)
        sync(path.parent)
    finally:
        with suppress(OSError):  # no folder, no leftover
            part.unlink(missing_ok=True)


def _part_of(path: Path) -> Path:
    return path.with_name(f".{path.name[:200]}.{uuid4().hex[:8]}.part")


def _remove_unheld(part: Path) -> None:
    with suppress(OSError), part.open("rb") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        part.unlink()
        LOG.warning(f"{part.name}: left by an interrupted command, removed")


def sync(folder: Path) -> None:
    """Has the names in a folder on the disk, where the system syncs folders."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def sync_tree(folder: Path) -> None:
    """Has all files and names below a folder on the disk; raises `OSError` where a file is not."""
    for where, _, names in os.walk(folder):
        for name in names:
            with (Path(where) / name).open("rb") as stream:
                os.fsync(stream.fileno())
        sync(Path(where))


def why_not(error: OSError, place: Path, written: int = 0, need: int = 0) -> str:
    """Why nothing can be written at `place`, in words; bytes where the disk is full.

    `written` are those that went there before it ended, `need` what is known to be needed.
    """
    said = error.strerror or str(error)
    if error.errno not in _FULL:
        return said
    known = f"{_bytes(need)} are needed" if need else f"more than {_bytes(written)} are needed"
    return f"{said}: {known}, {_bytes(free_bytes(place))} are free"


def of_the_place(error: OSError) -> bool:
    """Whether the place refuses (full, read-only, forbidden), so that another one would do."""
    return error.errno in _OF_THE_PLACE


def free_bytes(place: Path) -> int:
    """Of the disk that holds the place, or will."""
    there = next(p for p in (place, *place.parents) if p.exists())
    return shutil.disk_usage(there).free


def size_of(place: Path) -> int:
    """Bytes of a file, or of all files in a folder; 0 where there is none."""
    if place.is_file():
        return place.stat().st_size
    return sum(f.lstat().st_size for f in place.rglob("*") if not f.is_dir())


def _require_free(place: Path, needed: int, instead: str) -> None:
    free = free_bytes(place.parent)
    if free < needed:
        raise UsageError(
            f"{place}: {_bytes(needed)} are needed, {_bytes(free)} are free; make room or {instead}"
        )


def _bytes(count: int) -> str:
    for size, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return f"{count} bytes"


def _written(trial: Path) -> None:
    with trial.open("xb") as stream:
        stream.write(bytes(_TRIED))
        stream.flush()
        os.fsync(stream.fileno())  # a disk that is full may say so only then


@contextmanager
def _parents(place: Path, instead: str) -> Iterator[None]:
    """The folders above a place while it is tried; an error of the system is one line."""
    missing = [p for p in place.parents if not p.exists()]
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        text = f"cannot write at {place}: {why_not(error, place, _TRIED)}; {instead}"
        raise UsageError(text) from error
    finally:
        for parent in missing:
            with suppress(OSError):  # never made, or something else has moved in
                parent.rmdir()
