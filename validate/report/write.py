"""The report folder, written beside its place and moved there when complete."""

import shutil
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

from validate.compare.result import Result
from validate.errors import UsageError
from validate.report.csv_tables import write_tables
from validate.report.encode import gif, png
from validate.report.exhibits import require_distinct
from validate.report.html import SECTIONS, page
from validate.report.page import Section, listed
from validate.report.replay_mcap import write_replay
from validate.report.store import document, write_json, write_runs

Progress = Callable[[str], None]
_MARK = "results.json"  # what tells a report folder from a folder of the user


def write_report(
    result: Result, folder: Path, *, created: str, progress: Progress | None = None
) -> Path:
    """Replaces `folder` by the report of `result`; returns the path of its report.html.

    `created` is a UTC time, ISO-8601. The old folder stays until the new one is complete; after any
    failure nothing of the new one is left. Raises `UsageError` when `folder` holds something other
    than a report, or cannot be written; `ComparisonError` when two parts of the exhibits share a
    name.
    """
    require_distinct(result.exhibits)
    folder = folder.resolve()
    _require_replaceable(folder)
    fresh = folder.with_name(f".{folder.name}.new-{uuid4().hex[:8]}")
    try:
        fresh.mkdir(parents=True)
    except OSError as error:
        raise UsageError(
            f"cannot write beside {folder}: {error.strerror}; choose another folder with --out"
        ) from error
    try:
        _fill(result, fresh, created, progress or _silent)
        _swap(fresh, folder)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return folder / "report.html"


def _silent(_: str) -> None:
    pass


def _require_replaceable(folder: Path) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise UsageError(f"{folder} is a file; choose another folder with --out")
    count = sum(1 for _ in folder.iterdir())
    if count and not (folder / _MARK).is_file():
        raise UsageError(
            f"{folder} holds {count} entries and no {_MARK}, so it is not a report to be replaced; "
            "choose another folder with --out"
        )


def _fill(result: Result, folder: Path, created: str, progress: Progress) -> None:
    for name in ("tables", "figures", "runs"):
        (folder / name).mkdir()
    progress("tables and runs")
    write_json(document(result, created), folder / _MARK)
    write_tables(result, folder / "tables")
    write_runs(result, folder / "runs")
    progress("replay")
    write_replay(result, folder / "replay.mcap")
    shown: list[Section] = []
    for name, make in SECTIONS:
        progress(name)
        for section in listed(make(result)):
            shown.append(section)
            for picture in section.pictures:
                (folder / "figures" / f"{picture.name}.png").write_bytes(png(picture))
            for animation in section.animations:
                (folder / "figures" / f"{animation.name}.gif").write_bytes(gif(animation))
    progress("page")
    text = page(result, tuple(shown), created)
    (folder / "report.html").write_text(text, encoding="utf-8")


def _swap(fresh: Path, folder: Path) -> None:
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
    shutil.rmtree(old)
