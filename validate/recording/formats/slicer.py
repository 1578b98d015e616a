"""Reader of 3D Slicer landmarks: FCSV and markups JSON (.mrk.json), in mm."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.errors import RecordingError
from validate.files import json_value
from validate.recording.formats.streams import distinct, recorded
from validate.recording.motion_capture.text_rows import TextRow, TextRows, text_rows
from validate.recording.reader import (
    SD,
    UNIT,
    Options,
    Reader,
    frame,
    head,
    length,
    source_of,
    spread,
)
from validate.recording.tables.table import whole_file
from validate.recording.types import Markers, Recording

TOPIC = "landmarks"
_FCSV = b"# Markups fiducial file version"
_OLD = b"# Fiducial List file"  # of version 3
_SYSTEMS = {"0": "RAS", "1": "LPS", "2": "IJK"}  # of files before version 4.11
_COLUMNS = ("id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label", "desc",
            "associatedNodeID")  # fmt: skip
_STATUS = len(_COLUMNS)  # a column after the named ones, in newer files
_DEFINED = ("", "2")
_LARGEST = 64 * 2**20  # bytes of a JSON file
_OPTIONS = (
    SD,
    replace(UNIT, default="mm, or as the file declares"),
    frame("RAS or LPS, as declared"),
)
_Point = tuple[str, Sequence[float]]


def read_fcsv(path: Path, options: Options) -> Recording:
    """Landmarks (1, k, 3) m under their labels, in the frame that the file names: RAS or LPS.

    A point that was placed and taken back is "not seen". Options: `sd` of a coordinate (0: not
    stated), `unit` in place of Slicer's mm, `frame` in place of the file's. Raises
    `RecordingError` for a file of voxel indices (IJK), one that is no FCSV, or damaged.
    """
    held = text_rows(path)
    if not held.rows or not held.rows[0].cell(0).encode().startswith((_FCSV, _OLD)):
        raise RecordingError(f"{path.name}: not FCSV: its first line is not '{_FCSV.decode()}'")
    stated = [r.cells for r in held.rows if r.cell(0).startswith("#")]
    header = dict(c[0].lstrip("# ").partition(" = ")[::2] for c in stated)
    system = header.get("CoordinateSystem", header.get("coordinateSystem", "0"))
    named = "# columns = "
    columns = ((c[0].removeprefix(named), *c[1:]) for c in stated if c[0].startswith(named))
    names = next(columns, _COLUMNS)
    rows = [r for r in held.rows if any(r.cells) and not r.cell(0).startswith("#")]
    cells = [len(r.cells) for r in rows]
    if held.open_end and cells and cells[-1] < max(cells):
        raise RecordingError(
            f"{held.name}: line {rows[-1].line} has {cells[-1]} cells, others {max(cells)}; cut"
        )
    points = [_point(held, row, names) for row in rows]
    return _landmarks(path, points, _SYSTEMS.get(system, system), "landmarks (FCSV)", options)


def _point(held: TextRows, row: TextRow, names: Sequence[str]) -> _Point:
    at = {name: i for i, name in enumerate(names)}
    label = row.cell(at.get("label", 0))
    if row.cell(_STATUS) not in _DEFINED:
        return label, (np.nan, np.nan, np.nan)
    return label, _three(f"{held.name}: line {row.line}", [row.cell(at.get(c, -1)) for c in "xyz"])


def _three(what: str, values: Any) -> Sequence[float]:
    try:
        x = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        x = np.zeros(0)
    if x.shape != (3,) or not np.isfinite(x).all():
        raise RecordingError(
            f"{what}: {str(values)[:60]} is not a point of 3 finite numbers; damaged"
        )
    return tuple(x.tolist())


def read_markups(path: Path, options: Options) -> Recording:
    """Control points of all lists of the file as landmarks (1, k, 3) m; as `read_fcsv`."""
    data = whole_file(path)
    try:
        if len(data) > _LARGEST:
            raise ValueError(f"{len(data)} bytes, the limit is {_LARGEST}")
        found = json_value(data)["markups"]
        if not (isinstance(found, list) and found and all(isinstance(m, dict) for m in found)):
            raise ValueError("its 'markups' is not a list of lists")
    except (ValueError, TypeError, KeyError) as error:
        raise RecordingError(f"{path.name}: not markups JSON ({error}); damaged") from None
    lists = found
    systems = {str(m.get("coordinateSystem", "LPS")) for m in lists}
    stated = [m.get("coordinateUnits", "mm") for m in lists]  # of a list, or of each axis
    units = {str(u) for of in stated for u in (of if isinstance(of, list) and of else [of])}
    if len(systems) > 1 or len(units) > 1:
        raise RecordingError(
            f"{path.name}: lists in {sorted(systems)} and {sorted(units)}; save them in separate "
            f"files"
        )
    points = [_control(path, p) for m in lists for p in m.get("controlPoints", ())]
    unit = units.pop()
    system = _SYSTEMS.get(next(iter(systems)), next(iter(systems)))
    given = {"unit": unit, **options}
    return _landmarks(path, points, system, "landmarks (markups JSON)", given)


def _control(path: Path, point: Any) -> _Point:
    if not isinstance(point, dict):
        raise RecordingError(f"{path.name}: a control point that is not an object; damaged")
    label = str(point.get("label", ""))
    if point.get("positionStatus", "defined") != "defined":
        return label, (np.nan, np.nan, np.nan)
    return label, _three(f"{path.name}: '{label}'", point.get("position"))


def _landmarks(
    path: Path, points: Sequence[_Point], system: str, kind: str, options: Options
) -> Recording:
    if not points:
        raise RecordingError(f"{path.name}: no point in it; cut or empty")
    if system not in ("RAS", "LPS"):
        raise RecordingError(
            f"{path.name}: coordinates in '{system}', not lengths; save them as LPS or RAS"
        )
    factor = length({"unit": "mm", **options}, "unit", "mm")
    x = factor * np.array([p for _, p in points])[None]
    names = distinct([label for label, _ in points], len(points))
    frame = options.get("frame", system)
    markers = Markers(np.zeros(1), names, x, spread(options), frame)
    told = {"kind": kind, "frame": system, "points_not_seen": str(int(np.isnan(x[0, :, 0]).sum()))}
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.name.partition(".")[0], source, {TOPIC: markers}, told)


FCSV = Reader(
    "fcsv",
    "landmarks of 3D Slicer (FCSV)",
    lambda p: head(p, len(_FCSV)).startswith((_FCSV, _OLD)),
    read_fcsv,
    "its first line says so",
    options=_OPTIONS,
    extensions=(".fcsv",),
)
MARKUPS = Reader(
    "markups",
    "landmarks of 3D Slicer (JSON)",
    lambda p: b'"@schema"' in (start := head(p)) and b"markups" in start,
    read_markups,
    "JSON with the schema of markups",
    options=_OPTIONS,
    extensions=(".mrk.json", ".json"),
)
