"""Page of a study or of several stored runs, without methods and recordings of its own.

It imports no solver: a summary of a thousand runs needs none.
"""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.report.stored.folder import MARK, replace_folder
from validate.report.stored.json_values import Json, write_json


def write_loose(
    told: tuple[str, str, str, str], exhibits: tuple[Exhibit, ...], document: dict[str, Any],
    folder: Path, band: str, warnings: tuple[str, ...] = (),
) -> Path:  # fmt: skip
    """Replace `folder` by a page over stored runs, where nothing was run: page, tables, figures and
    `document` as its results.json; returns the path of report.html.

    `told` are name, title, source and sentence, `band` a word before the sentence. Raises what
    `replace_folder` does.
    """
    result = replace(without_runs(*told), warnings=warnings, exhibits=exhibits)
    created = datetime.now(UTC).isoformat(timespec="seconds")

    def fill(fresh: Path) -> None:
        fill_page(result, document, created, ("plain", band), fresh)

    return replace_folder(folder, fill, ()) / "report.html"


def without_runs(name: str, title: str, source: str, sentence: str) -> Result:
    """Return what a page says that has neither methods nor recordings of its own."""
    return Result(name, title, source, sentence, (), (), (), (), (), ())


def fill_page(
    result: Result, content: Json, created: str, band: tuple[str, str], folder: Path
) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.page.html import page

    for name in ("tables", "figures"):
        (folder / name).mkdir()
    write_json(content, folder / MARK)
    drawn = draw_all(result, result.exhibits)
    for exhibit in drawn:
        write_files(exhibit, folder)
    (folder / "report.html").write_text(page(result, drawn, created, band), encoding="utf-8")
