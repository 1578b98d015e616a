"""Tables of points as one's own scripts write them: a column a coordinate, or a row a point.

`time (s), tip_x (mm), tip_y (mm), tip_z (mm), ...` are markers over time; `name, x, y, z` are
landmarks at one instant. Columns that belong to no point are told, never taken for one.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError, ValidateError
from validate.recording.exports.table import split_unit
from validate.recording.exports.vocabulary import role_of_name, words
from validate.recording.formats.options import above_zero, length, metres, spread
from validate.recording.formats.recorded import distinct, recorded
from validate.recording.formats.text_rows import (
    LEFT_OUT,
    NONE,
    TextRow,
    TextRows,
    as_number,
    fields_above,
    numbers,
    rows_of,
    text_rows,
    told_left,
    whole_points,
)
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Markers, Recording
from validate.units import si_factor

_OPTIONS = ("unit", "sd", "frame", "rate", "time", "z")
_AXES = "xyz"
_LAST = re.compile(r"(?P<name>.*?)(?:[\s_.:-]+(?P<low>[xyzXYZ])|(?<=[a-z0-9])(?P<glued>[XYZ]))")
_FIRST = re.compile(r"(?P<low>[xyzXYZ])[\s_.:-]*(?P<name>[0-9]+|(?<=[\s_.:-])\w+)")
# Three numbers with axes that are no place, as an inertial unit, a force plate or a tracker logs.
_NO_PLACE = re.compile(
    r"(lin(ear)?|ang(ular)?)?[\W_]*(acc\w*|gyr\w*|magn\w*|vel\w*|moment\w*|torque|force|omega|"
    r"rot\w*|quat\w*|orient\w*|euler|q)", re.I
)  # fmt: skip
_LABELS = {"name", "label", "marker", "point", "landmark", "id"}
_ALONE = "point"  # the name of points whose columns are x, y, z and nothing else
_DEEPEST = 40  # lines in which the line of names is looked for


@dataclass(frozen=True)
class _Layout:
    """The line of names: columns of each point, of time, of labels; units; the rows below, and
    values by key of the lines above."""

    points: dict[str, list[int]]
    time: int | None
    label: int | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: list[TextRow]
    above: dict[str, str] = field(default_factory=dict)

    @property
    def columns(self) -> list[int]:
        return [i for columns in self.points.values() for i in columns]


def read_point_table(path: Path, options: Options) -> Recording:
    """Points over time as `markers` (nt, k, 3) m, or rows of named points as `landmarks` (1, k, 3).

    Blank cells and NaN are "not seen". Options: `unit` of length and `time` (its unit) in place of
    the table's, `rate` (Hz) in place of its times, `z` where points have x and y alone, `sd` of a
    coordinate (0: not stated), `frame` (default capture). Raises `UsageError` for what the table
    does not say, `RecordingError` for one without points, or damaged.
    """
    require_known(options, _OPTIONS)
    held = text_rows(path)
    layout = _layout(held)
    if layout is None:
        raise RecordingError(
            f"{held.name}: no line names points: columns such as time (s), tip_x (mm), tip_y (mm), "
            "tip_z (mm), or name, x, y, z, are expected"
        )
    columns = layout.columns + ([] if layout.time is None else [layout.time])
    values, rows, left = numbers(held, layout.rows, len(layout.names), columns)
    x = _points(held, layout, values, rows, options)
    above = layout.above
    factor, stated = metres(options, _one_unit(held, layout) or above.get("units", ""), path.name)
    third = factor if x.shape[2] == len(_AXES) else 1.0
    x = _with_third(held, x, options) * np.array([factor, factor, third])
    landmarks = layout.label is not None
    t = np.zeros(1) if landmarks else _times(held, layout, values, options)
    names = _labels(layout, rows) if landmarks else tuple(layout.points)
    markers = Markers(t, names, x, spread(options), options.get("frame", "capture"))
    told = {"kind": "a table of points", "unit": stated,
            "points_not_seen": f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}",
            **_others(layout), **told_left(left)}  # fmt: skip
    topic = "landmarks" if landmarks else "markers"
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, {topic: markers}, told)


def _points(
    held: TextRows, layout: _Layout, values: Floats, rows: tuple[TextRow, ...], options: Options
) -> Floats:
    """Coordinates (nt, k, d) in the table's unit; of landmarks (1, k, d)."""
    d = len(next(iter(layout.points.values())))
    x = values[:, : len(layout.columns)].reshape(len(values), -1, d)
    x = np.where(np.abs(x) < NONE, x, np.nan)
    if layout.label is not None:
        if np.isnan(x).any():
            raise RecordingError(f"{held.name}: a landmark without coordinates; remove its line")
        return x.reshape(1, -1, d)
    return whole_points(held, x, tuple(layout.points), rows)


def _with_third(held: TextRows, x: Floats, options: Options) -> Floats:
    """Points with the z that the user says, where they have none: in m, as the factor knows."""
    if x.shape[2] == len(_AXES):
        if "z" in options:
            raise UsageError(f"{held.name}: --map z: the points have a z of their own")
        return x
    if "z" not in options:
        raise UsageError(f"{held.name}: points of x and y alone; say where their plane lies: "
                         "--map z=0mm")  # fmt: skip
    z = length(options, "z", "0mm", zero=True) + 0 * x[..., :1]  # NaN where it was not seen
    return np.concatenate([x, z], axis=2)


