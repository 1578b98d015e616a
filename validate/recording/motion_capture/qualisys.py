"""Reader of Qualisys Track Manager text (coordinates in mm, one row per frame).

Of bodies (6D) it has 16 columns each: X Y Z, three angles whose convention is a setting of the
program, the residual (-1: not seen), and the rotation column by column, which alone is read.
"""

from pathlib import Path

import numpy as np

from validate.errors import RecordingError
from validate.recording.formats.streams import begun, distinct, recorded
from validate.recording.motion_capture.poses import pose_signals
from validate.recording.motion_capture.text_rows import (
    ABSENT,
    TextRow,
    TextRows,
    as_number,
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
    length,
    source_of,
    spread,
)
from validate.recording.types import Markers, Recording, Signal, Stream

# --- Analog channels and force plates as Qualisys Track Manager exports them: a text of samples.

_ANALOG_MAGIC = b"NO_OF_SAMPLES"
_ANALOG_NAMES = "CHANNEL_NAMES"
_CLOCK = ("sample", "frame", "time")  # columns that are no channel


def read_qualisys_analog(path: Path, options: Options) -> Recording:
    """Each channel as `analog/<name>` (nt, 1); the file states no unit of any.

    Times are samples over its frequency. Options: `frame` (default capture). Raises
    `RecordingError` for a file without names or frequency, or damaged.
    """
    held = text_rows(path)
    first = next(
        (i for i, r in enumerate(held.rows) if (as_number(r.cell(0)) is not None)), len(held.rows)
    )
    above = held.rows[:first]
    header = {r.cell(0): r.cell(1) for r in above}
    rate = as_number(header.get("FREQUENCY", "")) or 0.0
    # Names after their key, else the last line above the samples
    named = [r.cells[1:] for r in above if r.cell(0) == _ANALOG_NAMES]
    columns = [c for cells in (named or [r.cells for r in above[-1:]])[:1] for c in cells if c]
    if not columns or not 0 < rate < np.inf:
        raise RecordingError(f"{path.name}: names of channels: {columns}, FREQUENCY: {rate:g} Hz")
    body = [r for r in held.rows[first:] if any(r.cells)]
    values, _, left = numbers(held, body, len(columns))
    t = np.arange(len(values)) / rate
    kept = [i for i, name in enumerate(columns) if name.lower() not in _CLOCK]
    names = distinct([columns[i] for i in kept], len(kept))
    frame = options.get("frame", "capture")
    streams: dict[str, Stream] = {}
    never = {}
    for name, y in zip(names, values[:, kept].T, strict=True):
        if np.isnan(y).any():
            never[f"analog/{name}"] = f"{int(np.isnan(y).sum())} blank cells"
        else:
            streams[f"analog/{name}"] = Signal(t, y[:, None], "not stated", 0.0, frame)
    told = {
        "kind": "motion capture (Qualisys TSV, analog)",
        "header": "; ".join(f"{k} {v}" for k, v in header.items() if k.isupper() and v),
        **told_left(left),
    }
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, streams, told, never)


QUALISYS_ANALOG = Reader(
    "qualisys-analog",
    "analog channels (Qualisys TSV)",
    lambda p: head(p, 17).removeprefix(b"\xef\xbb\xbf").startswith(_ANALOG_MAGIC),
    read_qualisys_analog,
    "its first cell is NO_OF_SAMPLES",
    options=(frame("capture"),),
    extensions=(".tsv",),
)


# -------------------------------------------------------------------------------------------------

_MAGIC = (b"NO_OF_FRAMES", b"FILE_VERSION")  # the latter since its version 2.0.0
_NAMES = ("MARKER_NAMES", "BODY_NAMES")
_COUNTS = ("NO_OF_MARKERS", "NO_OF_BODIES")
_SIX, _EVENT = "6D", "EVENT"
_WIDE, _RESIDUAL, _TURN = 16, 6, 7  # columns of a body, and where two of them begin
_ROUNDED = 1e-3  # s: times have a few decimals
_ROUND = 0.02  # by which a rotation may miss being one: exports have few decimals


