"""A folder of PNG images as frames."""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.images.image import Pixels, decode_png
from validate.recording.types import Frames

MAX_STACK = 400 * 2**20  # bytes of all images of one stack
MAX_FILE = 64 * 2**20  # bytes of one PNG


def read_png_stack(
    folder: Path,
    m_per_px: tuple[float, float],
    *,
    times: Sequence[float] | None = None,
    rate_hz: float | None = None,
    pose: Floats | None = None,
    frame: str = "image",
) -> Frames:
    """All *.png of a folder as frames, in the order of the numbers in their names.

    Give either `times` (one a file, s) or `rate_hz`. `pose` is T_frame_from_image (4, 4), default
    identity. Raises `RecordingError`: no files, equal numbers, sizes that differ, over `MAX_STACK`.
    """
    files = _numbered(folder)
    images: list[Pixels] = []
    total = 0
    for file in files:
        images.append(_read(file))
        total += images[-1].size
        if total > MAX_STACK:
            raise RecordingError(f"{folder.name}: more than {MAX_STACK} bytes; split the stack")
    t = _stack_times(len(files), times, rate_hz, folder.name)
    return Frames(t, tuple(images), m_per_px, np.eye(4) if pose is None else pose, frame)


def _numbered(folder: Path) -> list[Path]:
    try:
        files = [f for f in folder.iterdir() if f.suffix.lower() == ".png"]
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be read ({error.strerror})") from error
    if not files:
        raise RecordingError(f"{folder}: no *.png files")
    keys = {f: tuple(int(n) for n in re.findall(r"\d+", f.stem)[:8]) for f in files}
    files.sort(key=lambda f: (keys[f], f.name))
    for a, b in pairwise(files):
        if keys[a] == keys[b]:
            raise RecordingError(
                f"{folder.name}: '{a.name}' and '{b.name}' have the same number; "
                "number the files in order of time"
            )
    return files


def _read(file: Path) -> Pixels:
    try:
        if file.stat().st_size > MAX_FILE:
            raise RecordingError(f"{file.name}: {file.stat().st_size} bytes, limit {MAX_FILE}")
        return decode_png(file.read_bytes())
    except OSError as error:
        raise RecordingError(f"{file.name}: cannot be read ({error.strerror})") from error
    except RecordingError as error:
        raise RecordingError(f"{file.name}: {error}") from None


def _stack_times(
    count: int, times: Sequence[float] | None, rate_hz: float | None, name: str
) -> Floats:
    if (times is None) == (rate_hz is None):
        raise RecordingError(f"{name}: give either the times of its {count} images or their rate")
    if times is not None:
        return np.asarray(times, dtype=np.float64)
    if rate_hz is None or not 0 < rate_hz < np.inf:
        raise RecordingError(f"{name}: rate {rate_hz} Hz is not a positive number")
    return np.arange(count) / rate_hz
