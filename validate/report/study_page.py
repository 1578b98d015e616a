"""The folder of a study: results.json, tables, figures and one page, as a report's are."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.compare.result import Result
from validate.report.folder import MARK, replace_folder
from validate.report.store import document, write_json
from validate.report.tables import write_csv

Row = tuple[Any, ...]
_BAND = ("open", "Study")


@dataclass(frozen=True)
class StudyPage:
    """A result without methods whose exhibits are the study; `study` goes into results.json.

    `cells`: head and rows of tables/cells.csv, SI. `keep`: names of entries that stay as they are.
    `passed`: whether the study's own checks hold (None: it has none); `band` as `html.page` takes.
    """

    result: Result
    study: dict[str, Any]
    cells: tuple[tuple[str, ...], tuple[Row, ...]]
    keep: tuple[str, ...]
    passed: bool | None = None
    band: tuple[str, str] = _BAND


def write_study_page(shown: StudyPage, folder: Path, created: str) -> Path:
    """Replaces `folder` but for what is kept; returns the path of its report.html.

    Raises what `replace_folder` and `draw_all` do.
    """
    return replace_folder(folder, lambda f: _fill(shown, f, created), shown.keep) / "report.html"


def _fill(shown: StudyPage, folder: Path, created: str) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.html import page
    from validate.report.provenance import parameters

    for name in ("tables", "figures"):
        (folder / name).mkdir()
    content = {**document(shown.result, created), "study": shown.study}
    if shown.passed is not None:
        content["passed"] = shown.passed
    write_json(content, folder / MARK)
    write_csv(folder / "tables" / "cells.csv", *shown.cells)
    drawn = draw_all(shown.result, (*shown.result.exhibits, parameters(shown.result)))
    for exhibit in drawn:
        write_files(exhibit, folder)
    text = page(shown.result, drawn, created, shown.band)
    (folder / "report.html").write_text(text, encoding="utf-8")
