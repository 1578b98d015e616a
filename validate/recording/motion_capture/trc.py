"""Reader of TRC marker trajectories (OpenSim, motion capture): tabs or commas."""

from pathlib import Path

import numpy as np

from validate.errors import RecordingError
from validate.recording.formats.streams import distinct, recorded
from validate.recording.motion_capture.text_rows import (
    ASSUMED,
    as_number,
    numbers,
    text_rows,
    told_left,
    told_zeros,
    whole_points,
    without_zeros,
)
from validate.recording.reader import (
    RATE,
    SD,
    UNIT,
    Options,
    Reader,
    above_zero,
    frame,
    head,
    metres,
    source_of,
    spread,
)
from validate.recording.types import Markers, Recording

_MAGIC = b"PathFileType"
_ROUNDED = 1e-3  # s: times have three decimals
_BEFORE = 2  # columns before the first coordinate: frame, time


def read_trc(path: Path, options: Options) -> Recording:
    """Points as `markers` (nt, k, 3) m; a blank, NaN or three zeros are "not seen".

    Options: `unit` in place of the file's, `sd` of a coordinate (0: not stated), `rate` (Hz) in
    place of its times, `frame` (default capture). Raises `UsageError` without a unit of length,
    `RecordingError` for a table that is no TRC, or damaged.
    """
    held = text_rows(path)
    if len(held.rows) < 5 or not held.rows[0].cell(0).startswith(_MAGIC.decode()):
        raise RecordingError(f"{held.name}: not a TRC file: its first cell is not PathFileType")
    pairs = zip(held.rows[1].cells, held.rows[2].cells, strict=False)
    header = {k: v for k, v in pairs if k}
    # Every third cell of the fourth line; where programs left no blanks between, all of them.
    cells = held.rows[3].cells[_BEFORE:]
    named = [c for c in cells if c]
    stated = header.get("NumMarkers", "")
    if stated.isdecimal() and int(stated) != len(named):
        raise RecordingError(
            f"{held.name}: line 4 names {len(named)} points, line 3 states {stated}; damaged"
        )
    if not named:
        raise RecordingError(f"{held.name}: line 4 names no point; not a TRC file, or damaged")
    names = distinct(named, len(named))
    # From the first that begins with a number, blank lines apart.
    body = held.rows[4:]
    begin = next((i for i, r in enumerate(body) if r.cell(0)), len(body))
    values, rows, left = numbers(
        held, [r for r in body[begin:] if any(r.cells)], _BEFORE + 3 * len(names)
    )
    shown, zeros = without_zeros(values[:, _BEFORE:].reshape(len(values), -1, 3))
    x = whole_points(held, shown, names, rows)
    factor, stated = metres(options, header.get("Units", ""), path.name)
    # Seconds from the first row. Rows of equal times, as of three decimals at 2 kHz, are counted at
    # the header's rate where they stand by it.
    counted = {}
    if "rate" in options:
        t = np.arange(len(values)) / above_zero(options, "rate")
    else:
        t = np.asarray(values[:, 1] - values[0, 1])
        if np.isnan(t).any():
            raise RecordingError(f"{held.name}: {int(np.isnan(t).sum())} rows without a time; give "
                                 f"--map rate=HZ")  # fmt: skip
        if not (np.diff(t) > 0).all():
            rate = as_number(header.get("DataRate", "")) or np.nan
            exact = np.arange(len(t)) / rate
            if not (rate > 0 and np.abs(t - exact).max() <= _ROUNDED):
                row = int(np.argmax(np.diff(t) <= 0)) + 2
                raise RecordingError(f"{held.name}: the time of row {row} is not after the one "
                                     f"before it; give --map rate=HZ")  # fmt: skip
            words = f"rows of equal times are counted at the {rate:g} Hz that the file declares"
            t, counted = exact, {ASSUMED: words}
    markers = Markers(t, names, factor * x, spread(options), options.get("frame", "capture"))
    told = {
        "kind": "marker trajectories (TRC)",
        "unit": stated,
        "header": "; ".join(f"{k} {v}" for k, v in header.items() if v),
        "points_not_seen": f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}",
        "rows": f"{len(values)}, the header declares {header.get('NumFrames', 'none')}",
    }
    source = source_of(path, "text file: integrity not provable")
    told |= counted | told_zeros(zeros) | told_left(left)
    return recorded(path.stem, source, {"markers": markers}, told)


TRC = Reader(
    "trc",
    "marker trajectories (TRC)",
    lambda p: head(p, 12) == _MAGIC,
    read_trc,
    "its first cell is PathFileType",
    options=(UNIT, SD, frame("capture"), RATE),
    extensions=(".trc",),
)
