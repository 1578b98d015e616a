"""Analog channels and force plates as Qualisys Track Manager exports them: a text of samples."""

from pathlib import Path

import numpy as np

from validate.errors import RecordingError
from validate.recording.formats.recorded import distinct, recorded
from validate.recording.formats.text_rows import (
    TextRow,
    as_number,
    numbers,
    text_rows,
    told_left,
)
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Recording, Signal, Stream

_MAGIC = b"NO_OF_SAMPLES"
_NAMES = "CHANNEL_NAMES"
_CLOCK = ("sample", "frame", "time")  # columns that are no channel
_OPTIONS = ("frame",)


def read_qualisys_analog(path: Path, options: Options) -> Recording:
    """Each channel as `analog/<name>` (nt, 1); the file states no unit of any.

    Times are samples over its frequency. Options: `frame` (default capture). Raises
    `RecordingError` for a file without names or frequency, or damaged.
    """
    require_known(options, _OPTIONS)
    held = text_rows(path)
    first = next((i for i, r in enumerate(held.rows) if _is_sample(r)), len(held.rows))
    above = held.rows[:first]
    header = {r.cell(0): r.cell(1) for r in above}
    rate = as_number(header.get("FREQUENCY", "")) or 0.0
    columns = _columns(above)
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


def _is_sample(row: TextRow) -> bool:
    return as_number(row.cell(0)) is not None


def _columns(above: tuple[TextRow, ...]) -> list[str]:
    """Names after their key, else the last line above the samples."""
    for row in above:
        if row.cell(0) == _NAMES:
            return [c for c in row.cells[1:] if c]
    return [c for c in above[-1].cells if c] if above else []


QUALISYS_ANALOG = Reader(
    "qualisys-analog",
    "analog channels (Qualisys TSV)",
    lambda p: head(p, 17).removeprefix(b"\xef\xbb\xbf").startswith(_MAGIC),
    read_qualisys_analog,
    "its first cell is NO_OF_SAMPLES",
)
