"""The report folder, written beside its place and moved there when complete."""

from collections.abc import Callable
from pathlib import Path

from validate.compare.result import Result
from validate.report.csv_tables import write_tables
from validate.report.encode import gif, png
from validate.report.exhibits import require_distinct
from validate.report.folder import MARK, STUDIES, replace_folder
from validate.report.html import SECTIONS, page
from validate.report.page import Section, listed
from validate.report.replay_mcap import write_replay
from validate.report.store import document, write_json, write_runs

Progress = Callable[[str], None]


def write_report(
    result: Result, folder: Path, *, created: str, progress: Progress | None = None
) -> Path:
    """Replaces `folder` by the report of `result`; returns the path of its report.html.

    `created` is a UTC time, ISO-8601. The old folder stays until the new one is complete; after any
    failure nothing of the new one is left; folders of studies in it are kept. Raises `UsageError`
    when `folder` holds something other than a report, or cannot be written; `ComparisonError` when
    two parts of the exhibits share a name.
    """
    require_distinct(result.exhibits)
    told = progress or _silent
    folder = replace_folder(folder, lambda f: _fill(result, f, created, told), (STUDIES,))
    return folder / "report.html"


def _silent(_: str) -> None:
    pass


def _fill(result: Result, folder: Path, created: str, progress: Progress) -> None:
    for name in ("tables", "figures", "runs"):
        (folder / name).mkdir()
    progress("tables and runs")
    write_json(document(result, created), folder / MARK)
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
