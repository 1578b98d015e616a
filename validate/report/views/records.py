"""Tables and charts declared over records: a heading and the attribute of each column.

table("costs", "Time of a step", rows, {"mesh": "level", "p50 / us": "step.p50"})
chart("cost", "Cost", ("cells / 1", "cells"), ("time / us", "step.p50"), grouped(rows, "solver"))
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, NumberTable, Series, TableCell
from validate.units import si_of

Shown = str | Callable[[Any], Any]  # a path as "step.p50", or a function of the record
Axis = tuple[str, Shown]  # what stands at an axis, and what is drawn along it
Groups = Mapping[str, Sequence[Any]]  # records by the label of their line
_NONE: Mapping[str, Any] = MappingProxyType({})


def table(
    name: str,
    title: str,
    records: Iterable[Any],
    columns: Mapping[str, Shown],
    note: str = "",
    *,
    folded: bool = False,
    below: str = "",
) -> NumberTable:
    """Return a row for each record and a column for each heading.

    Numbers of records are SI; a heading as "time / us" shows them in its unit. The other arguments
    are those of `NumberTable`. Raises `AttributeError` for a path that a record does not have.
    """
    sizes = [per_unit(heading) for heading in columns]
    rows = tuple(
        tuple(_scaled(value(r, of), by) for of, by in zip(columns.values(), sizes, strict=True))
        for r in records
    )
    return NumberTable(name, title, tuple(columns), rows, note, folded, below)


def objects(records: Iterable[Any], members: Mapping[str, Shown]) -> list[dict[str, Any] | None]:
    """Return each record as a JSON object of these members, numbers as they are; None as null."""
    return [r and {name: value(r, of) for name, of in members.items()} for r in records]


def chart(
    name: str,
    title: str,
    x: Axis,
    y: Axis,
    points: Groups = _NONE,
    lines: Groups = _NONE,
    levels: Mapping[str, float] = _NONE,
    log: Literal["", "x", "y", "xy"] = "",
    caption: str = "",
) -> Chart:
    """Return y over x of each group of records as `points` or as `lines`, and SI `levels` of y.

    Units are as in `table`. Records that lack x or y are left out, and groups of such records.
    """
    series = []
    styles: Mapping[Literal["points", "line"], Groups] = {"points": points, "line": lines}
    for style, groups in styles.items():
        for label, records in groups.items():
            drawn = [r for r in records if None not in (value(r, x[1]), value(r, y[1]))]
            if drawn:
                series.append(Series(label, _along(x, drawn), _along(y, drawn), style))
    by = per_unit(y[0])
    named = tuple((label, by * level) for label, level in levels.items())
    return Chart(name, title, x[0], y[0], tuple(series), named, log, caption)


def grouped(records: Iterable[Any], by: Shown) -> dict[str, list[Any]]:
    """Return the records by what `by` shows of them, in the order of its first appearance."""
    found: dict[str, list[Any]] = {}
    for record in records:
        found.setdefault(str(value(record, by)), []).append(record)
    return found


def value(record: Any, of: Shown) -> Any:
    """Return what `of` shows of a record: by its path attributes, keys of mappings and numbers of
    tuples; None where a part of the path is None."""
    if callable(of):
        return of(record)
    for name in of.split("."):
        if isinstance(record, Mapping):
            record = record.get(name)
        elif record is not None:
            record = record[int(name)] if name.isdigit() else getattr(record, name)
    return record


def sized(of: Shown, unit: Shown = "unit") -> Shown:
    """Return what shows a number in the SI unit that `unit` shows of the same record."""
    return lambda record: TableCell(value(record, of), value(record, unit))


def per_unit(heading: str) -> float:
    """Return how many of its unit a heading as "error / mm (paired)" shows of one SI unit."""
    name, _, unit = heading.rpartition(" / ")
    return 1 / si_of(unit.partition(" (")[0])[0] if name else 1.0


def _scaled(found: Any, by: float) -> Any:
    return by * found if isinstance(found, float) and by != 1 else found


def _along(axis: Axis, records: Sequence[Any]) -> Floats:
    return per_unit(axis[0]) * np.array([value(r, axis[1]) for r in records], dtype=np.float64)
