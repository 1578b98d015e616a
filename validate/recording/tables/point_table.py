"""Reader of point tables, by names of columns: one per coordinate, or one row per point.

`time (s), tip_x (mm), tip_y (mm), tip_z (mm), ...` are markers over time; `name, x, y, z` are
landmarks at one instant; with a time or a frame in each row, and a name in several, markers again.
Columns that belong to no point are told, never taken for one.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError, ValidateError
from validate.recording.formats.streams import distinct, recorded
from validate.recording.motion_capture.text_rows import (
    ASSUMED,
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
from validate.recording.reader import (
    M_PER_PX,
    RATE,
    SD,
    UNIT,
    MapOption,
    Options,
    Reader,
    above_zero,
    frame,
    head,
    length,
    metres,
    source_of,
    spread,
)
from validate.recording.tables.table import split_unit
from validate.recording.tables.vocabulary import plain, role_of_name, words
from validate.recording.types import Markers, Recording
from validate.units import in_si, si_factor

# --- columns of points and of displacement fields in a table, by names ---------------------------

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
    # The column with several labels, each in several rows; one that numbers the rows is none.
    often = {i: len({row.cell(i) for row in below}) for i in _labels(names)}
    whose = next((i for i, count in often.items() if 1 < count < len(below)), None)
    if layout.instant is not None and whose is not None:
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


# --- reader of point tables: one column per coordinate, or one row per point ---------------------

_SPARSE = 20  # cells of markers for each row; beyond it tracks are fragments
_UNSURE = 0.6  # the likelihood below which DeepLabCut itself draws no point
_FURTHER = (
    MapOption("time", "unit of the times", "a time", "as the table declares"),
    MapOption("z", "third coordinate of points with x and y alone", "m"),
    MapOption("likelihood", "below it a point is not seen", "1", f"{_UNSURE}"),
)


def read_point_table(path: Path, options: Options) -> Recording:
    """Points over time as `markers` (nt, k, 3) m, or rows of named points as `landmarks` (1, k, 3).

    Blank cells and NaN are "not seen". Options: `unit` of length and `time` (its unit) in place of
    the table's, `m_per_px` where coordinates are pixels, `likelihood` below which DeepLabCut's are
    not seen, `rate` (Hz) in place of its times, `z` where points have x and y alone, `sd` of a
    coordinate (0: not stated), `frame` (default capture). Raises `UsageError` for what the table
    does not say, `RecordingError` for one without points, or damaged.
    """
    held = text_rows(path)
    layout = layout_of(held)
    if layout is None:
        raise RecordingError(
            f"{held.name}: no line names points; expected columns such as time (s), tip_x (mm), "
            f"tip_y (mm), tip_z (mm), or name, x, y, z"
        )
    instant = [] if layout.instant is None else [layout.instant]
    columns = [*layout.columns, *layout.sure, *instant]
    values, rows, left = numbers(held, layout.rows, len(layout.names), columns)
    # Refuse points of a grid at one instant: over time, one point would jump between them.
    moves = layout.instant is not None
    count = len(values) // len(np.unique(values[:, -1])) if moves else len(values)
    field = field_columns([split_unit(name)[0] for name in layout.names])
    size = f"{held.name}: {count} rows" + (
        f" at each '{layout.names[layout.instant or 0]}'" * moves
    )
    if count > 1 and field and (layout.whose is None or field.strains):
        raise RecordingError(field.refusal(size))
    one = len(layout.points) == 1 and layout.label is None and layout.whose is None
    if one and not moves and is_grid(values):
        raise RecordingError(
            f"{size} on a grid of {len(np.unique(values[:, 0]))} x {len(np.unique(values[:, 1]))} "
            "places at one instant, not the motion of one point; add a column called name (a "
            "landmark per row), or for a single point a column called time"
        )
    x, stated, unsure = _coordinates(held, layout, values, rows, options)
    landmarks = layout.label is not None
    t = np.zeros(1) if landmarks else _times(held, layout, values, options)
    if landmarks:
        # Names of landmarks; refuses names that all stand several times: rows of other instants.
        labels = [row.cell(layout.label or 0) for row in rows]
        often = Counter(labels)
        if len(often) > 1 and min(often.values()) > 1:
            raise RecordingError(
                f"{held.name}: every one of {len(often)} names occurs in several rows, and no "
                "column gives the time; add one called frame or time"
            )
        names = distinct(labels, len(rows))
    else:
        names = tuple(layout.points)
    if layout.whose is not None:
        t, names, x = _by_instants(held, layout, rows, t, x)
    markers = Markers(t, names, x, spread(options), options.get("frame", "capture"))
    taken = {*layout.columns, *layout.sure, layout.instant, layout.label, layout.whose}
    others = ", ".join(repr(n) for i, n in enumerate(layout.names) if i not in taken and n)
    told = {"kind": "a table of points", "unit": stated,
            "points_not_seen": f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}",
            **unsure, **({LEFT_OUT + ", columns": others} if others else {}),
            **told_left(left)}  # fmt: skip
    topic = "landmarks" if landmarks else "markers"
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, {topic: markers}, told)


def _coordinates(
    held: TextRows,
    layout: PointLayout,
    values: Floats,
    rows: tuple[TextRow, ...],
    options: Options,
) -> tuple[Floats, str, dict[str, str]]:
    """Coordinates (nt, k, 3) m, of landmarks (1, k, 3), their unit and who said so, and the
    record's entry about those that are not seen.

    Raises `UsageError` where nobody says the unit, and for pixels without their size.
    """
    count, d = len(layout.columns), len(next(iter(layout.points.values())))
    x = values[:, :count].reshape(len(values), -1, d)
    x = np.where(np.abs(x) < NONE, x, np.nan)
    if layout.label is None:
        x = whole_points(held, x, tuple(layout.points), rows)
    elif np.isnan(x).any():
        raise RecordingError(f"{held.name}: a landmark without coordinates; remove its line")
    else:
        x = x.reshape(1, -1, d)
    # Points of too small a likelihood are not seen.
    entry = {}
    if layout.sure:
        least = above_zero({"likelihood": str(_UNSURE), **options}, "likelihood")
        low = values[:, count : count + len(layout.sure)] < least
        told = f"likelihood below {least:g} is taken as missing ({int(low.sum())} of {low.size})"
        entry = {ASSUMED: f"{told}; change it with --map likelihood=0.9"}
        if "likelihood" in options:
            entry = {"likelihood": told}
        x = np.where(low[..., None], np.nan, x)
    elif "likelihood" in options:
        raise UsageError("--map likelihood: the table has none for each point")
    # Metres in the table's unit, and who said so.
    unit = ""
    if "unit" not in options:
        units = {layout.units[i] for i in layout.columns}
        if len(units) > 1:
            shown = ", ".join(repr(u) for u in sorted(units))
            raise UsageError(f"{held.name}: coordinates in {shown}; give one, as --map unit=mm")
        unit = units.pop() or layout.above.get("units", "")
    if "m_per_px" in options and (not unit or unit in PIXELS):
        if "unit" in options:
            raise UsageError(f"{held.name}: --map unit and m_per_px exclude each other; give one")
        factor = length(options, "m_per_px", "0.1mm")
        stated = f"px of {factor:g} m (entered)"
    elif "m_per_px" in options:
        raise UsageError(f"{held.name}: --map m_per_px: coordinates are in {unit}")
    elif unit in PIXELS:
        raise UsageError(f"{held.name}: coordinates in pixels; give the pixel size, as --map "
                         f"m_per_px=0.1mm")  # fmt: skip
    else:
        factor, stated = metres(options, unit, held.name)
    if d == len(AXES):
        if "z" in options:
            raise UsageError(f"{held.name}: --map z: the points already have a z; leave it out")
        return factor * x, stated, entry
    if "z" not in options:
        raise UsageError(f"{held.name}: points have x and y only; give the position of their "
                         f"plane, as --map z=0mm")  # fmt: skip
    z = length(options, "z", "0mm", zero=True) + 0 * x[..., :1]  # NaN where it was not seen
    return np.concatenate([factor * x, z], axis=2), stated, entry


def _by_instants(
    held: TextRows, layout: PointLayout, rows: Sequence[TextRow], t: Floats, x: Floats
) -> tuple[Floats, tuple[str, ...], Floats]:
    """Times (nt,), names and points (nt, k, 3) of rows (n, p, 3) that are each of one instant and
    one label; NaN where a label has no row.

    Raises `RecordingError` for two rows of one label at one instant, and for many short tracks.
    """
    labels = [row.cell(layout.whose or 0) or "unnamed" for row in rows]
    own = {label: i for i, label in enumerate(dict.fromkeys(labels))}
    instants, at = np.unique(t, return_inverse=True)
    if len(instants) * len(own) > _SPARSE * len(rows) + 1000:
        raise RecordingError(f"{held.name}: {len(own)} labels at {len(instants)} instants in only "
                             f"{len(rows)} rows; keep only long tracks")  # fmt: skip
    places = list(zip(at.tolist(), (own[label] for label in labels), strict=True))
    twice = next((p for p, count in Counter(places).items() if count > 1), None)
    if twice is not None:
        line = [r.line for r, p in zip(rows, places, strict=True) if p == twice][1]
        raise RecordingError(f"{held.name}: line {line}: '{labels[places.index(twice)]}' has "
                             "another row at this instant; remove one")  # fmt: skip
    found = np.full((len(instants), len(own), *x.shape[1:]), np.nan)
    found[tuple(np.array(places).T)] = x
    several = len(layout.points) > 1
    names = [f"{n}.{p}" if several else n for n in own for p in layout.points]
    return instants - instants[0], tuple(names), found.reshape(len(instants), -1, x.shape[2])


def _times(held: TextRows, layout: PointLayout, values: Floats, options: Options) -> Floats:
    """Seconds of each row from the first instant."""
    instants = values[:, -1] if layout.instant is not None else np.arange(float(len(values)))
    if np.isnan(instants).any():
        line = layout.rows[int(np.argmax(np.isnan(instants)))].line
        raise RecordingError(f"{held.name}: line {line}: it has no time; correct it")
    if layout.whose is None:
        # Rows of several points at each instant, whose names no column has: as rows in time,
        # one point would jump between them.
        count, column = len(instants) / len(np.unique(instants)), layout.instant or 0
        if count >= 2 and len(layout.points) == 1:
            raise RecordingError(
                f"{held.name}: {count:.3g} rows at each '{layout.names[column]}', and no column "
                "names the point of each row; add one called marker, or for a single point remove "
                "that column"
            )
        if layout.time is None and (np.diff(instants) <= 0).any():
            line = layout.rows[1 + int(np.argmax(np.diff(instants) <= 0))].line
            raise RecordingError(f"{held.name}: line {line}: its '{layout.names[column]}' is not "
                                 f"after the one before; correct it, or remove that "
                                 f"column")  # fmt: skip
    elif layout.time is not None and "rate" in options:
        nth = np.unique(instants, return_inverse=True)[1]
        return np.asarray(nth / above_zero(options, "rate"))
    if layout.time is None:
        # The rate in Hz that the user gives, else that of a line above the names.
        stated = as_number(layout.above.get("frequency", "")) or 0.0
        rate = above_zero(options, "rate") if "rate" in options else stated
        if not 0 < rate < np.inf:
            raise UsageError(
                f"{held.name}: no column of time; if its rows are instants, give --map rate=HZ; if "
                "they are points at one instant, name each in a column called name"
            )
        return np.asarray((instants - instants.min()) / rate)
    if "rate" in options:
        return np.arange(len(values)) / above_zero(options, "rate")
    name = layout.names[layout.time or 0]
    unit = options.get("time", layout.units[layout.time or 0])
    if not unit:
        raise UsageError(f"{held.name}: '{name}' has no unit; give --map time=s, or --map "
                         f"rate=HZ")  # fmt: skip
    t = si_factor(unit, "time") * instants
    if layout.whose is None and (np.diff(t) <= 0).any():
        at = 1 + int(np.argmax(np.diff(t) <= 0))
        raise RecordingError(f"{held.name}: line {layout.rows[at].line}: its time is not after "
                             f"the one before; correct it, or give --map rate=HZ")  # fmt: skip
    return np.asarray(t - t.min())


def _recognises(path: Path) -> bool:
    """Text whose first lines have one that names points, and none of a force: such a log is a
    testing machine's first, and its points come in by --as."""
    begin = head(path)
    begin = begin[: begin.rfind(b"\n") + 1]
    if not begin or 0 in begin[:2]:
        return False
    try:
        layout = layout_of(rows_of(path.name, begin))
    except ValidateError:
        return False
    return layout is not None and "force" not in map(role_of_name, layout.names)


POINTS = Reader(
    "points",
    "a table of points (CSV)",
    _recognises,
    read_point_table,
    "a line names coordinates of points",
    options=(UNIT, M_PER_PX, SD, frame("capture"), RATE, *_FURTHER),
    extensions=(".csv", ".tsv", ".txt"),
    general=True,
)
