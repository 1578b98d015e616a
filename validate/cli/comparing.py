"""`validate compare`."""

import json
from pathlib import Path
from typing import Any

from validate.cli.display import console, shown, table
from validate.study.stored import Row, SideBySide, read_run, side_by_side


def compare(paths: tuple[Path, ...], as_json: bool) -> None:
    """Prints stored runs side by side; raises when nothing can be compared."""
    found = side_by_side([read_run(path) for path in paths])
    if as_json:
        print(json.dumps(document(found), allow_nan=False, ensure_ascii=False, indent=1))
        return
    screen, error = console(), console(error=True)
    for warning in found.warnings:
        error.print(f"warning: {warning}", soft_wrap=True)
    head = ["method", "score", *found.columns, *(f"change of {c}" for c in found.columns[1:])]
    screen.print(table("Scores", head, [_row(r) for r in found.rows]))
    if found.parameters:
        rows = [[path, *values] for path, values in found.parameters.items()]
        names = [f"{r.name} ({r.created})" for r in found.runs]
        screen.print(table("\nParameters that differ", ["path", *names], rows))
    else:
        screen.print("\nNo parameter differs.")
    screen.print(f"\n{len(found.rows)} scores of {len(found.runs)} runs compared")


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


def _row(row: Row) -> list[str]:
    values = ["–" if v is None else shown(v, row.unit) for v in row.values]
    changes = ["–" if c is None else f"{100 * c:+.3g} %" for c in row.changes[1:]]
    return [row.method or "–", row.score, *values, *changes]
