"""Which columns of a table are positions, quaternions, states and times, by their names."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from validate.recording.exports.table import split_unit
from validate.recording.exports.vocabulary import role_of_name
from validate.recording.formats.recorded import distinct
from validate.recording.formats.text_rows import TextRow
from validate.units import in_si, si_factor

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
        found.append(
            Tool(
                name or (f"{port[1]}{port[2]}" if port else f"tool{len(found) + 1}"),
                tuple(i + j for j in position),
                tuple(i + j for j in turn),
                None,
                _unit(header.cells[i + position[0]]),
            )
        )
        i += 7
        after = i
    labels = distinct([tool.name for tool in found], len(found))
    states = _states(cells, found)
    return tuple(replace(t, name=n, state=s) for t, n, s in zip(found, labels, states, strict=True))


def _states(cells: Sequence[str], tools: Sequence[Tool]) -> list[int | None]:
    """The column of each tool's state: one that carries its name, else the nearest before its own,
    of one tool alone also after; those of single markers are none."""
    of = [j for j, c in enumerate(cells) if _STATE.fullmatch(c) and "marker" not in c]
    named = [
        next((j for j in of if tool.name.lower() in _IN_NAME.sub("", cells[j])), None)
        for tool in tools
    ]
    of = [j for j in of if j not in named]
    begins = [min(*tool.position, *tool.turn) for tool in tools]
    ends = [0, *(begin + 7 for begin in begins)]
    before = [
        next((j for j in reversed(of) if end <= j < begin), None)
        for end, begin in zip(ends, begins, strict=False)
    ]
    if len(tools) == 1 and before[0] is None:
        before = [next((j for j in of if j >= ends[1]), None)]
    return [b if n is None else n for n, b in zip(named, before, strict=True)]


def _unit(cell: str) -> str:
    """The unit of length in brackets, or none."""
    told = _BRACKETS.search(cell)
    return told[1].strip() if told and in_si(1.0, told[1].strip(), "m") else ""


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
