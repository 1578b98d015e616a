"""A folder of results, written beside its place and moved there when complete."""

import shutil
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

from validate.errors import UsageError

MARK = "results.json"  # what tells a report folder from a folder of the user
STUDIES = "study-*"  # folders of studies inside a report's: a new report leaves them


def replace_folder(folder: Path, fill: Callable[[Path], None], keep: tuple[str, ...]) -> Path:
    """Replaces `folder` by what `fill` writes, but for entries whose names match `keep`.

    The old folder stays until the new one is complete; after any failure nothing of the new one is
    left. Returns the folder's whole path. Raises `UsageError` when it holds something other than
    results, or cannot be written.
    """
    folder = folder.resolve()
    _require_replaceable(folder, keep)
    fresh = folder.with_name(f".{folder.name}.new-{uuid4().hex[:8]}")
    try:
        fresh.mkdir(parents=True)
    except OSError as error:
        raise UsageError(
            f"cannot write beside {folder}: {error.strerror}; choose another folder with --out"
        ) from error
    try:
        fill(fresh)
        _swap(fresh, folder, keep)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return folder


def _require_replaceable(folder: Path, keep: tuple[str, ...]) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise UsageError(f"{folder} is a file; choose another folder with --out")
    count = sum(1 for entry in folder.iterdir() if not _kept(entry, keep))
    if count and not (folder / MARK).is_file():
        raise UsageError(
            f"{folder} holds {count} entries and no {MARK}, so it is not a report to be replaced; "
            "choose another folder with --out"
        )


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
