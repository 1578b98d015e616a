"""Reader of a gauge's log: lines of time s, displacement mm and force, below the line `# gauge`."""

from pathlib import Path

import numpy as np

from validate.errors import RecordingError, UsageError
from validate.recording.formats.streams import recorded
from validate.recording.reader import MapOption, Options, Reader, head, source_of
from validate.recording.types import Recording, Signal
from validate.units import in_si

_MAGIC = b"# gauge\n"


def read_gauge(path: Path, options: Options) -> Recording:
    """Return `displacement` (nt, 1) m and `force` (nt, 1) N, compression positive."""
    unit = options.get("unit", "N")
    factor = in_si(1.0, unit, "N")
    if factor is None:
        raise UsageError(f"--map unit={unit}: expected a unit of force, as mN")
    if path.is_dir() or head(path, len(_MAGIC)) != _MAGIC:
        raise RecordingError(f"{path.name}: its first line is not '# gauge'; name a gauge's log")
    if not path.read_bytes().endswith(b"\n"):
        raise RecordingError(f"{path.name}: the last line is truncated; copy the file again")
    try:
        t, displacement, force = np.loadtxt(path, ndmin=2).T
    except ValueError as error:
        raise RecordingError(f"{path.name}: no table of three columns ({error})") from None
    streams = {
        "displacement": Signal(t - t[0], 1e-3 * displacement[:, None], "m", 1e-6, "gauge"),
        "force": Signal(t - t[0], factor * force[:, None], "N", 0.01, "gauge"),
    }
    integrity = source_of(path, "text without a checksum: integrity not provable")
    return recorded(path.stem, integrity, streams, {"kind": "gauge"})


GAUGE = Reader(
    name="gauge",
    doc="log of a force gauge",
    recognises=lambda path: head(path, len(_MAGIC)) == _MAGIC,
    read=read_gauge,
    sign="its first line is '# gauge'",
    options=(MapOption("unit", "unit of the forces", "a force", "N"),),
    extensions=(".gauge",),
)
