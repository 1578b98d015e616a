"""Reader of NDI tracker logs (CSV): position (mm) and quaternion of each tool.

Columns are told by their names: three of position and four of a quaternion beside each other, in
either order, with a state before them or none. A tool that was not seen has seven zeros, blank
cells, or another state than OK: no sample.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.formats.streams import begun, distinct, recorded
from validate.recording.motion_capture.poses import pose_signals, rotations
from validate.recording.motion_capture.text_rows import (
    ASSUMED,
    NONE,
    TextRow,
    TextRows,
    fields_above,
    numbers,
    text_rows,
    told_left,
)
from validate.recording.reader import (
    RATE,
    UNIT,
    MapOption,
    Options,
    Reader,
    above_zero,
    frame,
    head,
    length,
    source_of,
)
from validate.recording.tables.table import split_unit
from validate.recording.tables.vocabulary import role_of_name
from validate.recording.types import Recording, Stream
from validate.units import in_si, si_factor

# --- Which columns of a table are positions, quaternions, states and times, by their names.

_BEFORE = r"(?:(?P<before>.*?)[\W_]+)??"
_POSITION = re.compile(
    _BEFORE + r"(?:t|pos(?:ition)?|trans(?:lation)?)?[\W_]*(?P<axis>[xyz])(?P<after>.*)", re.I
)
_TURN = re.compile(
    _BEFORE + r"(?:q|quat(?:ernion)?|orient(?:ation)?|rot(?:ation)?)[\W_]*"
    r"(?P<axis>[0owxyz])(?P<after>.*)", re.I
)  # fmt: skip
_PORT = re.compile(r"(port|tool|sensor)[\W_]*(\d\w*)")
_STATE = re.compile(r".*(state|status|valid|visible|visibility|tracked)\W*")
_BRACKETS = re.compile(r"[(\[](.*?)[)\]]")
_IN_NAME = re.compile(r"[(\[].*?[)\]]|\W|_")
_CLOCK = {
    **dict.fromkeys(("hour", "hours"), 3600.0), **dict.fromkeys(("minute", "minutes"), 60.0),
    **dict.fromkeys(("second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "millisecond", "milliseconds"), 1e-3),
}  # fmt: skip
_TIME = re.compile(r"(?:\w+[ _])?time[ _]?(?:stamp)?[\W_]*(ns|us|ms|s|sec|seconds)?\W*")
_SECONDS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True)
class Tool:
    """Columns of position x, y, z, of the quaternion x, y, z, w and of the state, if any; the
    `unit` of length that its columns name, or none."""

    name: str
    position: tuple[int, ...]
    turn: tuple[int, ...]
    state: int | None
    unit: str


def tools_of(header: TextRow) -> tuple[Tool, ...]:
    """Groups of seven columns: a position and a quaternion beside each other, in either order."""
    cells = [c.lower() for c in header.cells]
    found: list[Tool] = []
    i = after = 0
    while i + 7 <= len(cells):
        group = _group(header.cells[i : i + 7])
        if group is None:
            i += 1
            continue
        position, turn, name = group
        port = next((m for c in cells[after:i] if (m := _PORT.fullmatch(c))), None)
        # The unit of length in brackets, or none.
        told = _BRACKETS.search(header.cells[i + position[0]])
        found.append(
            Tool(
                name or (f"{port[1]}{port[2]}" if port else f"tool{len(found) + 1}"),
                tuple(i + j for j in position),
                tuple(i + j for j in turn),
                None,
                told[1].strip() if told and in_si(1.0, told[1].strip(), "m") else "",
            )
        )
        i += 7
        after = i
    labels = distinct([tool.name for tool in found], len(found))
    # The column of each tool's state: one that carries its name, else the nearest before its
    # own, of one tool alone also after; those of single markers are none.
    of = [j for j, c in enumerate(cells) if _STATE.fullmatch(c) and "marker" not in c]
    named = [
        next((j for j in of if tool.name.lower() in _IN_NAME.sub("", cells[j])), None)
        for tool in found
    ]
    of = [j for j in of if j not in named]
    begins = [min(*tool.position, *tool.turn) for tool in found]
    ends = [0, *(begin + 7 for begin in begins)]
    before = [
        next((j for j in reversed(of) if end <= j < begin), None)
        for end, begin in zip(ends, begins, strict=False)
    ]
    if len(found) == 1 and before[0] is None:
        before = [next((j for j in of if j >= ends[1]), None)]
    states = [b if n is None else n for n, b in zip(named, before, strict=True)]
    return tuple(replace(t, name=n, state=s) for t, n, s in zip(found, labels, states, strict=True))


def _group(cells: Sequence[str]) -> tuple[tuple[int, ...], tuple[int, ...], str] | None:
    """Columns of x, y, z and of qx, qy, qz, qw among seven, and the name that all carry."""
    for first in (0, 4):
        at = range(first, first + 3)
        four = [j for j in range(7) if j not in at]
        p = [_POSITION.fullmatch(cells[j]) for j in at]
        q = [_TURN.fullmatch(cells[j]) for j in four]
        named = [m for m in (*p, *q) if m]
        if len(named) < 7 or len({_named(m) for m in named}) > 1:
            continue
        axes = [m["axis"].lower() for m in (*p, *q) if m]
        letters = {("w" if a in "0ow" else a): j for a, j in zip(axes[3:], four, strict=True)}
        if axes[:3] == ["x", "y", "z"] and len(letters) == 4:
            return tuple(at), tuple(letters[c] for c in "xyzw"), _named(named[0])
    return None


def _named(found: re.Match[str]) -> str:
    """What stands after the letters, else before them, without signs and units."""
    return _IN_NAME.sub("", found["after"]) or _IN_NAME.sub("", found["before"] or "")


def clock_of_columns(header: TextRow) -> list[tuple[int, float]]:
    """Columns that make up the time, and the seconds of one of their units."""
    cells = [c.lower().strip("#: ") for c in header.cells]
    parts = [(i, _CLOCK[c]) for i, c in enumerate(cells) if c in _CLOCK]
    if parts:
        return parts
    for i, cell in enumerate(cells):
        if found := _TIME.fullmatch(cell):
            return [(i, _SECONDS.get(found[1] or "", 1.0))]
    for i, cell in enumerate(header.cells):
        name, unit = split_unit(cell)
        if role_of_name(name) == "time":
            return [(i, si_factor(unit, "time") if unit else 1.0)]
    return []


# -------------------------------------------------------------------------------------------------

# A column that says of which tool a line is, where each tool has lines of its own.
_WHOSE = re.compile(
    r"(tool|sensor|port|marker|body|handle)?\W*_?(id|name|handle|number|no|serial)?"
)
_MOMENT = re.compile(
    r"(?:(\d{4})-(\d\d)-(\d\d)[T ])?(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(?:Z|[+-]\d\d:?\d\d)?"
)
GOOD = MapOption("ok", "state of a tool that is seen", default="OK, enabled, valid, visible")
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
    held = text_rows(path)
    header = next((row for row in held.rows if tools_of(row)), None)
    if header is None:
        raise RecordingError(
            f"{held.name}: no line names position and quaternion of a tool (x y z q0 qx qy qz)"
        )
    tools, above = tools_of(header), fields_above(held, header)
    options = {**({"rate": above["frequency"]} if "frequency" in above else {}), **options}
    clock = clock_of_columns(header)
    body = _rows(held, header, [i for i, _ in clock])
    columns = [*(i for tool in tools for i in (*tool.position, *tool.turn)), *(i for i, _ in clock)]
    # Columns; those after a name that ends in dots, as of NDI's own sample, go on.
    last = next((c for c in reversed(header.cells) if c), "")
    values, rows, left = numbers(
        held,
        body,
        max((len(r.cells) for r in body), default=0) if last.endswith("...") else len(header.cells),
        columns,
    )
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
    # Name, group of columns and numbers of the lines of each tool.
    tracks = [(tool.name, k, np.arange(len(rows))) for k, tool in enumerate(tools)]
    if len(names := dict.fromkeys(whose)) > 1:
        of_line = np.array(whose)
        tracks = [(name or "unnamed", 0, np.flatnonzero(of_line == name)) for name in names]
    for name, k, own in tracks:
        pose = values[own, 7 * k : 7 * k + 7]
        pose = np.where(np.abs(pose) < NONE, pose, np.nan)
        seen = ~np.isnan(pose).any(axis=1) & (pose != 0).any(axis=1)
        if (state := tools[k].state) is not None:
            seen &= np.array([rows[i].cell(state).lower() in good for i in own])
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
    options=(replace(UNIT, default="mm"), RATE, frame("tracker"), GOOD),
    extensions=(".csv", ".tsv", ".txt"),
)
