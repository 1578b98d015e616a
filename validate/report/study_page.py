"""The folder of a study: results.json, tables, figures and one page, as a report's are."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.compare.result import Result
from validate.report import exhibits, provenance
from validate.report.csv_tables import write_tables
from validate.report.encode import png
from validate.report.folder import MARK, replace_folder
from validate.report.html import page
from validate.report.page import listed
from validate.report.store import document, write_json

Row = tuple[object, ...]
_SECTIONS = (exhibits.exhibits, provenance.parameters)
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

    Raises what `replace_folder` and `require_distinct` do.
    """
    exhibits.require_distinct(shown.result.exhibits)
    return replace_folder(folder, lambda f: _fill(shown, f, created), shown.keep) / "report.html"


def _fill(shown: StudyPage, folder: Path, created: str) -> None:
    for name in ("tables", "figures"):
        (folder / name).mkdir()
    content = {**document(shown.result, created), "study": shown.study}
    if shown.passed is not None:
        content["passed"] = shown.passed
    write_json(content, folder / MARK)
    write_tables(shown.result, folder / "tables")
    head, rows = shown.cells
    with (folder / "tables" / "cells.csv").open("w", newline="", encoding="utf-8") as out:
        csv.writer(out).writerows([head, *(["" if v is None else v for v in r] for r in rows)])
    sections = tuple(s for make in _SECTIONS for s in listed(make(shown.result)))
    for section in sections:
        for picture in section.pictures:
            (folder / "figures" / f"{picture.name}.png").write_bytes(png(picture))
    text = page(shown.result, sections, created, shown.band)
    (folder / "report.html").write_text(text, encoding="utf-8")
