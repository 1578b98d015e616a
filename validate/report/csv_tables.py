"""The tables as CSV files: one header line, empty where missing, SI values with a unit column.

The exhibits' tables and charts hold the numbers as shown, with their units in the header.
"""

import csv
import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from validate.compare.exhibit import Chart
from validate.compare.result import Result

Row = Iterable[object]


def write_tables(result: Result, folder: Path) -> None:
    """Writes every table that has rows into `folder`; exhibits may not take a name of these."""
    for name, (head, rows) in TABLES.items():
        found = list(rows(result))
        if found:
            _write(folder / f"{name}.csv", head, found)
    for exhibit in result.exhibits:
        for table in exhibit.tables:
            _write(folder / f"{table.name}.csv", table.headings, table.rows)
        for chart in exhibit.charts:
            head = ("series", "style", f"x: {chart.x}", f"y: {chart.y}", f"upper: {chart.y}")
            _write(folder / f"chart_{chart.name}.csv", head, _points(chart))


def _points(chart: Chart) -> Iterator[Row]:
    """Every point of every series and, as one row without x, every level."""
    for s in chart.series:
        upper = s.upper.tolist() if s.upper is not None else [None] * len(s.x)
        for x, y, top in zip(s.x.tolist(), s.y.tolist(), upper, strict=True):
            yield s.label, s.style, x, y, top
    for name, y in chart.levels:
        yield name, "level", None, float(y), None


def _write(path: Path, head: tuple[str, ...], rows: Iterable[Row]) -> None:
    with path.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(head)
        writer.writerows([_plain(v) for v in row] for row in rows)


def _plain(value: object) -> object:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return repr(float(value)) if isinstance(value, float) else value


def _scores(result: Result) -> Iterator[Row]:
    for m in result.methods:
        for s in m.scores:
            yield m.name, s.name, s.value, s.unit, s.count, s.against, s.definition


def _checks(result: Result) -> Iterator[Row]:
    for m in result.methods:
        for c in m.checks:
            numbers = (c.value, c.limit, c.u_val, c.u_D, c.u_num, c.u_input)
            shown = numbers if c.count else (None, c.limit, None, None, None, None)
            yield m.name, c.name, *shown, c.unit, c.count, c.verdict, c.why


def _effects(result: Result) -> Iterator[Row]:
    for e in result.effects:
        for c in e.changes:
            seen = c.name in e.seen_by
            yield (
                e.name,
                e.doc,
                c.name,
                c.rms,
                c.max,
                c.unit,
                c.separation,
                seen,
                "; ".join(e.would_see),
            )


def _residuals(result: Result) -> Iterator[Row]:
    for m in result.methods:
        for r in m.residuals.values():
            for i, row in enumerate(r.values):
                padded = (*(float(v) for v in row), None, None)[:3]
                length = float(np.linalg.norm(row))
                yield m.name, r.quantity, r.load, i, *padded, length, r.sd, r.unit


def _marker_residuals(result: Result) -> Iterator[Row]:
    for record, registered in zip(result.recordings, result.registered, strict=False):
        if registered.markers is not None:
            found = registered.markers.registration
            for name, at, off in zip(found.names, found.markers, found.residuals, strict=True):
                pair = [(*(float(v) for v in vector), None)[:3] for vector in (at, off)]
                yield record.name, name, *pair[0], *pair[1], "m"


def _published(result: Result) -> Iterator[Row]:
    for p in result.published:
        yield p.name, p.ours, p.theirs, p.tolerance, p.unit, p.verdict, p.reason, p.source


def _identified(result: Result) -> Iterator[Row]:
    for s in result.identified:
        yield s.name, s.value, s.unit, s.count, s.against, s.definition


def _load_displacement(result: Result) -> Iterator[Row]:
    """Every recorded sample and every method's value at its time, where the stage is in m."""
    for i, registered in enumerate(result.registered):
        if registered.stage.unit != "m":
            continue
        name = result.recordings[i].name if i < len(result.recordings) else str(i + 1)
        for s in registered.signals:
            stage = np.interp(s.t, registered.stage.t, registered.stage.y[:, 0])
            for t, q, y in zip(s.t, stage, s.y, strict=True):
                yield name, "measured", s.quantity, float(t), float(q), float(y), s.unit
            for m in result.methods:
                run = m.runs[i]
                if run.finished and s.trace in run.traces:
                    at = np.interp(s.t, run.t, run.traces[s.trace].y)
                    for t, q, y in zip(s.t, stage, at, strict=True):
                        yield name, m.name, s.quantity, float(t), float(q), float(y), s.unit


TABLES = {
    "scores": (
        ("method", "score", "value", "unit", "count", "against", "definition"), _scores,
    ),
    "checks": (
        ("method", "check", "value", "limit", "u_val", "u_D", "u_num", "u_input", "unit", "count",
         "verdict", "why"), _checks,
    ),
    "effects": (
        ("effect", "doc", "quantity", "rms", "max", "unit", "separation", "seen", "would_see"),
        _effects,
    ),
    "residuals": (
        ("method", "quantity", "load", "point", "a", "b", "c", "length", "sd", "unit"), _residuals,
    ),
    "registration": (
        ("recording", "marker", "x", "y", "z", "residual_x", "residual_y", "residual_z", "unit"),
        _marker_residuals,
    ),
    "published": (
        ("figure", "ours", "theirs", "tolerance", "unit", "verdict", "reason", "source"),
        _published,
    ),
    "identified": (
        ("name", "value", "unit", "count", "against", "definition"), _identified,
    ),
    "load_displacement": (
        ("recording", "who", "quantity", "t_s", "stage_m", "value", "unit"), _load_displacement,
    ),
}  # fmt: skip
