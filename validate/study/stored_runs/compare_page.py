"""Folder of a comparison of stored runs: page with figures, table of scores, one document."""

from pathlib import Path
from typing import Any

from validate.compare.exhibit import Exhibit, NumberTable, Picture
from validate.report.views.records import table
from validate.study.loose_page import write_loose
from validate.study.stored_runs.score_comparison import Pair, SideBySide, pairs

_PICTURES = 6  # pairs that are drawn
_DRAWN = 40  # scores of a picture


def write_comparison(found: SideBySide, document: dict[str, Any], folder: Path) -> Path:
    """Replace `folder`; returns the path of report.html. Raises what `replace_folder` does."""
    told = (
        " and ".join(dict.fromkeys(r.experiment for r in found.runs)),
        "Stored runs side by side",
        "; ".join(f"{r.name} ({r.created})" for r in found.runs),
        f"{len(found.rows)} scores of {len(found.runs)} runs, nothing was run again.",
    )
    shown, _, _ = pairs(found)
    drawn = (_pair(i, p) for i, p in enumerate(shown, 1))
    exhibits = (*drawn, _parameters(found), _all(found))
    return write_loose(told, exhibits, document, folder, "Comparison", found.warnings)


_PAIR = {
    "method": "method", "score": "score", "one": "values.0", "other": "values.1",
    "difference": "differences.1", "change / %": "changes.1", "unit": "unit",
}  # fmt: skip


def _pair(number: int, pair: Pair) -> Exhibit:
    scores = table(f"pair_{number}", "Scores that both have, SI.", pair.rows, _PAIR)
    return Exhibit(f"pair-{number}", f"{pair.one}, then {pair.other}", (), (scores,),
                   pictures=_pictures(number, pair))  # fmt: skip


def _pictures(number: int, pair: Pair) -> tuple[Picture, ...]:
    from validate.report.charts.changes import picture

    changed = [(f"{r.method}: {r.score}" if r.method else r.score, r.changes[1]) for r in pair.rows]
    drawn = [(name, c) for name, c in changed if c is not None][:_DRAWN]
    if not drawn or number > _PICTURES:
        return ()
    labels, changes = zip(*drawn, strict=True)
    return (picture(f"changes_{number}", f"From {pair.one} to {pair.other}", labels, changes),)


def _parameters(found: SideBySide) -> Exhibit:
    names = tuple(f"{r.name} {r.created}" for r in found.runs)
    rows = tuple((path, *values) for path, values in found.parameters.items())
    note = "" if rows else "None differs."
    table = NumberTable("parameters", "Parameters that differ, SI.", ("path", *names), rows, note)
    return Exhibit("parameters", "Parameters", (), (table,))


def _all(found: SideBySide) -> Exhibit:
    """Every score in every column, for the files."""
    values = {column: f"values.{i}" for i, column in enumerate(found.columns)}
    columns = {"method": "method", "score": "score", "unit": "unit", **values}
    return Exhibit("scores", "Scores", data=(table("scores", "Scores, SI.", found.rows, columns),))
