"""MATLAB 5 and 7.3 files: arrays that the user names, points and stacks of images.

Such a file states neither units nor times: what an array needs to become a stream is asked for.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError, UsageError
from validate.recording.formats.apart import decoded
from validate.recording.formats.array_kinds import field_at, no_stream
from validate.recording.formats.matlab_arrays import COMPRESSED, MAGIC, elements
from validate.recording.formats.matlab_named import (
    AXES,
    Arrays,
    listing,
    named_array,
    named_stream,
    note_on,
    numeric,
)
from validate.recording.formats.options import above_zero, length, spread
from validate.recording.formats.recorded import begun, recorded
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Frames, Markers, Recording, Stream

Variable = NDArray[Any]

_MAGIC_73 = b"MATLAB 7.3"
_OPTIONS = ("unit", "sd", "m_per_px", "rate", "frame", "time")


def read_matlab(path: Path, options: Options) -> Recording:
    """The arrays that the user names (`matlab_named`; images in px); where none is named, numbers
    (n, 2 or 3) as points at one instant and uint8 (h, w) or (h, w, nt) as images.

    A topic is the variable's path; points are named by their row, from 1. Options: STREAM=PATH:UNIT
    for each array that is named, `time` of all of them (PATH:UNIT) or `rate` (Hz), `axes.STREAM`;
    `unit` of coordinates (mm; 0.4um where they are pixels of that side), `sd` of one (0: not
    stated), `m_per_px` and `rate` of images, `frame` (default matlab). What else the file holds is
    listed as unread. Raises `UsageError` without an option that an array needs, `RecordingError`
    for a file that is cut, damaged, of another version, or without arrays of numbers.
    """
    require_known(
        [key for key, text in options.items() if not text], (*_OPTIONS, "STREAM=PATH:UNIT")
    )
    integrity = _integrity(path)
    found = _arrays(path)
    asked = {k: v for k, v in options.items() if k not in _OPTIONS and not k.startswith(AXES)}
    for key in options:
        if key.startswith(AXES) and key.removeprefix(AXES) not in asked:
            raise UsageError(f"--map {key}=...: no stream of that name; {sorted(asked) or 'none'}")
    if asked:
        streams, used, notes = _named(path, asked, found, options)
    else:
        (streams, used), notes = _unnamed(path, found, options), {}
    unread = {
        name: f"{said}: {why}" if (why := no_stream(name, found)) else said
        for name, said in listing(found).items()
        if name not in used
    }
    told = {"kind": _version(path), **options, **notes}
    return recorded(path.stem, source_of(path, integrity), begun(streams), told, unread)


def _named(
    path: Path, asked: Options, found: Arrays, options: Options
) -> tuple[dict[str, Stream], set[str], dict[str, str]]:
    """The streams that the user names, the paths of their arrays, and what is to be told."""
    if "unit" in options:
        raise UsageError(
            "--map unit=...: give the unit with each named array, as --map tip=x.tip:mm"
        )
    streams: dict[str, Stream] = {}
    notes: dict[str, str] = {}
    said = {key: named_array(key, text, found) for key, text in asked.items()}
    for key, array in said.items():
        try:
            if array.unit == "px":
                _require_stream(array.path, found)
                streams[key] = _frames(f"{path.name}: {array.path}", found[array.path], options)
                continue
            made = streams[key] = named_stream(key, array, found, options)
            if isinstance(made, Markers):
                _require_stream(array.path, found)
            if "time" not in options and (field := field_at(array.path, found)):
                raise RecordingError(field.refusal(f"an array {found[array.path].shape}"))
            if note := note_on(key, array, found, made, options):
                notes[key] = f"{asked[key]}: {note}"
        except RecordingError as error:
            raise RecordingError(f"{path.name}: {array.path}: {error}") from None
    time = {options["time"].split(":")[0]} if "time" in options else set()
    return streams, {array.path for array in said.values()} | time, notes


def _unnamed(path: Path, found: Arrays, options: Options) -> tuple[dict[str, Stream], set[str]]:
    """Points and images, which show by their shape."""
    require_known(options, _OPTIONS)
    none = {name: why for name in found if (why := no_stream(name, found))}
    made = {n: _stream(path, n, values, options) for n, values in found.items() if n not in none}
    streams: dict[str, Stream] = {name: s for name, s in made.items() if s is not None}
    if streams:
        return streams, set(streams)
    have = numeric(found)
    for name, why in none.items():
        raise RecordingError(f"{path.name}: {name} {found[name].shape} {found[name].dtype}: {why}")
    for name in have:
        if field := field_at(name, found):
            raise RecordingError(field.refusal(f"{path.name}: arrays {have[name].shape}"))
    if not have:
        raise RecordingError(
            f"{path.name}: neither points (n, 2 or 3) nor uint8 images (h, w, nt), nor other "
            f"numbers; it holds {listing(found) or 'nothing'}"
        )
    raise UsageError(
        f"{path.name}: no array's role is clear; name the arrays, as --map force=PATH:N "
        f"--map rate=100 or --map time=PATH:s; it holds {listing(found)}"
    )


def _require_stream(name: str, found: Arrays) -> None:
    """Refuse what is neither points nor images, whichever of its axes is the first."""
    turned = {**found, name: found[name].T}
    if why := no_stream(name, found) or no_stream(name, turned):
        raise RecordingError(f"{found[name].shape} {found[name].dtype}: {why}")


def held_in(path: Path) -> dict[str, str]:
    """Every array of a MATLAB file with its shape and type, and what is none by its word."""
    _integrity(path)
    return listing(_arrays(path))


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    new = head(path, len(_MAGIC_73)) == _MAGIC_73
    return decoded("matlab73_arrays" if new else "matlab_arrays", path)


def _version(path: Path) -> str:
    return head(path, len(_MAGIC_73)).decode("ascii", "replace")


def _integrity(path: Path) -> str:
    """What the file's bytes prove; raises `RecordingError` for one that is not whole."""
    if not path.is_file():
        raise RecordingError(
            f"{path}: no such file" if not path.exists() else f"{path}: not a file"
        )
    if head(path, len(_MAGIC_73)) == _MAGIC_73:
        return "HDF5 of MATLAB 7.3 keeps no checksum of its numbers: integrity not provable"
    try:
        kinds = [kind for kind, _, _ in elements(path)]
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error}") from None
    if all(kind == COMPRESSED for kind in kinds):
        return "verified (Adler-32 of each variable)"
    return "variables that are not compressed keep no checksum: integrity not provable"


