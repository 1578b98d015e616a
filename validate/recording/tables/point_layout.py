"""Columns of points and of displacement fields in a table, by names.

A line of names, as `time (s), tip_x (mm), ...`; DeepLabCut's three or four lines, a column a cell.
In a displacement field a row is a point of a grid and all rows are one instant. It is refused: read
over time, its rows would be one point that jumps from place to place.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

import numpy as np

from validate.arrays import Floats
from validate.recording.motion_capture.text_rows import TextRow, TextRows, as_number, fields_above
from validate.recording.tables.table import split_unit
from validate.recording.tables.vocabulary import plain, role_of_name, words
from validate.units import in_si

_BESIDE = r"(coord(inate)?s?|pos(ition)?|ref(erence)?|pixel|px)?"
_PLACE = re.compile(rf"{_BESIDE}(?P<axis>[xyz])[0c]?{_BESIDE}")
_COMPONENT = re.compile(r"(?P<u>[uvw])(px|pixel)?|u(?P<x>[xyz])")
_NAMED = re.compile(
    r"disp|deplacement|verschiebung|desplazamiento|spostamento|deslocamento|verplaatsing|"
    r"przemieszczenie|перемещени|位移|変位"
)
_STRAIN = re.compile(r"e(ps(ilon)?)?(xx|yy|zz|xy|yx|xz|zx|yz|zy|[123])|eps(ilon)?[xyz]")


@dataclass(frozen=True)
class FieldColumns:
    """The columns of a displacement field by their names without units: places, displacements
    and strains."""

    places: tuple[str, ...]
    displacements: tuple[str, ...]
    strains: tuple[str, ...]

    def refusal(self, held: str) -> str:
        """Return why `held` (as "240 rows") of these columns are not read, and what to do."""
        columns = ", ".join((*self.places, *self.displacements, *self.strains))
        return (
            f"{held} of {columns}: a field of displacements or strains at one instant, not the "
            "motion of one point; export chosen points over time, one row per instant, as time "
            "(s), p1_x (mm), p1_y (mm), p2_x (mm), p2_y (mm)"
        )


def field_columns(names: Sequence[str]) -> FieldColumns | None:
    """Return the columns x and y with displacements or strains beside them; None where there are
    none. A displacement is u and v together, or called so."""
    kinds = {name: _kind(name) for name in names}
    by = {kind: tuple(n for n, k in kinds.items() if k[:1] == kind) for kind in "pds"}
    axes, components = ({kinds[n][1:] for n in by[kind]} for kind in "pd")
    moved = {"x", "y"} <= components or "" in components
    if {"x", "y"} <= axes and (moved or by["s"]):
        return FieldColumns(by["p"], by["d"], by["s"])
    return None


def _kind(name: str) -> str:
    """p, d or s for a place, displacement or strain, then its axis; empty for another column."""
    text = "".join(re.findall(r"[^\W_]+", plain(name)))
    if found := _PLACE.fullmatch(text):
        return "p" + found["axis"]
    if found := _COMPONENT.fullmatch(text):
        return "d" + (found["x"] or "xyz"["uvw".index(found["u"])])
    if _NAMED.search(text):
        return "d"
    return "s" if _STRAIN.fullmatch(text) or role_of_name(name) == "strain" else ""


def is_grid(places: Floats) -> bool:
    """Return whether different places (n, 2 or more) fill a grid: every x with (nearly) every y."""
    x, y = (len(np.unique(places[:, i])) for i in (0, 1))
    different = len(np.unique(places[:, :2], axis=0)) == len(places)
    return different and min(x, y) > 2 and 9 <= x * y <= 1.5 * len(places)


AXES = "xyz"
PIXELS = ("px", "pixel", "pixels")
_LAST = re.compile(r"(?P<name>.*?)(?:[\s_.:-]+(?P<low>[xyzXYZ])|(?<=[a-z0-9])(?P<glued>[XYZ]))")
_FIRST = re.compile(r"(?P<low>[xyzXYZ])[\s_.:-]*(?P<name>[0-9]+|(?<=[\s_.:-])\w+)")
# Three numbers with axes that are no place, as an inertial unit, a force plate or a tracker logs.
_NO_PLACE = re.compile(
    r"(lin(ear)?|ang(ular)?)?[\W_]*(acc\w*|gyr\w*|magn\w*|vel\w*|moment\w*|torque|force|omega|"
    r"rot\w*|quat\w*|orient\w*|euler|q)", re.I
)  # fmt: skip
_W = re.compile(r"[\s_.:-]+[wW]$")  # beside x, y, z of the same name it makes a quaternion
_LABELS = {"name", "label", "marker", "point", "landmark", "id", "particle", "track", "bodypart"}
_ALONE = "point"  # the name of points whose columns are x, y, z and nothing else
_DEEPEST = 40  # lines in which the line of names is looked for
_FRAMES = re.compile(
    r"(image|video|camera)?[\W_]*frames?[\W_]*(no|nr|number|idx|index|id)?\W*", re.I
)
_DEEPLABCUT = ("scorer", "individuals", "bodyparts", "coords")


@dataclass(frozen=True)
class PointLayout:
    """The line of names: columns of each point, of time, of labels; units; the rows below, and
    values by key of the lines above.

    `frames`: the column that numbers the images; `whose`: the one that says of which points a row
    is, where an instant has several rows; `sure`: the likelihood of each point, or none.
    """

    points: dict[str, list[int]]
    time: int | None
    label: int | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: list[TextRow]
    above: dict[str, str] = field(default_factory=dict)
    frames: int | None = None
    whose: int | None = None
    sure: tuple[int, ...] = ()

    @property
    def columns(self) -> list[int]:
        return [i for columns in self.points.values() for i in columns]

    @property
    def instant(self) -> int | None:
        """The column that tells the instants: of time, else of frames."""
        return self.frames if self.time is None else self.time


def layout_of(held: TextRows) -> PointLayout | None:
    """Return the first lines that name points; none where none do."""
    if found := _of_deeplabcut(held.rows):
        return found
    for i, row in enumerate(held.rows[:_DEEPEST]):
        if row.cell(0).startswith("#") and not row.cell(0).lstrip("# "):
            continue
        found = _of_line(row, list(held.rows[i + 1 :]))
        if found is not None:
            return replace(found, above=fields_above(held, row))
    return None


def _of_line(row: TextRow, below: list[TextRow]) -> PointLayout | None:
    cells = (row.cell(0).lstrip("# "), *row.cells[1:])
    if any(as_number(c) is not None for c in cells):
        return None
    split = [split_unit(c) for c in cells]
    names, units = [n for n, _ in split], [u or "" for _, u in split]
    # The points without velocities and the like: beside lengths, what has another unit.
    points = _points_of(names)
    of = {n: {units[i] for i in columns} for n, columns in points.items()}
    lengths = {n for n, own in of.items() if all(in_si(1.0, u, "m") for u in own if u) and any(own)}
    points = {n: c for n, c in points.items() if not lengths or n in lengths or not any(of[n])}
    if not points:
        return None
    below = [r for r in below if any(r.cells) and not r.cell(0).startswith("#")]
    columns = [i for at in points.values() for i in at]
    said = list(takewhile(lambda r: _is_words(r, columns), below[:_DEEPEST]))
    if said:  # of several, as below the names of TrackMate, the last are the units
        units = [u or said[-1].cell(i).strip("()[] ") for i, u in enumerate(units)]
        below = below[len(said) :]
    time = next(
        (
            i
            for i, n in enumerate(names)
            if (role_of_name(n) == "time" or n.strip().lower() in ("timestamp", "time stamp"))
        ),
        None,
    )
    # The column that numbers images; one of text is of something else, as a frame's name.
    at = (i for i, n in enumerate(names) if _FRAMES.fullmatch(n))
    layout = PointLayout(
        points,
        time,
        None,
        cells,
        tuple(units),
        below,
        frames=next((i for i in at if all(_is_count(r.cell(i)) for r in below)), None),
    )
    if layout.instant is not None and (whose := _whose(names, layout)) is not None:
        return replace(layout, whose=whose)
    label = next(iter(_labels(names)), None)
    return replace(layout, label=label if list(points) == [_ALONE] and time is None else None)


def _is_words(row: TextRow, columns: Sequence[int]) -> bool:
    """Whether a row below the names holds no number, but words in columns of coordinates."""
    return any(row.cell(i) for i in columns) and all(as_number(c) is None for c in row.cells if c)


def _labels(names: Sequence[str]) -> list[int]:
    """The columns that may name the points of a row."""
    return [i for i, n in enumerate(names) if words(n) & _LABELS and not _FRAMES.fullmatch(n)]


def _is_count(cell: str) -> bool:
    return (as_number(cell) or 0.5).is_integer() or as_number(cell) == 0


def _whose(names: Sequence[str], layout: PointLayout) -> int | None:
    """The column with several labels, each in several rows; one that numbers the rows is none."""
    for i in _labels(names):
        often = Counter(row.cell(i) for row in layout.rows)
        if 1 < len(often) < len(layout.rows):
            return i
    return None


def _of_deeplabcut(rows: Sequence[TextRow]) -> PointLayout | None:
    """The columns of DeepLabCut: x, y in pixels (of x, y, z in an own unit) and a likelihood."""
    lines = {r.cell(0).lower(): r for r in rows[:4] if r.cell(0).lower() in _DEEPLABCUT}
    if not {"scorer", "bodyparts", "coords"} <= lines.keys():
        return None
    coords, width = lines["coords"], len(lines["coords"].cells)
    said = [lines[key] for key in ("individuals", "bodyparts") if key in lines]
    found: dict[str, dict[str, int]] = {}
    for i in range(1, width):
        if coords.cell(i):
            found.setdefault(".".join(r.cell(i) for r in said), {})[coords.cell(i)] = i
    axes = [c for c in AXES if any(c in a for a in found.values())]
    points = {n: [a[c] for c in axes] for n, a in found.items() if a.keys() >= set(axes)}
    if not {"x", "y"} <= set(axes) or not points:
        return None
    sure = tuple(found[n]["likelihood"] for n in points if "likelihood" in found[n])
    below = [r for r in rows if r.line > coords.line and any(r.cells)]
    counted = all(_is_count(r.cell(0)) for r in below)
    return PointLayout(
        points, None, None, ("frame", *coords.cells[1:]), ("px" if len(axes) == 2 else "",) * width,
        below, frames=0 if counted else None, sure=sure if len(sure) == len(points) else (),
    )  # fmt: skip


def _points_of(names: Sequence[str]) -> dict[str, list[int]]:
    """Columns of x, y, z of each point (of x, y where none has a z); none where they differ."""
    found: dict[str, dict[str, int]] = {}
    for i, name in enumerate(names):
        # The axis and the point of a column's name; empty where it is none.
        text = name.strip()
        if text.lower() in ("x", "y", "z"):
            axis, whose = text.lower(), _ALONE
        elif (last := _LAST.fullmatch(text)) and _NO_PLACE.fullmatch(last["name"]):
            axis, whose = "", ""
        elif last and last["name"]:
            axis, whose = (last["low"] or last["glued"]).lower(), last["name"]
        else:
            first = _FIRST.fullmatch(text)
            axis, whose = (first["low"].lower(), first["name"]) if first else ("", "")
        if axis and found.setdefault(whose, {}).setdefault(axis, i) != i:
            return {}
    turns = {_W.sub("", n.strip()) for n in names if _W.search(n.strip())}
    whole = {n: a for n, a in found.items() if {"x", "y"} <= a.keys() and n not in turns}
    axes = [c for c in AXES if any(c in a for a in whole.values())]
    return {n: [a[c] for c in axes] for n, a in whole.items() if len(a) == len(axes)}
