"""Logs of NDI's trackers as CSV text: position (mm) and quaternion of each tool, line by line.

Columns are told by their names: three of position and four of a quaternion beside each other, in
either order, with a state before them or none. A tool that was not seen has seven zeros, blank
cells, or another state than OK: no sample.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.errors import RecordingError, UsageError
from validate.recording.formats.options import above_zero, length
from validate.recording.formats.poses import pose_signals, rotations
from validate.recording.formats.recorded import begun, recorded
from validate.recording.formats.text_rows import (
    ASSUMED,
    NONE,
    TextRow,
    TextRows,
    fields_above,
    numbers,
    text_rows,
    told_left,
)
from validate.recording.formats.tool_columns import Tool, clock_of_columns, tools_of
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Recording, Stream

# A column that says of which tool a line is, where each tool has lines of its own.
_WHOSE = re.compile(
    r"(tool|sensor|port|marker|body|handle)?\W*_?(id|name|handle|number|no|serial)?"
)
_MOMENT = re.compile(
    r"(?:(\d{4})-(\d\d)-(\d\d)[T ])?(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(?:Z|[+-]\d\d:?\d\d)?"
)
_OPTIONS = ("unit", "rate", "frame", "ok")
_OK = ("", "ok", "enabled", "valid", "visible", "tracked", "true", "yes")
_DAY = 86400.0  # s
_MOST_TOOLS = 64


def read_ndi(path: Path, options: Options) -> Recording:
    """Each tool as `<tool>/rotation` (nt, 9) and `<tool>/translation` (nt, 3) m, as poses of
    tracked sequences are.

    Options: `unit` in place of NDI's mm, `rate` (Hz) where no column is a time, `frame` (default
    tracker), `ok`: the state in which a tool is seen. A tool never seen is listed as unread. Raises
    `UsageError` without times, `RecordingError` for a table without tools, one in which nothing was
    seen, or damaged.
    """
    require_known(options, _OPTIONS)
    held = text_rows(path)
    header = _header(held)
    tools, above = tools_of(header), fields_above(held, header)
    options = {**({"rate": above["frequency"]} if "frequency" in above else {}), **options}
    clock = clock_of_columns(header)
    body = _rows(held, header, [i for i, _ in clock])
    columns = [*(i for tool in tools for i in (*tool.position, *tool.turn)), *(i for i, _ in clock)]
    values, rows, left = numbers(held, body, _width(header, body), columns)
    whose = _whose(header, rows, tools)
    t = _times(held, values[:, 7 * len(tools) :], [f for _, f in clock], options, whose)
    stated = tools[0].unit or above.get("units", "")
    if not stated and "unit" not in options and header.cell(0).startswith("#"):
        raise UsageError(f"{path.name}: has no unit of length; give --map unit=m (as in TUM "
                         f"trajectories) or unit=mm")  # fmt: skip
    factor = length({"unit": stated or "mm", **options}, "unit", "mm")
    frame = options.get("frame", "tracker")
    streams: dict[str, Stream] = {}
    told = {}
    good = (options["ok"].lower(),) if "ok" in options else _OK
    for name, k, own in _tracks(tools, whose):
        pose = values[own, 7 * k : 7 * k + 7]
        pose = np.where(np.abs(pose) < NONE, pose, np.nan)
        seen = _seen(pose, tools[k], [rows[i] for i in own], good)
        told[name] = f"{int((~seen).sum())} of {len(seen)}"
        if seen.any():
            R = rotations(pose[seen, 3:], f"{path.name}: {name}")
            streams |= pose_signals(name, t[own][seen], R, factor * pose[seen, :3], frame)
    if not streams:
        states = sorted({row.cell(t.state) for row in rows for t in tools if t.state is not None})
        which = (
            f"; name the state that means visible, of {states[:6]}: --map ok=..." if states else ""
        )
        raise RecordingError(f"{path.name}: no tool is visible: {told}{which}")
    said = options.get("unit", stated)
    unit = (
        {"unit": said}
        if said
        else {ASSUMED: "lengths in mm, as NDI writes; if not, give --map unit=m"}
    )
    return _recording(path, streams, told, {**unit, **told_left(left)})


def _whose(header: TextRow, rows: Sequence[TextRow], tools: Sequence[Tool]) -> list[str]:
    """The tool of every line, where one group of columns holds lines of several; else no names."""
    taken = {i for tool in tools for i in (*tool.position, *tool.turn, tool.state)}
    for i, cell in enumerate(header.cells):
        if len(tools) == 1 and i not in taken and cell and _WHOSE.fullmatch(cell.lower()):
            names = [row.cell(i) for row in rows]
            # One that numbers the lines has no value twice.
            if 1 < len(set(names)) <= min(_MOST_TOOLS, len(names) // 2):
                return names
    return [""] * len(rows)


def _tracks(tools: Sequence[Tool], whose: Sequence[str]) -> list[tuple[str, int, Ints]]:
    """Name, group of columns and numbers of the lines of each tool."""
    every = np.array(whose)
    if len(names := dict.fromkeys(whose)) > 1:
        return [(name or "unnamed", 0, np.flatnonzero(every == name)) for name in names]
    return [(tool.name, k, np.arange(len(whose))) for k, tool in enumerate(tools)]


def _recording(
    path: Path, streams: dict[str, Stream], missing: dict[str, str], more: dict[str, str]
) -> Recording:
    never = {name: "never seen" for name in missing if f"{name}/rotation" not in streams}
    told = {
        "kind": "tracker log (NDI)",
        "not_seen": "; ".join(f"{name}: {count}" for name, count in missing.items()),
        **more,
    }
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, begun(streams), told, never)


def _width(header: TextRow, body: Sequence[TextRow]) -> int:
    """Columns; those after a name that ends in dots, as of NDI's own sample, go on."""
    last = next((c for c in reversed(header.cells) if c), "")
    return (
        max((len(r.cells) for r in body), default=0) if last.endswith("...") else len(header.cells)
    )