def _times(held: TextRows, layout: _Layout, values: Floats, options: Options) -> Floats:
    """Seconds from the first row."""
    if "rate" in options:
        return np.arange(len(values)) / above_zero(options, "rate")
    if layout.time is None:
        return np.arange(len(values)) / _frequency(held, layout)
    unit = options.get("time", layout.units[layout.time])
    if not unit:
        raise UsageError(f"{held.name}: '{layout.names[layout.time]}' has no unit; say it: "
                         "--map time=s, or --map rate=HZ")  # fmt: skip
    t = si_factor(unit, "time") * values[:, -1]
    if np.isnan(t).any() or (np.diff(t) <= 0).any():
        at = int(np.argmax(np.isnan(t) | (np.diff(t, prepend=-np.inf) <= 0)))
        raise RecordingError(f"{held.name}: line {layout.rows[at].line}: its time is "
                             "not after the one before; mend it, or say --map rate=HZ")  # fmt: skip
    return np.asarray(t - t[0])


def _frequency(held: TextRows, layout: _Layout) -> float:
    """Hz, as a line above the names states it."""
    stated = as_number(layout.above.get("frequency", "")) or 0.0
    if not 0 < stated < np.inf:
        raise UsageError(f"{held.name}: no column of time; say --map rate=HZ")
    return stated


def _labels(layout: _Layout, rows: Sequence[TextRow]) -> tuple[str, ...]:
    column = layout.label or 0
    return distinct([row.cell(column) for row in rows], len(rows))


def _one_unit(held: TextRows, layout: _Layout) -> str:
    units = {layout.units[i] for i in layout.columns}
    if len(units) > 1:
        shown = ", ".join(repr(u) for u in sorted(units))
        raise UsageError(f"{held.name}: coordinates in {shown}; say one: --map unit=mm")
    return units.pop()


def _others(layout: _Layout) -> dict[str, str]:
    taken = {*layout.columns, layout.time, layout.label}
    left = [repr(n) for i, n in enumerate(layout.names) if i not in taken and n]
    return {LEFT_OUT + ", columns": ", ".join(left)} if left else {}


# --- the line of names ----------------------------------------------------------------------------


def _layout(held: TextRows) -> _Layout | None:
    for i, row in enumerate(held.rows[:_DEEPEST]):
        if row.cell(0).startswith("#") and not row.cell(0).lstrip("# "):
            continue
        found = _of_line(row, list(held.rows[i + 1 :]))
        if found is not None:
            return replace(found, above=fields_above(held, row))
    return None


def _of_line(row: TextRow, below: list[TextRow]) -> _Layout | None:
    cells = (row.cell(0).lstrip("# "), *row.cells[1:])
    if any(as_number(c) is not None for c in cells):
        return None
    split = [split_unit(c) for c in cells]
    names, units = [n for n, _ in split], [u or "" for _, u in split]
    points = _points_of(names)
    if not points:
        return None
    below = [r for r in below if any(r.cells) and not r.cell(0).startswith("#")]
    if below and all(as_number(c) is None for c in below[0].cells if c) and not _label(names):
        units = [u or below[0].cell(i).strip("()[] ") for i, u in enumerate(units)]
        below = below[1:]
    time = next((i for i, n in enumerate(names) if role_of_name(n) == "time"), None)
    label = _label(names) if list(points) == [_ALONE] and time is None else None
    return _Layout(points, time, label, cells, tuple(units), below)


def _label(names: Sequence[str]) -> int | None:
    """The column that names the points, a row each."""
    return next((i for i, n in enumerate(names) if words(n) & _LABELS), None)


def _points_of(names: Sequence[str]) -> dict[str, list[int]]:
    """Columns of x, y, z of each point (of x, y where none has a z); none where they differ."""
    found: dict[str, dict[str, int]] = {}
    for i, name in enumerate(names):
        axis, whose = _axis_of(name)
        if axis and found.setdefault(whose, {}).setdefault(axis, i) != i:
            return {}
    whole = {n: a for n, a in found.items() if {"x", "y"} <= a.keys()}
    axes = [c for c in _AXES if any(c in a for a in whole.values())]
    return {n: [a[c] for c in axes] for n, a in whole.items() if len(a) == len(axes)}


def _axis_of(name: str) -> tuple[str, str]:
    """The axis and the point of a column's name; empty where it is none."""
    text = name.strip()
    if text.lower() in ("x", "y", "z"):
        return text.lower(), _ALONE
    if (last := _LAST.fullmatch(text)) and _NO_PLACE.fullmatch(last["name"]):
        return "", ""
    if last and last["name"]:
        return (last["low"] or last["glued"]).lower(), last["name"]
    first = _FIRST.fullmatch(text)
    return (first["low"].lower(), first["name"]) if first else ("", "")


def _recognises(path: Path) -> bool:
    """Text whose first lines have one that names points, and none of a force: such a log is a
    testing machine's first, and its points come in by --as."""
    begin = head(path)
    begin = begin[: begin.rfind(b"\n") + 1]
    if not begin or 0 in begin[:2]:
        return False
    try:
        layout = _layout(rows_of(path.name, begin))
    except ValidateError:
        return False
    return layout is not None and "force" not in map(role_of_name, layout.names)


POINTS = Reader(
    "points",
    "a table of points (CSV)",
    _recognises,
    read_point_table,
    "a line names coordinates of points",
)
