"""Tracked points in NumPy archives: positions over load steps, without times.

The unit stands at the end of the file's name (`points3d_mm.npz`), or is asked for. Archives are
read without pickles: they hold arrays and nothing else.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError, UsageError
from validate.files import npz_arrays
from validate.recording.reader import source_of
from validate.recording.types import Markers, Recording
from validate.units import si_factor

_MOST = 200_000_000  # bytes of one archive, unpacked
_UNIT = re.compile(r".*_(px|um|mm|cm|m)")


@dataclass(frozen=True)
class StageTest:
    """A rigid body on a stage as one camera saw it: points (nt, n, 2) px, NaN = not seen, and the
    stage's position (nt,) m."""

    name: str
    points: Floats
    stage: Floats


def read_points(path: Path, unit: str | None = None) -> Recording:
    """Markers `points` (nt, n, 3) m, NaN = not seen, of an array `points`; states count as seconds.

    Raises `UsageError` for a unit that nobody states, `RecordingError` for an archive that is
    missing, damaged or holds no such array, or one of whole numbers.
    """
    arrays = npz_arrays(path, _MOST)
    if "points" in arrays and (held := arrays["points"]).dtype.kind in "iu":
        raise RecordingError(
            f"{path.name}: points {held.shape} {held.dtype}: a list of indices (whole "
            "numbers), not points; if they are coordinates, save them as float"
        )
    factor = si_factor(unit or _said(path), "length")
    x = factor * _array(path, arrays, "points", (None, None, 3))
    markers = Markers(
        np.arange(len(x), dtype=np.float64), tuple(f"point {i + 1}" for i in range(x.shape[1])),
        x, 0.0, "cameras",
    )  # fmt: skip
    return Recording(
        path.stem,
        source_of(path, "verified (CRC-32)"),
        0,
        markers={"points": markers},
        metadata={
            "provenance": {"file": path.name, "unit": unit or f"{_said(path)}, from the file name"}
        },
        unread={k: f"{a.shape} {a.dtype}" for k, a in arrays.items() if k != "points"},
    )


def read_stage(path: Path) -> StageTest:
    """Arrays `points` (nt, n, 2) px and `stage_mm` (nt,); raises as `read_points` does."""
    arrays = npz_arrays(path, _MOST)
    x = _array(path, arrays, "points", (None, None, 2))
    stage = 1e-3 * _array(path, arrays, "stage_mm", (len(x),), nan=False)
    return StageTest(path.stem, x, stage)


def _array(
    path: Path, arrays: dict[str, np.ndarray], name: str, shape: tuple[int | None, ...],
    nan: bool = True,
) -> Floats:  # fmt: skip
    if name not in arrays or arrays[name].dtype.kind not in "fiu":
        raise RecordingError(f"{path.name}: no numbers '{name}'; it holds {sorted(arrays)}")
    return checked(arrays[name], f"{path.name}: {name}", shape, nan=nan, error=RecordingError)


def _said(path: Path) -> str:
    found = _UNIT.fullmatch(path.stem)
    if not found or found[1] == "px":
        raise UsageError(f"{path.name} has no unit; give it with --set unit=mm")
    return found[1]
