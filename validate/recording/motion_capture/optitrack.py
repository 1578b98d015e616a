"""Reader of OptiTrack Motive CSV."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.formats.streams import begun, distinct, recorded
from validate.recording.motion_capture.poses import pose_signals, rotations
from validate.recording.motion_capture.text_rows import (
    TextRow,
    TextRows,
    numbers,
    text_rows,
    told_left,
    told_zeros,
    whole_points,
    without_zeros,
)
from validate.recording.reader import (
    SD,
    UNIT,
    Options,
    Reader,
    frame,
    head,
    metres,
    source_of,
    spread,
)
from validate.recording.types import Markers, Recording, Stream

_MAGIC = b"Format Version"
_BODY = "Rigid Body"
# What was seen, and where the pose of its body puts it.
_POINTS = {"markers": ("Marker",), "solved": ("Rigid Body Marker", "Bone Marker")}
_UNITS = {"Meters": "m", "Centimeters": "cm", "Millimeters": "mm"}
_TIME = 1  # the column


@dataclass(frozen=True)
class MotiveTable:
    """What stands above the columns and in them: `values` (nt, w), NaN in columns that hold no
    position, rotation or time."""

    held: TextRows
    types: TextRow
    names: TextRow
    parts: TextRow
    axes: TextRow
    rows: tuple[TextRow, ...]
    values: Floats

    def triples(self, kinds: Sequence[str]) -> list[tuple[str, list[int]]]:
        """Columns X, Y, Z of positions by name, of things of these kinds."""
        width = self.values.shape[1]
        at = [[i, i + 1, i + 2] for i in range(2, width - 2) if self.types.cell(i) in kinds]
        return [
            (self.names.cell(three[0]), three)
            for three in at
            if [self.axes.cell(j).upper() for j in three] == ["X", "Y", "Z"]
            and all(self.parts.cell(j) == "Position" for j in three)
        ]

    def turn(self, name: str) -> list[int]:
        """Columns X, Y, Z, W of a body's rotation; none where it is no quaternion."""
        own = {
            self.axes.cell(i).upper(): i
            for i in range(2, self.values.shape[1])
            if self.parts.cell(i) == "Rotation" and self.names.cell(i) == name
            and self.types.cell(i) == _BODY
        }  # fmt: skip
        return [own[c] for c in "XYZW"] if set(own) == set("XYZW") else []


def read_optitrack(path: Path, options: Options) -> Recording:
    """Markers as `markers` (nt, k, 3) m, where their bodies' poses put them as `solved`, each rigid
    body's pose as `<body>/rotation` and `/translation`; blank cells
    and zeros throughout are "not seen".

    Options: `unit` in place of the file's, `sd` of a coordinate (0: not stated), `frame` (default:
    the file's coordinate space). Bodies whose rotation is no quaternion are listed as unread.
    Raises `UsageError` without a unit of length, `RecordingError` for a file without both, or
    damaged.
    """
    held = text_rows(path)
    if not held.rows or held.rows[0].cell(0) != _MAGIC.decode():
        raise RecordingError(
            f"{held.name}: not a Motive CSV file: its first cell is not 'Format Version'"
        )
    first = held.rows[0].cells
    header = dict(zip(first[::2], first[1::2], strict=False))
    table, left = _table(held)
    unit = header.get("Length Units", "")
    factor, stated = metres(options, _UNITS.get(unit, unit), path.name)
    frame = options.get("frame", header.get("Coordinate Space", "capture").lower())
    # Poses of rigid bodies where they were seen, and why others have none.
    poses: dict[str, Stream] = {}
    unread = {}
    for name, at in table.triples((_BODY,)):
        q = table.turn(name)
        pose = table.values[:, [*at, *q]]
        seen = ~np.isnan(pose).any(axis=1) & pose.any(axis=1)
        if not q:
            unread[name] = "its rotation is not a quaternion; export it as Rotation Type Quaternion"
        elif not seen.any():
            unread[name] = "never seen"
        else:
            R = rotations(pose[seen, 3:], f"{table.held.name}: {name}")
            t = table.values[seen, _TIME]
            poses |= pose_signals(name, t, R, factor * pose[seen, :3], frame)
    # Markers by topic, and how many points were three zeros; those of a kind that the file
    # does not have are left out.
    sd = spread(options)
    points: dict[str, Stream] = {}
    zeros = 0
    for topic, kinds in _POINTS.items():
        if columns := table.triples(kinds):
            names = distinct([name for name, _ in columns], len(columns))
            x, count = without_zeros(table.values[:, [at for _, at in columns]])
            x = factor * whole_points(table.held, x, names, table.rows)
            zeros += count
            points[topic] = Markers(table.values[:, _TIME], names, x, sd, frame)
    streams = {**points, **poses}
    if not streams:
        raise RecordingError(f"{path.name}: neither markers nor poses of bodies: {unread}")
    told = {
        "kind": "motion capture (OptiTrack CSV)", "unit": stated,
        "header": "; ".join(f"{k} {v}" for k, v in header.items() if v), **told_zeros(zeros),
        **told_left(left),
    }  # fmt: skip
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, begun(streams), told, unread)


def _table(held: TextRows) -> tuple[MotiveTable, tuple[str, ...]]:
    """The table, and what was left out of it."""
    at = next((i for i, r in enumerate(held.rows) if r.cell(0) == "Frame"), None)
    if at is None:
        raise RecordingError(f"{held.name}: no line of columns that begins with Frame; damaged")
    above = [r for r in held.rows[1:at] if any(r.cells)]
    if len(above) < 3:
        raise RecordingError(f"{held.name}: no lines of types and names above Frame; damaged")
    parts, axes = above[-1], held.rows[at]
    # The mean error of a body's markers has a name above, none in the line of axes.
    width = max(i + 1 for row in (*above, axes) for i, c in enumerate(row.cells) if c)
    kept = [_TIME, *(i for i in range(2, width) if parts.cell(i) in ("Position", "Rotation"))]
    below = [r for r in held.rows[at + 1 :] if any(r.cells)]
    found, rows, left = numbers(held, below, width, kept)
    values = np.full((len(rows), width), np.nan)
    values[:, kept] = found
    return MotiveTable(held, above[0], above[1], parts, axes, rows, values), left


OPTITRACK = Reader(
    "optitrack",
    "motion capture (OptiTrack CSV)",
    lambda p: head(p, 17).removeprefix(b"\xef\xbb\xbf")[:14] == _MAGIC,
    read_optitrack,
    "its first cell is 'Format Version'",
    options=(UNIT, SD, frame("the coordinate space of the file")),
    extensions=(".csv",),
)
