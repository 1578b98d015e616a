"""MATLAB 5 files: arrays of points and stacks of images, by the names of their variables.

Such a file states neither units nor times: what an array needs to become a stream is asked for.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError, UsageError
from validate.recording.formats.apart import decoded
from validate.recording.formats.matlab_arrays import COMPRESSED, MAGIC, elements
from validate.recording.formats.options import above_zero, length, spread
from validate.recording.formats.recorded import recorded
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Frames, Markers, Recording

Variable = NDArray[Any]

_OPTIONS = ("unit", "sd", "m_per_px", "rate", "frame")


def read_matlab(path: Path, options: Options) -> Recording:
    """Numbers (n, 2 or 3) as points at one instant, uint8 (h, w) or (h, w, nt) as images.

    A topic is the variable's name; points are named by their row, from 1. Options: `unit` of the
    coordinates (mm; 0.4um where they are pixels of that side), `sd` of one (0: not stated),
    `m_per_px` and `rate` (Hz) of images, `frame` (default matlab). What else the file holds is
    listed as unread. Raises `UsageError` without an option that an array needs, `RecordingError`
    for a file that is cut, damaged, of another version, or without points and images.
    """
    require_known(options, _OPTIONS)
    integrity = _integrity(path)
    found = decoded("matlab_arrays", path, "all")
    streams = {name: _stream(path, name, values, options) for name, values in found.items()}
    read = {name: s for name, s in streams.items() if not isinstance(s, str)}
    unread = {name: s for name, s in streams.items() if isinstance(s, str)}
    if not read:
        raise RecordingError(
            f"{path.name}: neither points (n, 2 or 3) nor uint8 images (h, w, nt); "
            f"it holds {unread or 'nothing'}"
        )
    told = {"kind": "MATLAB 5", **options}
    return recorded(path.stem, source_of(path, integrity), read, told, unread)


def _integrity(path: Path) -> str:
    """What the file's bytes prove; raises `RecordingError` for one that is not whole."""
    if not path.is_file():
        raise RecordingError(f"{path}: no such file" if not path.exists() else f"{path}: no file")
    try:
        kinds = [kind for kind, _, _ in elements(path)]
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error}") from None
    if all(kind == COMPRESSED for kind in kinds):
        return "verified (Adler-32 of each variable)"
    return "variables that are not compressed keep no checksum: integrity not provable"


def _stream(path: Path, name: str, values: Variable, options: Options) -> Markers | Frames | str:
    """The variable as a stream, or what it is instead."""
    shape = values.shape
    try:
        if values.dtype == np.uint8 and len(shape) in (2, 3):
            return _frames(f"{path.name}: {name}", values, options)
        if values.dtype.kind in "fiu" and len(shape) == 2 and shape[0] > 1 and shape[1] in (2, 3):
            return _points(f"{path.name}: {name}", values, options)
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {name}: {error}") from None
    return str(values) if values.dtype.kind == "U" else f"{shape} {values.dtype}"


def _points(what: str, values: Variable, options: Options) -> Markers:
    _said(what, "unit", "mm", options, "unit of length")
    unit = length(options, "unit", "mm")
    names = tuple(str(i + 1) for i in range(len(values)))
    x = unit * values[None].astype(np.float64)
    return Markers(np.zeros(1), names, x, spread(options), options.get("frame", "matlab"))


def _frames(what: str, values: Variable, options: Options) -> Frames:
    _said(what, "m_per_px", "0.1mm", options, "unit of length")
    side = length(options, "m_per_px", "0.1mm")
    images = tuple(np.moveaxis(np.atleast_3d(values), -1, 0))
    if len(images) > 1:
        _said(what, "rate", "10", options, "times")
    t = np.arange(len(images)) / (above_zero(options, "rate") if len(images) > 1 else 1.0)
    return Frames(t, images, (side, side), np.eye(4), options.get("frame", "matlab"))


def _said(what: str, key: str, example: str, options: Options, lacks: str) -> None:
    if key not in options:
        raise UsageError(f"{what} states no {lacks}; say it: --map {key}={example}")


MATLAB = Reader(
    "matlab",
    "MATLAB 5",
    lambda p: head(p, len(MAGIC)) == MAGIC,
    read_matlab,
    "it begins with 'MATLAB 5.0'",
)
