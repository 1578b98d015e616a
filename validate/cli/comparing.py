"""`validate compare`."""

import json
from pathlib import Path
from typing import Any

from validate.cli.display import say, table, warn
from validate.report.numbers import shown_unit, significant, text
from validate.study.stored import Pair, Row, SideBySide, pairs, read_run, side_by_side


def compare(paths: tuple[Path, ...], as_json: bool) -> None:
    """Prints stored runs side by side; raises when nothing can be compared."""
    found = side_by_side([read_run(path) for path in paths])
    if as_json:
        print(json.dumps(document(found), allow_nan=False, ensure_ascii=False, indent=1))
    else:
        _show(found)


def _show(found: SideBySide) -> None:
    for warning in found.warnings:
        warn(warning, error=True)
    shown, more, unseen = pairs(found)
    for pair in shown:
        _scores(pair)
    if more or unseen:
        left = f"left out: {more} pairs of methods, {unseen} scores; --json has all"
        say(f"\n{left}")
    if found.parameters:
        rows = [[path, *values] for path, values in found.parameters.items()]
        names = [f"{r.name} {r.created}" for r in found.runs]
        table("Parameters that differ", ["path", *names], rows)
    else:
        say("\nNo parameter differs.")
    say(f"\n{len(found.rows)} scores of {len(found.runs)} runs compared")


def document(found: SideBySide) -> dict[str, Any]:
    """The comparison as one JSON document, SI."""
    return {
        "runs": [
            {"name": r.name, "experiment": r.experiment, "created": r.created,
             "recordings": list(r.recordings), "quick": r.quick}
            for r in found.runs
        ],
        "columns": list(found.columns),
        "scores": [
            {"method": r.method or None, "score": r.score, "unit": r.unit,
             "values": list(r.values), "differences": list(r.differences),
             "changes": list(r.changes)}
            for r in found.rows
        ],
        "parameters": {path: list(values) for path, values in found.parameters.items()},
        "warnings": list(found.warnings),
    }  # fmt: skip


def _scores(pair: Pair) -> None:
    """One table of two columns, which fits where a table of all would not."""
    by_method = any(r.method for r in pair.rows)
    head = ["score", "one", "other", "difference", "unit"]
    rows = [_row(r) for r in pair.rows]
    if by_method:
        head = ["method", *head]
        rows = [[r.method, *row] for r, row in zip(pair.rows, rows, strict=True)]
    table(f"One: {pair.one}; other: {pair.other}", head, rows)


def _row(row: Row) -> list[str]:
    one, other = row.values
    difference, change = text(row.differences[1], row.unit), row.changes[1]
    if change:
        difference += f" ({'+' if change > 0 else ''}{significant(100 * change)} %)"
    values = [text(one, row.unit), text(other, row.unit)]
    return [row.score, *values, difference, shown_unit(row.unit)]
