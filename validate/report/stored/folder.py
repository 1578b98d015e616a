"""Result folders: written beside their place, synced, and exchanged when complete.

One process writes a folder at a time, by a lock that ends with it. What an interrupted process left
is put back or removed by the next one that takes the lock.
"""

import ctypes
import errno
import fcntl
import json
import logging
import os
import shlex
import shutil
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from glob import escape
from pathlib import Path
from uuid import uuid4

from validate.engine.execution import CELLS
from validate.errors import UsageError
from validate.places import (
    REPORT_BYTES,
    of_the_place,
    size_of,
    sync,
    sync_tree,
    try_folder,
    why_not,
)

MARK = "results.json"  # what tells a report folder from a folder of the user
STUDIES = "study-*"  # what a new report leaves, as it does `CELLS`
_KEPT = (STUDIES, CELLS)
_LEFT = ("new", "old", "try")  # .NAME.<one of these>-xxxxxxxx, of processes that were ended
_EXCHANGE, _HERE = 2, -100  # RENAME_EXCHANGE and AT_FDCWD of Linux
_NONE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)  # a system or a disk without that exchange
LOG = logging.getLogger(__name__)


def try_results(folder: Path, keep: tuple[str, ...]) -> None:
    """Whether `folder` could be replaced: tried before the work whose results go there.

    Raises `UsageError` as `replace_folder` does, or where less is free than results take: as much
    as those that lie there, which stay until the new ones are complete.
    """
    folder = folder.resolve()
    _require_replaceable(folder, keep)
    old = sum(map(size_of, _own(folder, keep)))
    try_folder(folder, old or REPORT_BYTES)


def replace_folder(folder: Path, fill: Callable[[Path], None], keep: tuple[str, ...]) -> Path:
    """Replace `folder` by what `fill` writes, but for entries whose names match `keep`.

    The old folder stays until the new one is complete and on the disk; after any failure nothing of
    the new one is left. Returns the folder's whole path. Raises `UsageError` when it holds
    something other than results, another process writes it, or it cannot be written: it says how
    many bytes were needed and are free.
    """
    folder = folder.resolve()
    _require_replaceable(folder, keep)
    fresh = folder.with_name(f".{folder.name}.new-{uuid4().hex[:8]}")
    with locked(folder):
        try:
            fresh.mkdir(parents=True)
            fill(fresh)
            sync_tree(fresh)
            old = _exchanged(fresh, folder)
        except BaseException as error:
            needed = size_of(fresh)
            shutil.rmtree(fresh, ignore_errors=True)
            if not isinstance(error, OSError) or not of_the_place(error):
                raise
            stays = "its old content is kept" if folder.exists() else "nothing was kept there"
            raise UsageError(
                f"cannot write {folder}: {why_not(error, folder, needed)}; {stays}; make room or "
                "choose another folder with --out"
            ) from error
        if old is not None:
            _bring_back(old, folder)
    return folder


def _require_replaceable(folder: Path, keep: tuple[str, ...]) -> None:
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; choose another folder with --out")
    count = len(_own(folder, keep))
    if count and not (folder / MARK).is_file():
        raise UsageError(
            f"{folder} holds {count} entries but no {MARK}, so it is not a report and is not "
            f"replaced; choose another folder with --out"
        )


def _own(folder: Path, keep: tuple[str, ...]) -> list[Path]:
    """Entries that a replacement would take away, but for locks of studies."""
    ours = (*keep, f".{STUDIES}.lock")
    return [e for e in folder.iterdir() if not _kept(e, ours)] if folder.is_dir() else []


def _kept(entry: Path, keep: tuple[str, ...]) -> bool:
    return any(entry.match(pattern) for pattern in keep)


# --- the exchange ---------------------------------------------------------------------------------


def _exchanged(fresh: Path, folder: Path) -> Path | None:
    """Puts `fresh` in the place of `folder`; where the old one is then, None where there was none.

    In one step where the system has it, else in two, between which the folder is not there:
    `locked` puts it back then.
    """
    if not folder.exists():
        fresh.rename(folder)
        sync(folder.parent)
        return None
    if exchange(fresh, folder):
        sync(folder.parent)
        return fresh
    old = folder.with_name(f".{folder.name}.old-{uuid4().hex[:8]}")
    folder.rename(old)
    try:
        fresh.rename(folder)
    except OSError:
        old.rename(folder)
        raise
    sync(folder.parent)
    return old