def _rows(held: TextRows, header: TextRow, clock: Sequence[int]) -> list[TextRow]:
    """Rows below the header, times of the day as seconds, days counted from the first."""
    body = [r for r in held.rows if r.line > header.line and any(r.cells)]
    dated = [m for r in body[:1] for i in clock if (m := _MOMENT.fullmatch(r.cell(i)))]
    if not dated:
        return body
    first = _day(dated[0])
    return [
        replace(
            r, cells=tuple(_second(c, first) if i in clock else c for i, c in enumerate(r.cells))
        )
        for r in body
    ]


def _day(found: re.Match[str]) -> int:
    return date(*(int(v) for v in found.groups()[:3])).toordinal() if found[1] else 0


def _second(cell: str, first: int) -> str:
    """Seconds from the beginning of the first day, as text; what is no time as it is."""
    found = _MOMENT.fullmatch(cell)
    if found is None:
        return cell
    hours = 24 * (_day(found) - first) + int(found[4])
    return f"{3600 * hours + 60 * int(found[5]) + float(found[6].replace(',', '.')):.9f}"


def _header(held: TextRows) -> TextRow:
    for row in held.rows:
        if tools_of(row):
            return row
    raise RecordingError(
        f"{held.name}: no line names position and quaternion of a tool (x y z q0 qx qy qz)"
    )


def _times(
    held: TextRows,
    values: Floats,
    factors: Sequence[float],
    options: Options,
    whose: Sequence[str],
) -> Floats:
    """Seconds, of a clock that may pass midnight; by a rate, every tool's lines are counted."""
    if "rate" in options:
        count = Counter(whose)
        if len(set(count.values())) > 1:
            raise RecordingError(f"{held.name}: tools of {dict(count)} lines: their times are not "
                                 f"known; export a column of time")  # fmt: skip
        names = np.array(whose)
        nth = np.empty(len(values))
        for name in count:
            nth[names == name] = np.arange(count[name])
        return nth / above_zero(options, "rate")
    if not factors:
        raise UsageError(f"{held.name}: no column is a time; give --map rate=HZ")
    t = values @ np.array(factors)
    if np.isnan(t).any():
        raise RecordingError(f"{held.name}: {int(np.isnan(t).sum())} rows without a time; damaged")
    t = t + _DAY * np.concatenate(([0.0], np.cumsum(np.diff(t) < -_DAY / 2)))
    return np.asarray(np.rint(1e9 * (t - t[0])) / 1e9)


def _seen(
    pose: Floats, tool: Tool, rows: Sequence[TextRow], ok: Sequence[str]
) -> NDArray[np.bool_]:
    """Which rows (n,) hold a pose."""
    good: NDArray[np.bool_] = ~np.isnan(pose).any(axis=1) & (pose != 0).any(axis=1)
    if tool.state is not None:
        good &= np.array([row.cell(tool.state).lower() in ok for row in rows])
    return good


def _recognises(path: Path) -> bool:
    lines = head(path).decode("utf-8", "replace").splitlines()[:12]
    marked = any(c in line for line in lines for c in ",;\t")
    split = [re.split(r"[,;\t]", line) if marked else line.split() for line in lines]
    return any(tools_of(TextRow(0, tuple(c.strip() for c in cells))) for cells in split)


NDI = Reader(
    "ndi",
    "a tracker's log (NDI, CSV text)",
    _recognises,
    read_ndi,
    "a line names position and quaternion of a tool",
)
