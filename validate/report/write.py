"""The report folder, written beside its place and moved there when complete."""

from collections.abc import Callable
from pathlib import Path

from validate.compare.result import Result
from validate.report.folder import MARK, STUDIES, replace_folder
from validate.report.history import carried, write_lines
from validate.report.made import Made
from validate.report.plain import Json
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
    vtu: bool = False,
) -> Path:
    """Replaces `folder` by the report of `result`; returns the path of its report.html.

    `created` is a UTC time, ISO-8601; `made` says what made the result; `vtu` adds `paraview/`. The
    old folder stays until the new one is complete; after any failure nothing of the new one is
    left; folders of studies in it are kept, and a line of the run that was there, unless all that
    made it is equal. Raises
    `UsageError` when `folder` holds something other than a report, or cannot be written;
    `ComparisonError` when two parts of the exhibits share a name.
    """
    told, by = progress or _silent, made or Made()
    content = document(result, created, by)
    lines = carried(folder, content)

    def fill(fresh: Path) -> None:
        write_lines(lines, fresh)
        _fill(result, fresh, content, by, told)
        if vtu:
            from validate.report.paraview import write_series

            write_series(result, fresh / "paraview", told)

    folder = replace_folder(folder, fill, (STUDIES,))
    return folder / "report.html"


def _silent(_: str) -> None:
    pass


def _fill(result: Result, folder: Path, content: Json, made: Made, progress: Progress) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.html import page
    from validate.report.provenance import how
    from validate.report.replay_mcap import write_replay
    from validate.report.sections import exhibits

    for name in ("tables", "figures", "runs"):
        (folder / name).mkdir()
    progress("runs")
    write_json(content, folder / MARK)
    write_runs(result, folder / "runs")
    progress("replay")
    write_replay(result, folder / "replay.mcap")
    shown = draw_all(result, (*exhibits(result, progress), how(result, made)))
    for exhibit in shown:
        write_files(exhibit, folder)
    progress("page")
    text = page(result, shown, content["created"], band(result))
    (folder / "report.html").write_text(text, "utf-8")
