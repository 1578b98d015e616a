"""A folder of results, written beside its place and moved there when complete."""

import shutil
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

from validate.errors import UsageError
from validate.places import REPORT_BYTES, of_the_place, size_of, try_folder, why_not

MARK = "results.json"  # what tells a report folder from a folder of the user
STUDIES = "study-*"  # folders of studies inside a report's: a new report leaves them


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
    """Replaces `folder` by what `fill` writes, but for entries whose names match `keep`.

    The old folder stays until the new one is complete; after any failure nothing of the new one is
    left. Returns the folder's whole path. Raises `UsageError` when it holds something other than
    results, or cannot be written: it says how many bytes were needed and are free.
    """
    folder = folder.resolve()
    _require_replaceable(folder, keep)
    fresh = folder.with_name(f".{folder.name}.new-{uuid4().hex[:8]}")
    try:
        fresh.mkdir(parents=True)
        fill(fresh)
        _swap(fresh, folder, keep)
    except OSError as error:
        if not of_the_place(error):
            raise
        stays = "what was there stays" if folder.exists() else "nothing is left there"
        raise UsageError(
            f"cannot write {folder}: {why_not(error, folder, size_of(fresh))}; {stays}; make room "
            "or choose another folder with --out"
        ) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return folder


def _require_replaceable(folder: Path, keep: tuple[str, ...]) -> None:
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; choose another folder with --out")
    count = len(_own(folder, keep))
    if count and not (folder / MARK).is_file():
        raise UsageError(
            f"{folder} holds {count} entries and no {MARK}, so it is not a report to be replaced; "
            "choose another folder with --out"
        )


def _own(folder: Path, keep: tuple[str, ...]) -> list[Path]:
    """Entries that a replacement would take away."""
    return [e for e in folder.iterdir() if not _kept(e, keep)] if folder.is_dir() else []


def _kept(entry: Path, keep: tuple[str, ...]) -> bool:
    return any(entry.match(pattern) for pattern in keep)


def _swap(fresh: Path, folder: Path, keep: tuple[str, ...]) -> None:
    """Puts `fresh` in the place of `folder`; puts the old one back when that fails."""
    old = folder.with_name(f".{folder.name}.old-{uuid4().hex[:8]}")
    if not folder.exists():
        fresh.rename(folder)
        return
    folder.rename(old)
    try:
        fresh.rename(folder)
    except OSError:
        old.rename(folder)
        raise
    for entry in [e for e in old.iterdir() if _kept(e, keep)]:
        entry.rename(folder / entry.name)
    shutil.rmtree(old)
