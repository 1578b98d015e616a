"""The report folder, written beside its place and moved there when complete."""

from collections.abc import Callable
from pathlib import Path

from validate.compare.result import Result
from validate.report.folder import MARK, STUDIES, replace_folder
from validate.report.made import Made
from validate.report.store import document, write_json, write_runs
from validate.report.verdicts import band

Progress = Callable[[str], None]


def write_report(
    result: Result,
    folder: Path,
    *,
    created: str,
    made: Made | None = None,
    progress: Progress | None = None,
) -> Path:
    """Replaces `folder` by the report of `result`; returns the path of its report.html.

    `created` is a UTC time, ISO-8601; `made` says what made the result. The old folder stays until
    the new one is complete; after any failure nothing of the new one is left; folders of studies in
    it are kept. Raises `UsageError` when `folder` holds something other than a report, or cannot be
    written; `ComparisonError` when two parts of the exhibits share a name.
    """
    told, by = progress or _silent, made or Made()
    folder = replace_folder(folder, lambda f: _fill(result, f, created, by, told), (STUDIES,))
    return folder / "report.html"


def _silent(_: str) -> None:
    pass


def _fill(result: Result, folder: Path, created: str, made: Made, progress: Progress) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.html import page
    from validate.report.provenance import how
    from validate.report.replay_mcap import write_replay
    from validate.report.sections import exhibits

    for name in ("tables", "figures", "runs"):
        (folder / name).mkdir()
    progress("runs")
    write_json(document(result, created, made), folder / MARK)
    write_runs(result, folder / "runs")
    progress("replay")
    write_replay(result, folder / "replay.mcap")
    shown = draw_all(result, (*exhibits(result, progress), how(result, made)))
    for exhibit in shown:
        write_files(exhibit, folder)
    progress("page")
    (folder / "report.html").write_text(page(result, shown, created, band(result)), "utf-8")
