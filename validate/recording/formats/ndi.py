"""Logs of NDI's trackers as CSV text: position (mm) and quaternion of each tool, line by line.

Columns are told by their names: three of position and four of a quaternion beside each other, in
either order, with a state before them or none. A tool that was not seen has seven zeros, blank
cells, or another state than OK: no sample.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.errors import RecordingError, UsageError
from validate.recording.formats.options import above_zero, length
from validate.recording.formats.poses import pose_signals, rotations
from validate.recording.formats.recorded import begun, distinct, recorded
from validate.recording.formats.text_rows import TextRow, TextRows, numbers, text_rows, told_left
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Recording, Stream

_POSITION = re.compile(r"t?([xyz])(.*)")
_TURN = re.compile(r"q([0owxyz])(.*)")
_PORT = re.compile(r"(port|tool|sensor)[\W_]*(\d\w*)")
# A column that says of which tool a line is, where each tool has lines of its own.
_WHOSE = re.compile(
    r"(tool|sensor|port|marker|body|handle)?\W*_?(id|name|handle|number|no|serial)?"
)
_IN_NAME = re.compile(r"\(mm\)|\[mm\]|\W|_")
_CLOCK = {
    **dict.fromkeys(("hour", "hours"), 3600.0), **dict.fromkeys(("minute", "minutes"), 60.0),
    **dict.fromkeys(("second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "millisecond", "milliseconds"), 1e-3),
}  # fmt: skip
_TIME = re.compile(r"time ?(?:stamp)?\W*(ms|s|sec|seconds)?\W*")
_OPTIONS = ("unit", "rate", "frame")
_OK = ("", "ok")
_DAY = 86400.0  # s
_MOST_TOOLS = 64


@dataclass(frozen=True)
class Tool:
    """Columns of position x, y, z, of the quaternion x, y, z, w and of the state, if any."""

    name: str
    position: tuple[int, ...]
    turn: tuple[int, ...]
    state: int | None


def read_ndi(path: Path, options: Options) -> Recording:
    """Each tool as `<tool>/rotation` (nt, 9) and `<tool>/translation` (nt, 3) m, as poses of
    tracked sequences are.

    Options: `unit` in place of NDI's mm, `rate` (Hz) where no column is a time, `frame` (default
    tracker). A tool never seen is listed as unread. Raises `UsageError` without times,
    `RecordingError` for a table without tools, one in which nothing was seen, or damaged.
    """
    require_known(options, _OPTIONS)
    held = text_rows(path)
    header = _header(held)
    tools = _tools(header)
    clock = _clock(header)
    body = [r for r in held.rows if r.line > header.line and any(r.cells)]
    columns = [*(i for tool in tools for i in (*tool.position, *tool.turn)), *(i for i, _ in clock)]
    values, rows, left = numbers(held, body, len(header.cells), columns)
    whose = _whose(header, rows, tools)
    t = _times(held, values[:, 7 * len(tools) :], [f for _, f in clock], options, whose)
    factor = length({"unit": "mm", **options}, "unit", "mm")
    frame = options.get("frame", "tracker")
    streams: dict[str, Stream] = {}
    told = {}
    for name, k, own in _tracks(tools, whose):
        pose = values[own, 7 * k : 7 * k + 7]
        seen = _seen(pose, tools[k], [rows[i] for i in own])
        told[name] = f"{int((~seen).sum())} of {len(seen)}"
        if seen.any():
            R = rotations(pose[seen, 3:], f"{path.name}: {name}")
            streams |= pose_signals(name, t[own][seen], R, factor * pose[seen, :3], frame)
    return _recording(path, streams, told, left)


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
    path: Path, streams: dict[str, Stream], missing: dict[str, str], left: Sequence[str]
) -> Recording:
    if not streams:
        raise RecordingError(f"{path.name}: no tool was seen: {missing}")
    never = {name: "never seen" for name in missing if f"{name}/rotation" not in streams}
    told = {
        "kind": "tracker log (NDI)",
        "not_seen": "; ".join(f"{name}: {count}" for name, count in missing.items()),
        **told_left(left),
    }
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, begun(streams), told, never)


def _header(held: TextRows) -> TextRow:
    for row in held.rows:
        if _tools(row):
            return row
    raise RecordingError(
        f"{held.name}: no line names position and quaternion of a tool (x y z q0 qx qy qz)"
    )


def _tools(header: TextRow) -> tuple[Tool, ...]:
    """Groups of seven columns."""
    cells = [c.lower() for c in header.cells]
    found: list[tuple[tuple[int, ...], tuple[int, ...], int | None]] = []
    names: list[str] = []
    i = after = 0
    while i + 7 <= len(cells):
        group = _group(cells[i : i + 7])
        if group is None:
            i += 1
            continue
        position, turn, suffix = group
        between = range(after, i)
        state = next((j for j in between if cells[j] in ("state", "status")), None)
        port = next((m for j in between if (m := _PORT.fullmatch(cells[j]))), None)
        names.append(suffix or (f"{port[1]}{port[2]}" if port else f"tool{len(found) + 1}"))
        found.append((tuple(i + j for j in position), tuple(i + j for j in turn), state))
        i += 7
        after = i
    labels = distinct(names, len(names))
    return tuple(Tool(n, p, q, s) for n, (p, q, s) in zip(labels, found, strict=True))


def _group(cells: Sequence[str]) -> tuple[tuple[int, ...], tuple[int, ...], str] | None:
    """Columns of x, y, z and of qx, qy, qz, qw among seven, and what follows their letters."""
    for first in (0, 4):
        at = range(first, first + 3)
        four = [j for j in range(7) if j not in at]
        p = [_POSITION.fullmatch(cells[j]) for j in at]
        q = [_TURN.fullmatch(cells[j]) for j in four]
        named = [m for m in (*p, *q) if m]
        if len(named) < 7 or len({m[2] for m in named}) > 1:
            continue
        letters = {("w" if m[1] in "0ow" else m[1]): j for m, j in zip(q, four, strict=True) if m}
        if [m[1] for m in p if m] == ["x", "y", "z"] and len(letters) == 4:
            return (
                tuple(at),
                tuple(letters[c] for c in "xyzw"),
                re.sub(r"\(mm\)|\[mm\]|\W|_", "", named[0][2]),
            )
    return None


def _clock(header: TextRow) -> list[tuple[int, float]]:
    """Columns that make up the time, and the seconds of one of their units."""
    cells = [c.lower().strip(": ") for c in header.cells]
    parts = [(i, _CLOCK[c]) for i, c in enumerate(cells) if c in _CLOCK]
    if parts:
        return parts
    for i, cell in enumerate(cells):
        if found := _TIME.fullmatch(cell):
            return [(i, 1e-3 if found[1] == "ms" else 1.0)]
    return []


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
            raise RecordingError(f"{held.name}: tools of {dict(count)} lines: no rate tells their "
                                 "times; export a column of time")  # fmt: skip
        names = np.array(whose)
        nth = np.empty(len(values))
        for name in count:
            nth[names == name] = np.arange(count[name])
        return nth / above_zero(options, "rate")
    if not factors:
        raise UsageError(f"{held.name}: no column is a time; say --map rate=HZ")
    t = values @ np.array(factors)
    if np.isnan(t).any():
        raise RecordingError(f"{held.name}: {int(np.isnan(t).sum())} rows without a time; damaged")
    t = t + _DAY * np.concatenate(([0.0], np.cumsum(np.diff(t) < -_DAY / 2)))
    return np.asarray(np.rint(1e9 * (t - t[0])) / 1e9)


def _seen(pose: Floats, tool: Tool, rows: Sequence[TextRow]) -> NDArray[np.bool_]:
    """Which rows (n,) hold a pose."""
    good: NDArray[np.bool_] = ~np.isnan(pose).any(axis=1) & (pose != 0).any(axis=1)
    if tool.state is not None:
        good &= np.array([row.cell(tool.state).lower() in _OK for row in rows])
    return good


def _recognises(path: Path) -> bool:
    text = head(path).decode("utf-8", "replace")
    lines = [re.split(r"[,;\t]", line) for line in text.splitlines()[:12]]
    return any(_tools(TextRow(0, tuple(c.strip() for c in cells))) for cells in lines)


NDI = Reader(
    "ndi",
    "a tracker's log (NDI, CSV text)",
    _recognises,
    read_ndi,
    "a line names position and quaternion of a tool",
)
