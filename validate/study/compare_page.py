"""Stored runs side by side as a folder: page with pictures, all scores as a table, one document."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from validate.compare.exhibit import Entry, Exhibit, NumberTable, Picture
from validate.compare.result import Result
from validate.report.folder import MARK, replace_folder
from validate.report.store import write_json
from validate.study.stored import Pair, Row, SideBySide, pairs

_PICTURES = 6  # pairs that are drawn
_DRAWN = 40  # scores of a picture


def write_comparison(found: SideBySide, document: dict[str, Any], folder: Path) -> Path:
    """Replaces `folder`; returns the path of report.html. Raises what `replace_folder` does."""
    return replace_folder(folder, lambda f: _fill(found, document, f), ()) / "report.html"


def _fill(found: SideBySide, document: dict[str, Any], folder: Path) -> None:
    # What draws is imported when something is drawn: matplotlib takes half a second.
    from validate.report.exhibits import draw_all, write_files
    from validate.report.html import page

    for name in ("tables", "figures"):
        (folder / name).mkdir()
    write_json(document, folder / MARK)
    result = _result(found)
    drawn = draw_all(result, result.exhibits)
    for exhibit in drawn:
        write_files(exhibit, folder)
    created = datetime.now(UTC).isoformat(timespec="seconds")
    text = page(result, drawn, created, ("open", "Comparison"))
    (folder / "report.html").write_text(text, encoding="utf-8")


def _result(found: SideBySide) -> Result:
    """What a page needs: nothing was run, so it has neither methods nor recordings."""
    names = [f"{r.name} ({r.created})" for r in found.runs]
    shown, _, _ = pairs(found)
    return Result(
        name=" and ".join(dict.fromkeys(r.experiment for r in found.runs)),
        title="Stored runs side by side",
        source="; ".join(names),
        sentence=f"{len(found.rows)} scores of {len(found.runs)} runs, nothing was run again.",
        parameters=(), methods=(), recordings=(), rest=(), effects=(), published=(),
        warnings=found.warnings,
        exhibits=(*(_pair(i, p) for i, p in enumerate(shown, 1)), _parameters(found), _all(found)),
    )  # fmt: skip


def _pair(number: int, pair: Pair) -> Exhibit:
    head = ("method", "score", "one", "other", "difference", "change / %", "unit")
    rows = tuple(_entries(r) for r in pair.rows)
    table = NumberTable(f"pair_{number}", "Scores that both have, SI.", head, rows)
    return Exhibit(f"pair-{number}", f"{pair.one}, then {pair.other}", (), (table,),
                   pictures=_pictures(number, pair))  # fmt: skip


def _pictures(number: int, pair: Pair) -> tuple[Picture, ...]:
    from validate.report.changes import picture

    changed = [(_label(r), r.changes[1]) for r in pair.rows]
    drawn = [(name, c) for name, c in changed if c is not None][:_DRAWN]
    if not drawn or number > _PICTURES:
        return ()
    labels, changes = zip(*drawn, strict=True)
    return (picture(f"changes_{number}", f"From {pair.one} to {pair.other}", labels, changes),)


def _label(row: Row) -> str:
    return f"{row.method}: {row.score}" if row.method else row.score


def _entries(row: Row) -> tuple[Entry, ...]:
    change = row.changes[1]
    percent = None if change is None else 100 * change
    return row.method, row.score, *row.values, row.differences[1], percent, row.unit


def _parameters(found: SideBySide) -> Exhibit:
    names = tuple(f"{r.name} {r.created}" for r in found.runs)
    rows = tuple((path, *values) for path, values in found.parameters.items())
    note = "" if rows else "None differs."
    table = NumberTable("parameters", "Parameters that differ, SI.", ("path", *names), rows, note)
    return Exhibit("parameters", "Parameters", (), (table,))


def _all(found: SideBySide) -> Exhibit:
    """Every score in every column, for the files."""
    rows = tuple((r.method, r.score, r.unit, *r.values) for r in found.rows)
    head = ("method", "score", "unit", *found.columns)
    return Exhibit("scores", "Scores", data=(NumberTable("scores", "Scores, SI.", head, rows),))
