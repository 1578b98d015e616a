"""Reader of MATLAB 5 and 7.3 files: points, stacks of images, arrays by name.

Such a file states neither units nor times: what an array needs to become a stream is asked for.
"""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.formats.matlab_arrays import COMPRESSED, MAGIC, MAGIC_73, elements
from validate.recording.formats.streams import begun, recorded
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.reader import (
    M_PER_PX,
    RATE,
    SD,
    UNIT,
    MapOption,
    Options,
    Reader,
    above_zero,
    frame,
    head,
    length,
    require_known,
    source_of,
    spread,
)
from validate.recording.tables.point_table import FieldColumns, field_columns
from validate.recording.tables.vocabulary import role_of_name
from validate.recording.types import Frames, Markers, Recording, Signal, Stream
from validate.units import in_si, si_of

# --- Index lists, volumes and displacement fields among the arrays of a file.
#
# None of them is a stream: triangles are rows of another array, a volume has depth where a film
# has time, and a field has places where a motion has instants.

Arrays = Mapping[str, NDArray[Any]]
_LISTS = re.compile(r"faces?|tri(angle)?s?|connectivity\w*|elem(ent)?s?|edges?|simplices", re.I)
_LETTERS = re.compile(r"[tfe]|cells?", re.I)  # so are lists called, and others
_VOLUME = re.compile(r"(\w*_)?(vol|volumes?|voxels?|ct|mri?|labelmap)(_?\d+|_\w*)?", re.I)
_SPACING = re.compile(r"\w*(spacing|voxel|pixdim|pixeldim)\w*", re.I)


def no_stream(path: str, found: Arrays) -> str:
    """Return why the array at `path` is neither points nor images over time; empty where it may
    be."""
    values = found[path]
    if values.dtype.kind not in "fiu":
        return ""
    if values.ndim == 2 and values.shape[1] in (2, 3) and len(values) > 1:
        # Whole numbers, each row an edge or a triangle by the rows of its corners in another
        # array.
        values = found[path]
        if not np.isfinite(values).all() or (values != np.rint(values)).any():
            return ""
        low, high, kinds = int(values.min()), int(values.max()), len(np.unique(values))
        what = (
            f"a list of {('edges', 'triangles')[values.shape[1] - 2]} by the rows of another array"
        )
        told = f"{what} (whole numbers {low} to {high}), not points"
        if values.dtype.kind in "iu":
            return f"{told}; if they are coordinates, save them as double"
        others = (a for n, a in found.items() if n != path and a.ndim == 2 and a.dtype.kind == "f")
        listed = low >= 0 and high <= max(map(len, others), default=0)
        name, twice = _leaf(path), (np.diff(np.sort(values, axis=1), axis=1) == 0).any()
        if _LISTS.fullmatch(name) or (_LETTERS.fullmatch(name) and listed):
            return told
        all_occur = low in (0, 1) and kinds == high - low + 1
        shared = values.size >= 2 * kinds and not twice
        return told if shared and (all_occur or listed) else ""
    deep = values.dtype == np.uint8 and values.ndim == 3 and min(values.shape) > 1
    if deep:
        # By its name, or by a spacing in three directions beside it.
        three = [n for n, a in found.items() if a.size == 3 and _SPACING.fullmatch(_leaf(n))]
        if not three and not _VOLUME.fullmatch(_leaf(path)):
            return ""
        by = f"{three[0]} has three numbers" if three else "its name says so"
        return f"a volume ({by}), not images over time; images are read as uint8 (h, w, nt)"
    return ""


def field_at(path: str, found: Arrays) -> FieldColumns | None:
    """Return the displacement field that the array at `path` is a column of; None where it is of
    none, or an array of times has the same shape."""
    same = {n: _leaf(n) for n, a in found.items() if a.shape == found[path].shape and a.size > 1}
    field = field_columns(list(same.values()))
    timed = any(role_of_name(leaf) == "time" for leaf in same.values())
    columns = () if field is None else (*field.places, *field.displacements, *field.strains)
    return field if not timed and same.get(path) in columns else None


def _leaf(path: str) -> str:
    return path.rpartition(".")[2]


# --- Arrays of a file that states neither meaning nor unit, as the streams that a user names.
#
# `--map force=data.load.N:kN`: the stream `force` is the array `data.load.N`, in kN. What its
# axes are is told by the times where only one order fits, else it is asked for.

AXES = "axes."  # --map axes.STREAM=LETTERS
_RESIDUAL = 4  # numbers of a point with its residual, as Qualisys has them
_SHOWN = 12  # arrays in a message
_ORDERS = {1: ("t",), 2: ("tc", "ct"), 3: tuple(map("".join, permutations("tpx")))}
_KNOWN = {*(order for all_ in _ORDERS.values() for order in all_), "tx", "xt", "px", "xp"}


@dataclass(frozen=True)
class NamedArray:
    """The array at `path`, in `unit`, with its `sign`, as the user named it for a stream."""

    path: str
    unit: str
    sign: float