def _stream(path: Path, name: str, values: Variable, options: Options) -> Markers | Frames | None:
    """The variable as a stream; none where its shape does not show one."""
    shape = values.shape
    try:
        if values.dtype == np.uint8 and len(shape) in (2, 3):
            return _frames(f"{path.name}: {name}", values, options)
        if values.dtype.kind in "fiu" and len(shape) == 2 and shape[0] > 1 and shape[1] in (2, 3):
            return _points(f"{path.name}: {name}", values, options)
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {name}: {error}") from None
    return None


def _points(what: str, values: Variable, options: Options) -> Markers:
    _said(what, "unit", "mm", options, "unit of length")
    unit = length(options, "unit", "mm")
    names = tuple(str(i + 1) for i in range(len(values)))
    x = unit * values[None].astype(np.float64)
    return Markers(np.zeros(1), names, x, spread(options), options.get("frame", "matlab"))


def _frames(what: str, values: Variable, options: Options) -> Frames:
    if values.dtype != np.uint8 or values.ndim not in (2, 3):
        raise RecordingError(f"{values.shape} {values.dtype}; images are uint8 (h, w, nt)")
    _said(what, "m_per_px", "0.1mm", options, "unit of length")
    side = length(options, "m_per_px", "0.1mm")
    images = tuple(np.moveaxis(np.atleast_3d(values), -1, 0))
    if len(images) > 1 and "rate" not in options:
        raise UsageError(
            f"{what} has no times; if its last axis is time (a volume is not read), give --map "
            f"rate=10"
        )
    t = np.arange(len(images)) / (above_zero(options, "rate") if len(images) > 1 else 1.0)
    return Frames(t, images, (side, side), np.eye(4), options.get("frame", "matlab"))


def _said(what: str, key: str, example: str, options: Options, lacks: str) -> None:
    if key not in options:
        raise UsageError(f"{what} has no {lacks}; give it, as --map {key}={example}")


MATLAB = Reader(
    "matlab",
    "MATLAB 5 or 7.3",
    lambda p: head(p, len(MAGIC)) == MAGIC or head(p, len(_MAGIC_73)) == _MAGIC_73,
    read_matlab,
    "it begins with 'MATLAB 5.0' or 'MATLAB 7.3'",
    holds=held_in,
)