def read_qualisys(path: Path, options: Options) -> Recording:
    """Points as `markers` (nt, k, 3) m; blank cells and three zeros are "not seen", as that program
    exports either.

    Of a file of 6D each body's pose as `<body>/rotation` (nt, 9) and `/translation` (nt, 3) m.

    Options: `unit` in place of its mm, `sd` of a coordinate (0: not stated), `frame` (default
    capture). Raises `RecordingError` for a file of other data than 3D and 6D, without a frequency,
    with other points or bodies than it states, or damaged.
    """
    held = text_rows(path)
    header, names, body = _parts(held)
    rate = as_number(header.get("FREQUENCY", "")) or 0.0
    if not 0 < rate < np.inf:
        raise RecordingError(
            f"{held.name}: FREQUENCY '{header.get('FREQUENCY', '')}' is not a rate above 0 Hz"
        )

    if header.get("DATA_INCLUDED") == _SIX:
        return _bodies(path, held, header, names, body, rate, options)
    # Columns before the first coordinate, and those of each point: three, or its residual
    # too.
    points = len(names)
    width = max((len(r.cells) for r in body), default=0)
    clock = 3 if any(":" in r.cell(2) for r in body[:1]) else 2
    every = [(before, each) for before in (0, clock) for each in (3, 4)]
    over = {(b, each): width - b - each * points for b, each in every}
    open_end = not any(r.cell(width - 1) for r in body)
    fitting = [one for one in every if over[one] == 0 or (open_end and over[one] == 1)]
    if len(fitting) > 1:
        # Whether the first two columns of two rows go on as a frame's number and its time do.
        two = [[as_number(c) for c in r.cells[:2]] for r in body[:2]]
        cells = [c for row in two for c in row if c is not None]
        if len(cells) < 4:
            timed = False
        else:
            timed = cells[2] - cells[0] == 1 and abs(cells[3] - cells[1] - 1 / rate) < _ROUNDED
        fitting.sort(key=lambda one: ((one[0] > 0) != timed, over[one]))
    before, each = fitting[0] if fitting else (clock if width > 3 * points else 0, 3)
    width = before + each * len(names)
    values, rows, left = numbers(held, body, width, range(before, width))
    shown, zeros = without_zeros(values.reshape(len(values), -1, each)[..., :3])
    x = whole_points(held, shown, names, rows)
    factor = length({"unit": "mm", **options}, "unit", "mm")
    t = np.arange(len(values)) / rate
    markers = Markers(t, names, factor * x, spread(options), options.get("frame", "capture"))
    told = {
        "kind": "motion capture (Qualisys TSV)",
        "header": "; ".join(f"{k} {v}" for k, v in header.items() if v),
        "points_not_seen": f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}",
        "rows": f"{len(values)}, the header declares {header.get('NO_OF_FRAMES', 'none')}",
        **_events(held), **told_zeros(zeros), **told_left(left),
    }  # fmt: skip
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, {"markers": markers}, told)


def _events(held: TextRows) -> dict[str, str]:
    """Lines of a name, a frame and a time, in the time of the measurement."""
    told = [f"{r.cell(1)} {r.cell(3)} s" for r in held.rows if r.cell(0) == _EVENT]
    return (
        {"events": f"{'; '.join(told)} (events of the trial, listed but not stored as a stream)"}
        if told
        else {}
    )