def exchange(one: Path, other: Path) -> bool:
    """Exchanges two paths in one step; False where the system or the disk has no such step."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    if rename(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE) == 0:
        return True
    code = ctypes.get_errno()
    if code in _NONE:
        return False
    raise OSError(code, os.strerror(code), str(other))


def _bring_back(old: Path, folder: Path) -> None:
    """Moves what is kept of an old folder into the new one, and removes the rest."""
    for entry in sorted(e for e in old.iterdir() if _kept(e, _KEPT)):
        if not (folder / entry.name).exists():
            entry.rename(folder / entry.name)
    sync(folder)
    shutil.rmtree(old, ignore_errors=True)


# --- the lock -------------------------------------------------------------------------------------

_HOLDING: dict[Path, int] = {}  # folders that this process has locked, and how often


@contextmanager
def locked(folder: Path, *, shared: bool = False) -> Iterator[None]:
    """Keep other processes from writing `folder`, or, `shared`, from replacing it.

    What interrupted processes left beside it is put back or removed first. A process may lock a
    folder again. That of a study shares the report's folder that it lies in. Raises `UsageError`
    naming the holder where another process has it, and where no lock can be written.
    """
    folder = folder.resolve()
    if folder in _HOLDING:
        _HOLDING[folder] += 1
        try:
            yield
        finally:
            _HOLDING[folder] -= 1
    elif folder.match(STUDIES):
        with locked(folder.parent, shared=True), _locked(folder, shared=shared):
            yield
    else:
        with _locked(folder, shared=shared):
            yield


@contextmanager
def _locked(folder: Path, *, shared: bool) -> Iterator[None]:
    place = folder.with_name(f".{folder.name[:200]}.lock")
    missing = [p for p in place.parents if not p.exists()]
    descriptor = _taken(place, folder, shared=shared)
    _HOLDING[folder] = 1
    try:
        yield
    finally:
        del _HOLDING[folder]
        with suppress(OSError):  # others share it
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            place.unlink(missing_ok=True)
        os.close(descriptor)
        for parent in missing:
            with suppress(OSError):  # something has moved in
                parent.rmdir()


def _taken(place: Path, folder: Path, *, shared: bool) -> int:
    """The open lock file."""
    while True:
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(place, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            why = f"{why_not(error, folder)}; choose another folder with --out"
            raise UsageError(f"cannot write at {folder}: {why}") from error
        alone = _locks(descriptor, fcntl.LOCK_EX)
        if not (alone or (shared and _locks(descriptor, fcntl.LOCK_SH))):
            holder = os.pread(descriptor, 4096, 0).decode("utf-8", "replace")
            os.close(descriptor)
            raise UsageError(
                f"{folder} is being written by {_named(holder)}; wait for it, or choose another "
                "folder with --out"
            )
        if _is_there(place, descriptor):
            break
        os.close(descriptor)  # removed by its last holder meanwhile
    if alone:
        os.ftruncate(descriptor, 0)
        command = shlex.join(["validate", *sys.argv[1:]]) if sys.argv else "Python"
        holder = json.dumps({
            "command": command[:200], "process": os.getpid(), "host": socket.gethostname(),
            "since": datetime.now(UTC).isoformat(timespec="seconds"),
        })  # fmt: skip
        os.pwrite(descriptor, holder.encode(), 0)
        # Puts back a folder between its two renames and what was kept of an old one; removes the
        # rest. A folder that was being filled holds nothing that is kept, so that all left-overs
        # are alike.
        left = _left_overs(folder)
        old = next((p for p in left if p.name.startswith(f".{folder.name}.old-")), None)
        if old is not None and not folder.exists():
            old.rename(folder)
            left.remove(old)
        for path in left:
            home = path.with_name(path.name[1:].rpartition(".")[0])
            if path.is_dir() and home.is_dir():
                _bring_back(path, home)
            elif path.is_dir() and any(_kept(e, _KEPT) for e in path.iterdir()):
                path.rename(home)  # a study whose page was being made when its place was moved
            else:
                shutil.rmtree(path, ignore_errors=True)
        if left:
            what = "left-over" if len(left) == 1 else "left-overs"
            LOG.warning(f"{folder.name}: {len(left)} {what} of interrupted commands removed")
    if shared:
        fcntl.flock(descriptor, fcntl.LOCK_SH)
    return descriptor


def _locks(descriptor: int, how: int) -> bool:
    try:
        fcntl.flock(descriptor, how | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_there(place: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(place.stat(), os.fstat(descriptor))
    except OSError:
        return False


def _named(holder: str) -> str:
    try:
        told = json.loads(holder)
        where = f"process {told['process']} on {told['host']}, since {told['since']}"
        return f"'{told['command']}' ({where})"
    except (ValueError, KeyError, TypeError):
        return "another process"


# --- what interrupted processes left --------------------------------------------------------------


def _left_overs(folder: Path) -> list[Path]:
    """Beside a folder; inside it those of studies and of their cells."""
    patterns = (f".{escape(folder.name)}.{what}-????????" for what in _LEFT)
    beside = sorted(p for pattern in patterns for p in folder.parent.glob(pattern))
    names = [f".{STUDIES}.{what}-????????" for what in _LEFT]
    names += [f".{CELLS}.try-????????", f"{STUDIES}/.{CELLS}.try-????????"]
    inside = sorted(p for name in names for p in folder.glob(name)) if folder.is_dir() else []
    return beside + inside
