"""A page over runs that are stored: nothing was run, so it has neither methods nor recordings."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.report.folder import MARK, replace_folder
from validate.report.store import write_json


def write_loose(
    told: tuple[str, str, str, str], exhibits: tuple[Exhibit, ...], document: dict[str, Any],
    folder: Path, band: str, warnings: tuple[str, ...] = (),
) -> Path:  # fmt: skip
    """Replaces `folder` by page, tables, figures and `document` as its results.json; returns the
    path of report.html.

    `told` are name, title, source and sentence, `band` a word before the sentence. Raises what
    `replace_folder` does.
    """
    name, title, source, sentence = told
    result = Result(
        name=name, title=title, source=source, sentence=sentence, parameters=(), methods=(),
        recordings=(), rest=(), effects=(), published=(), warnings=warnings, exhibits=exhibits,
    )  # fmt: skip
    return replace_folder(folder, lambda f: _fill(result, document, f, band), ()) / "report.html"


def _fill(result: Result, document: dict[str, Any], folder: Path, band: str) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.html import page

    for name in ("tables", "figures"):
        (folder / name).mkdir()
    write_json(document, folder / MARK)
    drawn = draw_all(result, result.exhibits)
    for exhibit in drawn:
        write_files(exhibit, folder)
    created = datetime.now(UTC).isoformat(timespec="seconds")
    text = page(result, drawn, created, ("open", band))
    (folder / "report.html").write_text(text, encoding="utf-8")