def numeric(found: Arrays) -> dict[str, NDArray[Any]]:
    """Arrays of real numbers."""
    return {name: a for name, a in found.items() if a.dtype.kind in "fiub"}


def listing(found: Arrays) -> dict[str, str]:
    """Shape and type of every array, and what is none by its own word."""
    return {
        name: str(a) if a.dtype.kind == "U" else f"{a.shape} {a.dtype}" for name, a in found.items()
    }


def named_array(key: str, text: str, found: Arrays) -> NamedArray:
    """What `--map key=PATH:UNIT[:-]` says; raises `UsageError` naming the nearest path, or asking
    for the unit."""
    path, *more = text.split(":")
    have = numeric(found)
    if path not in have:
        kind = f"is {listing(found)[path]}, no real numbers" if path in found else "is no array"
        near = difflib.get_close_matches(path, have, n=1, cutoff=0.3)
        mean = f"did you mean '{near[0]}'? " if near else ""
        there = ", ".join(f"{n} {have[n].shape}" for n in list(have)[:_SHOWN])
        raise UsageError(f"--map {key}={text}: '{path}' {kind}; {mean}arrays: {there or 'none'}")
    unit = more[0] if more else ""
    if not unit:
        example = "s" if key == "time" else "N"
        raise UsageError(f"{path} has no unit; give it, as --map {key}={path}:{example}")
    if len(more) > 2 or more[1:] not in ([], ["-"]):
        raise UsageError(f"--map {key}={text}: expected PATH:UNIT or PATH:UNIT:-")
    if key == "time" and more[1:]:
        raise UsageError(f"--map time={text}: time has no sign to set")
    return NamedArray(path, unit, -1.0 if more[1:] else 1.0)


def times_of(options: Options, found: Arrays) -> Floats | None:
    """Times (nt,) s of `--map time=PATH:UNIT`; none where that is not said."""
    if "time" not in options:
        return None
    said = named_array("time", options["time"], found)
    factor = in_si(1.0, said.unit, "s")
    values = np.squeeze(found[said.path]).astype(np.float64)
    if factor is None or values.ndim != 1:
        raise UsageError(
            f"--map time={options['time']}: expected a vector and a unit of time; it is "
            f"{found[said.path].shape}"
        )
    return np.asarray(factor * values)


def named_stream(key: str, said: NamedArray, found: Arrays, options: Options) -> Signal | Markers:
    """Return the stream `key`: axes t alone or t and c (channels) make a signal, those with x
    points.

    Raises `UsageError` for what is not said or does not fit, `RecordingError` for numbers that are
    none.
    """
    values = found[said.path].astype(np.float64)
    values = values.ravel() if values.size == max(values.shape, default=1) else values
    t = times_of(options, found)
    # Which axis is which: t times, c channels, p points, x coordinates; r, which they have
    # with a residual, is told as x.
    shape = values.shape
    nt = None if t is None else len(t)
    told = options.get(f"{AXES}{key}", "")
    if told:
        order = told.replace("r", "x")
        plain = tuple(
            3 if (c, n) == ("r", _RESIDUAL) else 0 if c == "r" else n
            for c, n in zip(told, shape, strict=False)
        )
        if order not in _KNOWN or len(told) != len(shape) or not _fits(order, plain, nt):
            raise UsageError(f"--map {AXES}{key}={told}: {_misfit(key, shape, nt)}")
    else:
        fitting = [order for order in _ORDERS.get(len(shape), ()) if _fits(order, shape, nt)]
        if len(fitting) != 1:
            raise UsageError(f"{key}: {_misfit(key, shape, nt)}")
        order = fitting[0]
    factor, unit = si_of(said.unit)
    scaled = said.sign * factor * values
    frame = options.get("frame", "matlab")
    if "x" in order:
        if unit != "m":
            raise UsageError(f"{key}: coordinates in '{unit}'; expected a length, as :mm")
        whole = np.transpose(scaled, [order.index(c) for c in "tpx" if c in order])
        whole = whole[..., :3].reshape(
            whole.shape[0] if "t" in order else 1,
            -1 if "p" in order else 1,
            min(whole.shape[-1], 3),
        )
        names = tuple(str(i + 1) for i in range(whole.shape[1]))
        times = _times(key, len(whole), t, options) if "t" in order else np.zeros(1)
        return Markers(times, names, whole, spread(options), frame)
    y = scaled.reshape(len(scaled), -1) if order[0] == "t" else scaled.T
    times, kept = _times(key, len(y), t, options), ~np.isnan(y).any(axis=1)
    return (
        Signal(times[kept], y[kept], unit, 0.0, frame)
        if kept.any()
        else Signal(times, y, unit, 0.0, frame)
    )


