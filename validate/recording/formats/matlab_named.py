"""Arrays of a file that states neither meaning nor unit, as the streams that a user names.

`--map force=data.load.N:kN`: the stream `force` is the array `data.load.N`, in kN. What its axes
are is told by the times where only one order fits, else it is asked for.
"""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import UsageError
from validate.recording.formats.options import above_zero, spread
from validate.recording.reader import Options
from validate.recording.types import Markers, Signal
from validate.units import in_si, si_of

Arrays = Mapping[str, NDArray[Any]]
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
    """The stream `key`: axes t alone or t and c (channels) make a signal, those with x points.

    Raises `UsageError` for what is not said or does not fit, `RecordingError` for numbers that are
    none.
    """
    values = found[said.path].astype(np.float64)
    values = values.ravel() if values.size == max(values.shape, default=1) else values
    t = times_of(options, found)
    order = _order(key, values.shape, None if t is None else len(t), options)
    factor, unit = si_of(said.unit)
    scaled = said.sign * factor * values
    frame = options.get("frame", "matlab")
    if "x" in order:
        return _markers(key, scaled, order, unit, t, options, frame)
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


def _order(key: str, shape: tuple[int, ...], nt: int | None, options: Options) -> str:
    """Which axis is which: t times, c channels, p points, x coordinates; r, which they
    have with a residual, is told as x."""
    told = options.get(f"{AXES}{key}", "")
    if told:
        order = told.replace("r", "x")
        plain = tuple(
            3 if (c, n) == ("r", _RESIDUAL) else 0 if c == "r" else n
            for c, n in zip(told, shape, strict=False)
        )
        if order not in _KNOWN or len(told) != len(shape) or not _fits(order, plain, nt):
            raise UsageError(f"--map {AXES}{key}={told}: {_misfit(key, shape, nt)}")
        return order
    fitting = [order for order in _ORDERS.get(len(shape), ()) if _fits(order, shape, nt)]
    if len(fitting) != 1:
        raise UsageError(f"{key}: {_misfit(key, shape, nt)}")
    return fitting[0]


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


def _markers(
    key: str, x: Floats, order: str, unit: str, t: Floats | None, options: Options, frame: str
) -> Markers:
    if unit != "m":
        raise UsageError(f"{key}: coordinates in '{unit}'; expected a length, as :mm")
    whole = np.transpose(x, [order.index(c) for c in "tpx" if c in order])
    whole = whole[..., :3].reshape(
        whole.shape[0] if "t" in order else 1, -1 if "p" in order else 1, min(whole.shape[-1], 3)
    )
    names = tuple(str(i + 1) for i in range(whole.shape[1]))
    times = _times(key, len(whole), t, options) if "t" in order else np.zeros(1)
    return Markers(times, names, whole, spread(options), frame)


def _times(key: str, count: int, t: Floats | None, options: Options) -> Floats:
    if t is not None:
        if len(t) != count:
            raise UsageError(f"{key}: {count} samples, the time of --map time= has {len(t)}")
        return t
    if "rate" not in options:
        raise UsageError(f"{key} has no times; give --map time=PATH:s or --map rate=100")
    return np.arange(count) / above_zero(options, "rate")