def _parts(held: TextRows) -> tuple[dict[str, str], tuple[str, ...], list[TextRow]]:
    """Header, names of the points, and the rows of numbers."""
    if not held.rows or held.rows[0].cell(0).encode() not in _MAGIC:
        raise RecordingError(
            f"{held.name}: not a Qualisys text file: its first cell is not NO_OF_FRAMES"
        )
    keys = [r for r in held.rows if r.cell(0).isupper() and r.cell(0) not in ABSENT]
    header = {r.cell(0): r.cell(1) for r in keys if r.cell(0) not in (*_NAMES, _EVENT)}
    if header.get("DATA_INCLUDED", "3D") not in ("3D", _SIX):
        raise RecordingError(
            f"{held.name}: data of kind '{header['DATA_INCLUDED']}'; 3D and 6D are read: export one"
        )
    named = next(([c for c in r.cells[1:] if c] for r in keys if r.cell(0) in _NAMES), [])
    stated = next((header[k] for k in _COUNTS if k in header), "")
    if not named or (stated.isdecimal() and int(stated) != len(named)):
        raise RecordingError(
            f"{held.name}: {len(named)} names of points or bodies, the header states "
            f"{stated or 'none'}; damaged"
        )
    last = max(r.line for r in keys)
    rows = [r for r in held.rows if r.line > last and any(r.cells)]
    if rows and not any(as_number(c) is not None for c in rows[0].cells):
        rows = rows[1:]  # a line of column names
    return header, distinct(named, len(named)), rows


def _bodies(
    path: Path,
    held: TextRows,
    header: dict[str, str],
    names: tuple[str, ...],
    body: list[TextRow],
    rate: float,
    options: Options,
) -> Recording:
    """Poses of bodies where they were seen; the frame is that of the measurement."""
    most = max((len([c for c in r.cells if c]) for r in body), default=0)
    before = most - _WIDE * len(names)
    if before not in (0, 2):
        raise RecordingError(
            f"{path.name}: {most} columns for {len(names)} bodies; expected {_WIDE} each "
            "(position, angles, residual, rotation matrix), after frame and time or not; "
            "export the matrix"
        )
    values, _, left = numbers(held, body, most)
    t = np.arange(len(values)) / rate
    factor = length({"unit": "mm", **options}, "unit", "mm")
    frame = options.get("frame", "capture")
    streams: dict[str, Stream] = {}
    told = {}
    for k, name in enumerate(names):
        one = values[:, before + _WIDE * k :][:, :_WIDE]
        seen = ~np.isnan(one).any(axis=1) & (one[:, _RESIDUAL] >= 0) & one[:, _TURN:].any(axis=1)
        told[name] = f"{int((~seen).sum())} of {len(seen)}"
        if seen.any():
            # Rotations stand column by column.
            R = np.swapaxes(one[seen, _TURN:].reshape(-1, 3, 3), 1, 2)
            off = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
            bad = (off > _ROUND) | (np.linalg.det(R) < 0)
            if bad.any():
                raise RecordingError(
                    f"{path.name}: {name}: sample {int(bad.argmax()) + 1} is not a rotation (error "
                    f"{off[bad.argmax()]:.3g}); expected the columns of Qualisys 6D, or the file "
                    "is damaged"
                )
            streams |= pose_signals(name, t[seen], R, factor * one[seen, :3], frame)
    if not streams:
        raise RecordingError(f"{path.name}: no body is visible: {told}")
    unread = {n: "never seen" for n in names if f"{n}/rotation" not in streams}
    record = {
        "kind": "motion capture (Qualisys TSV, 6D)",
        "header": "; ".join(f"{k} {v}" for k, v in header.items() if v),
        "not_seen": "; ".join(f"{name}: {count}" for name, count in told.items()),
        **_events(held),
        **told_left(left),
    }
    source = source_of(path, "text file: integrity not provable")
    return recorded(path.stem, source, begun(streams), record, unread)


QUALISYS = Reader(
    "qualisys",
    "motion capture (Qualisys TSV)",
    lambda p: head(p, 15).removeprefix(b"\xef\xbb\xbf")[:12] in _MAGIC,
    read_qualisys,
    "its first cell is NO_OF_FRAMES or FILE_VERSION",
    options=(UNIT, SD, frame("capture")),
    extensions=(".tsv",),
)