def note_on(
    key: str, said: NamedArray, found: Arrays, made: Signal | Markers, options: Options
) -> str:
    """What was taken in a way that the array does not state, or left out; empty where nothing."""
    given = found[said.path]
    if isinstance(made, Markers):
        wide = made.x.size < given.size
        return f"the last of {_RESIDUAL} numbers of each point left out" if wide else ""
    gone = given.size // made.y.shape[1] - len(made.t)
    notes = [f"{gone} samples without a number left out"] if gone else []
    point = made.unit == "m" and made.y.shape[1] in (2, 3) and f"{AXES}{key}" not in options
    if point:
        notes.append(f"channels; if they are a point's coordinates: --map {AXES}{key}=tx")
    return "; ".join(notes)


def _fits(order: str, shape: tuple[int, ...], nt: int | None) -> bool:
    size = dict(zip(order, shape, strict=True))
    return size.get("x", 3) in (2, 3) and (nt is None or size.get("t", nt) == nt)


def _misfit(key: str, shape: tuple[int, ...], nt: int | None) -> str:
    times = "no times are given" if nt is None else f"{nt} times"
    return (
        f"an array of {shape} and {times} do not show which axis is which; give --map time=PATH:s, "
        f"or --map {AXES}{key}=tpx (t times, p points, x coordinates, r those and a residual, "
        "c channels; one letter an axis)"
    )


def _times(key: str, count: int, t: Floats | None, options: Options) -> Floats:
    if t is not None:
        if len(t) != count:
            raise UsageError(f"{key}: {count} samples, the time of --map time= has {len(t)}")
        return t
    if "rate" not in options:
        raise UsageError(f"{key} has no times; give --map time=PATH:s or --map rate=100")
    return np.arange(count) / above_zero(options, "rate")


# -------------------------------------------------------------------------------------------------

Variable = NDArray[Any]

_GENERAL = (
    UNIT,
    SD,
    M_PER_PX,
    RATE,
    frame("matlab"),
    MapOption("time", "array of the times of all streams, as PATH:UNIT"),
)
_OPTIONS = (
    *_GENERAL,
    MapOption("axes.STREAM", "order of the axes of an array"),
    MapOption("STREAM", "array that becomes this stream, as PATH:UNIT"),
)


def read_matlab(path: Path, options: Options) -> Recording:
    """Return the arrays that the user names (`matlab_named`; images in px); where none is named,
    numbers (n, 2 or 3) as points at one instant and uint8 (h, w) or (h, w, nt) as images.

    A topic is the variable's path; points are named by their row, from 1. Options: STREAM=PATH:UNIT
    for each array that is named, `time` of all of them (PATH:UNIT) or `rate` (Hz), `axes.STREAM`;
    `unit` of coordinates (mm; 0.4um where they are pixels of that side), `sd` of one (0: not
    stated), `m_per_px` and `rate` of images, `frame` (default matlab). What else the file holds is
    listed as unread. Raises `UsageError` without an option that an array needs, `RecordingError`
    for a file that is cut, damaged, of another version, or without arrays of numbers.
    """
    require_known([key for key, text in options.items() if not text], _GENERAL)
    integrity = _integrity(path)
    found = decoded("validate.recording.formats.matlab_arrays", path)
    general = {option.name for option in _GENERAL}
    asked = {k: v for k, v in options.items() if k not in general and not k.startswith(AXES)}
    for key in options:
        if key.startswith(AXES) and key.removeprefix(AXES) not in asked:
            raise UsageError(f"--map {key}=...: no stream of that name; {sorted(asked) or 'none'}")
    if asked:
        # The streams that the user names, the paths of their arrays, and what is to be told.
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
        used = {array.path for array in said.values()} | time
    else:
        (streams, used), notes = _unnamed(path, found, options), {}
    unread = {
        name: f"{said}: {why}" if (why := no_stream(name, found)) else said
        for name, said in listing(found).items()
        if name not in used
    }
    told = {"kind": head(path, len(MAGIC_73)).decode("ascii", "replace"), **options, **notes}
    return recorded(path.stem, source_of(path, integrity), begun(streams), told, unread)


def _unnamed(path: Path, found: Arrays, options: Options) -> tuple[dict[str, Stream], set[str]]:
    """Points and images, which show by their shape."""
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
    return listing(decoded("validate.recording.formats.matlab_arrays", path))


def _integrity(path: Path) -> str:
    """What the file's bytes prove; raises `RecordingError` for one that is not whole."""
    if not path.is_file():
        raise RecordingError(
            f"{path}: no such file" if not path.exists() else f"{path}: not a file"
        )
    if head(path, len(MAGIC_73)) == MAGIC_73:
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
            _said(f"{path.name}: {name}", "unit", "mm", options, "unit of length")
            unit = length(options, "unit", "mm")
            names = tuple(str(i + 1) for i in range(len(values)))
            x = unit * values[None].astype(np.float64)
            return Markers(np.zeros(1), names, x, spread(options), options.get("frame", "matlab"))
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {name}: {error}") from None
    return None


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
    lambda p: head(p, len(MAGIC)) == MAGIC or head(p, len(MAGIC_73)) == MAGIC_73,
    read_matlab,
    "it begins with 'MATLAB 5.0' or 'MATLAB 7.3'",
    holds=held_in,
    options=_OPTIONS,
    extensions=(".mat",),
)
