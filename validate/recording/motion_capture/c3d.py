"""Reader of C3D motion capture: labelled points, analog channels, residuals.

The file's own words are taken: labels, unit, rate. A residual is the mean distance of the rays that
meet in a point, not a standard deviation: it is told, never used as one.
"""

from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.formats.streams import distinct, recorded
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.motion_capture.c3d_arrays import BLOCK, MOST, layout, records
from validate.recording.motion_capture.poses import pose_signals
from validate.recording.motion_capture.text_rows import LEFT_OUT, told_zeros, without_zeros
from validate.recording.reader import (
    SD,
    UNIT,
    Options,
    Reader,
    frame,
    head,
    metres,
    source_of,
    spread,
)
from validate.recording.types import Markers, Record, Recording, Signal, Stream

# --- What a C3D file holds as streams: points, computed outputs, analog channels, poses of
# bodies.

NOT_STATED = "not stated"
_NEVER = "never seen"
_MATRIX = "_4X4"  # behind the names of poses
Held = Mapping[str, NDArray[Any]]  # as `c3d_arrays.arrays` has them
Found = tuple[dict[str, Stream], dict[str, str]]  # streams, and why others are none


def names_of(found: Held) -> tuple[str, ...]:
    """Return a name for everything among the points."""
    return distinct(found["labels"].tolist(), found["points"].shape[1])


def is_output(found: Held) -> NDArray[np.bool_]:
    """Which of what stands among the points (n,) is a computed output, as an angle."""
    told = {label for label, _ in found["outputs"].tolist()}
    return np.array([name in told for name in names_of(found)], dtype=bool)


def markers_of(
    found: Held, rate: float, factor: float, sd: float, frame: str
) -> tuple[Markers, Record]:
    """Points (nt, k, 3) m and what is told of them: NaN where a residual is below 0, or all three
    coordinates are zero, which programs write for what no camera saw."""
    own = ~is_output(found)
    missing = (found["residuals"] < 0)[:, own, None]
    shown, zeros = without_zeros(np.where(missing, np.nan, found["points"][:, own]))
    names = tuple(n for n, kept in zip(names_of(found), own, strict=True) if kept)
    x: Floats = factor * np.where(np.isfinite(shown).all(axis=2, keepdims=True), shown, np.nan)
    residuals = found["residuals"][:, own]
    seen = residuals[residuals > 0]
    told = {
        "points_not_seen": f"{int(np.isnan(x[..., 0]).sum())} of {x[..., 0].size}",
        **told_zeros(zeros),
        "residual_median_m": f"{factor * np.median(seen):.3g}" if len(seen) else NOT_STATED,
    }
    return Markers(np.arange(len(x)) / rate, names, x, sd, frame), told


def outputs_of(found: Held, rate: float, frame: str) -> Found:
    """Each computed output as `model/<label>` (nt, 3) in its own unit, where it has a value."""
    units = dict(found["outputs"].tolist())
    streams: dict[str, Stream] = {}
    never = {}
    for i, (name, output) in enumerate(zip(names_of(found), is_output(found), strict=True)):
        values = found["points"][:, i]
        has = (found["residuals"][:, i] >= 0) & np.isfinite(values).all(axis=1)
        if output and not has.any():
            never[f"model/{name}"] = _NEVER
        elif output:
            t = np.flatnonzero(has) / rate
            streams[f"model/{name}"] = Signal(t, values[has], units[name] or NOT_STATED, 0.0, frame)
    return streams, never


def analog_of(found: Held, rate: float, frame: str) -> Found:
    """Each channel as `analog/<label>`; one with numbers that are none is left out and told."""
    values = found["analog"]
    units = [str(u) for u in found["channel_units"]] + [""] * values.shape[1]
    t = np.arange(len(values)) / rate if rate > 0 else np.empty(0)
    streams: dict[str, Stream] = {}
    never = {}
    for i, name in enumerate(distinct(found["channels"].tolist(), values.shape[1])):
        odd = int((~np.isfinite(values[:, i])).sum())
        if not len(t) or odd:
            never[f"analog/{name}"] = (
                f"{odd} values are not numbers" if odd else "no rate is declared"
            )
        else:
            unit = units[i] or NOT_STATED
            streams[f"analog/{name}"] = Signal(t, values[:, [i]], unit, 0.0, frame)
    return streams, never


def poses_of(found: Held, rate: float, factor: float, frame: str) -> Found:
    """Each body's pose as `<body>/rotation` and `<body>/translation`, where it is one."""
    poses = found["poses"]
    streams: dict[str, Stream] = {}
    never = {}
    for i, label in enumerate(distinct(found["bodies"].tolist(), poses.shape[1])):
        name = label.removesuffix(_MATRIX)
        T = poses[:, i]
        seen = np.isfinite(T).all(axis=(1, 2)) & T[:, :3, :3].any(axis=(1, 2))
        if rate <= 0 or not seen.any():
            never[name] = _NEVER if rate > 0 else "no rate is declared"
        else:
            x = factor * T[seen, :3, 3]
            streams |= pose_signals(name, np.flatnonzero(seen) / rate, T[seen, :3, :3], x, frame)
    return streams, never


