"""Qualisys Track Manager's text: keys and values, then a row a frame of coordinates in mm."""

from pathlib import Path

import numpy as np

from validate.errors import RecordingError
from validate.recording.formats.options import length, spread
from validate.recording.formats.recorded import distinct, recorded
from validate.recording.formats.text_rows import (
    ABSENT,
    TextRow,
    TextRows,
    as_number,
    numbers,
    text_rows,
    told_left,
    whole_points,
    without_zeros,
)
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Markers, Recording

_MAGIC = (b"NO_OF_FRAMES", b"FILE_VERSION")  # the latter since its version 2.0.0
_NAMES = "MARKER_NAMES"
_OPTIONS = ("unit", "sd", "frame")


def read_qualisys(path: Path, options: Options) -> Recording:
    """Points as `markers` (nt, k, 3) m; blank cells and three zeros are "not seen", as that program
    exports either.

    Options: `unit` in place of its mm, `sd` of a coordinate (0: not stated), `frame` (default
    capture). Raises `RecordingError` for a file of other data than 3D, without a frequency, with
    other points than it states, or damaged.
    """
    require_known(options, _OPTIONS)
    held = text_rows(path)
    header, names, body = _parts(held)
    rate = _rate(held, header)
    before = _before(body, len(names))
    values, rows, left = numbers(held, body, before + 3 * len(names))
    x = values[:, before:].reshape(len(values), -1, 3)
    x = whole_points(held, without_zeros(x)[0], names, rows)
    factor = length({"unit": "mm", **options}, "unit", "mm")
    t = np.arange(len(values)) / rate
    markers = Markers(t, names, factor * x, spread(options), options.get("frame", "capture"))
    told = {
        "kind": "motion capture (Qualisys TSV)",
        "header": "; ".join(f"{k} {v}" for k, v in header.items() if v),
        "points_not_seen": f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}",
        "rows": f"{len(values)}, the header states {header.get('NO_OF_FRAMES', 'none')}",
    }
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, {"markers": markers}, told | told_left(left))


def _parts(held: TextRows) -> tuple[dict[str, str], tuple[str, ...], list[TextRow]]:
    """Header, names of the points, and the rows of numbers."""
    if not held.rows or held.rows[0].cell(0).encode() not in _MAGIC:
        raise RecordingError(f"{held.name}: no Qualisys text: its first cell is not NO_OF_FRAMES")
    keys = [r for r in held.rows if r.cell(0).isupper() and r.cell(0) not in ABSENT]
    header = {r.cell(0): r.cell(1) for r in keys if r.cell(0) != _NAMES}
    if header.get("DATA_INCLUDED", "3D") != "3D":
        raise RecordingError(
            f"{held.name}: data of kind '{header['DATA_INCLUDED']}'; only 3D is read: export 3D"
        )
    named = next(([c for c in r.cells[1:] if c] for r in keys if r.cell(0) == _NAMES), [])
    stated = header.get("NO_OF_MARKERS", "")
    if not named or (stated.isdecimal() and int(stated) != len(named)):
        raise RecordingError(
            f"{held.name}: {len(named)} names of points, the header states {stated or 'none'}; "
            "damaged"
        )
    last = max(r.line for r in keys)
    rows = [r for r in held.rows if r.line > last and any(r.cells)]
    if rows and not any(as_number(c) is not None for c in rows[0].cells):
        rows = rows[1:]  # a line of column names
    return header, distinct(named, len(named)), rows


def _rate(held: TextRows, header: dict[str, str]) -> float:
    rate = as_number(header.get("FREQUENCY", "")) or 0.0
    if not 0 < rate < np.inf:
        raise RecordingError(
            f"{held.name}: FREQUENCY '{header.get('FREQUENCY', '')}' is no number of Hz above 0"
        )
    return rate


def _before(rows: list[TextRow], points: int) -> int:
    """Columns before the first coordinate: none, or frame and time."""
    width = max((sum(1 for _ in r.cells) for r in rows), default=0)
    return 2 if width >= 3 * points + 2 else 0


QUALISYS = Reader(
    "qualisys",
    "motion capture (Qualisys TSV)",
    lambda p: head(p, 15).removeprefix(b"\xef\xbb\xbf")[:12] in _MAGIC,
    read_qualisys,
    "its first cell is NO_OF_FRAMES or FILE_VERSION",
)