# -------------------------------------------------------------------------------------------------

MARKERS = "markers"
_KEY = 80  # the second byte of every C3D file


def read_c3d(path: Path, options: Options) -> Recording:
    """Points as `markers`, computed outputs among them as `model/<label>`, each analog channel as
    `analog/<label>` in the unit that it states, poses as `<body>/rotation` and `/translation`.

    Options: `unit` of length where the file states none, `sd` of a coordinate (as 0.3mm; 0: not
    stated), `frame` (default capture). A point that was not seen is NaN. Raises `UsageError`
    without a unit of length, `RecordingError` for a file that is cut, damaged or no C3D.
    """
    _require_whole(path)
    found = decoded("validate.recording.motion_capture.c3d_arrays", path)
    rate = float(found["rates"][0])
    if not (np.isfinite(rate) and rate > 0):
        raise RecordingError(f"{path.name}: {rate:g} frames per second declared; expected above 0")
    streams, told, never = _streams(path, found, rate, options)
    if not streams:
        raise RecordingError(f"{path.name}: neither visible points nor channels: {never}")
    source = source_of(path, "C3D keeps no checksum: integrity not provable")
    return recorded(path.stem, source, streams, told, never)


def _streams(
    path: Path, found: Held, rate: float, options: Options
) -> tuple[dict[str, Stream], Record, dict[str, str]]:
    """All streams, what is told of them, and why others are none."""
    frame = options.get("frame", "capture")
    analog_rate, pose_rate = (float(r) for r in found["rates"][1:])
    streams: dict[str, Stream] = {}
    told: Record = {"rate_hz": repr(rate), "analog_rate_hz": repr(analog_rate)}
    poses: Found = ({}, {})
    points = not is_output(found).all()
    if points or found["poses"].size:
        unit = str(found["unit"][0]) if len(found["unit"]) else ""
        factor, stated = metres(options, unit, path.name)
        told = {"unit": stated, **told}
        poses = poses_of(found, pose_rate, factor, frame)
    if points:
        streams[MARKERS], more = markers_of(found, rate, factor, spread(options), frame)
        told = {**told, **more}
    never: dict[str, str] = {}
    parts = (outputs_of(found, rate, frame), analog_of(found, analog_rate, frame), poses)
    for part, why in parts:
        streams |= part
        never |= why
    told = {"kind": "motion capture (C3D)", **told}
    told["first_frame"] = f"{int(found['first_frame'])} of the trial, time 0 here"
    # Events as the file states them; its times count as the trial's, which may begin earlier
    times = 60 * found["event_times"][0] + found["event_times"][1]
    names = distinct(found["events"].tolist(), len(times))
    if listed := "; ".join(f"{name} {t:.6g} s" for name, t in zip(names, times, strict=True)):
        told["events"] = f"{listed} (events of the trial, listed but not stored as a stream)"
    if (left := int(found["uncounted"])) > BLOCK:
        told[LEFT_OUT] = (
            f"{left} bytes after frame {MOST}: its header cannot count further, and no parameter "
            f"does"
        )
    return streams, told, never


def _require_whole(path: Path) -> None:
    """The header's own account of its length, before a library believes it."""
    first = head(path, BLOCK)
    if not path.is_file():
        raise RecordingError(
            f"{path}: no such file" if not path.exists() else f"{path}: not a file"
        )
    if len(first) < BLOCK or first[1] != _KEY:
        raise RecordingError(
            f"{path.name}: not a C3D file, or truncated in its first {BLOCK} bytes"
        )
    lies = layout(path, first)
    size = path.stat().st_size
    if lies.start < 2 or size < lies.needs:
        raise RecordingError(
            f"{path.name}: {size} bytes, but its header declares {lies.frames} frames of "
            f"{lies.points} points and {lies.analog} analog numbers: {lies.needs} bytes; "
            f"truncated or damaged"
        )
    # No parameter declares more values than the file has bytes left: ezc3d takes memory for
    # them before it reads, for seconds.
    raw = head(path, lies.at(0))
    begin = BLOCK * max(first[0] - 1, 1)
    size = path.stat().st_size
    for group, name, at in records(raw, begin):
        dimensions = raw[at + 4 : at + 4 + raw[at + 3]] if group > 0 else b""
        told = prod(d for d in dimensions if d)
        if told > size - at:
            word = name.decode("ascii", "replace")
            raise RecordingError(
                f"{path.name}: its parameter {word!r} declares {told:.3g} values, but {size - at} "
                "bytes are left: damaged"
            )


def _recognises(path: Path) -> bool:
    """The key is a P, too: text with one there (`Probe`, `"Procedure`) holds no zero byte, the
    header of a C3D does."""
    first = head(path, BLOCK)
    return first[1:2] == bytes([_KEY]) and first[0] > 0 and 0 in first


C3D = Reader(
    "c3d",
    "motion capture (C3D)",
    _recognises,
    read_c3d,
    "its second byte is 80 and its first block is not text",
    options=(UNIT, SD, frame("capture")),
    extensions=(".c3d",),
)
