"""C3D, the file of motion capture: labelled points, analog channels, residuals.

The file's own words are taken: labels, unit, rate. A residual is the mean distance of the rays that
meet in a point, not a standard deviation: it is told, never used as one.
"""

from math import prod
from pathlib import Path

import numpy as np

from validate.errors import RecordingError
from validate.recording.formats.apart import decoded
from validate.recording.formats.c3d_bytes import BLOCK, MOST, layout, records
from validate.recording.formats.c3d_streams import (
    Found,
    Held,
    analog_of,
    is_output,
    markers_of,
    outputs_of,
    poses_of,
)
from validate.recording.formats.options import metres, spread
from validate.recording.formats.recorded import distinct, recorded
from validate.recording.formats.text_rows import LEFT_OUT
from validate.recording.reader import Options, Reader, head, require_known, source_of
from validate.recording.types import Record, Recording, Stream

MARKERS = "markers"
_KEY = 80  # the second byte of every C3D file
_OPTIONS = ("unit", "sd", "frame")


def read_c3d(path: Path, options: Options) -> Recording:
    """Points as `markers`, computed outputs among them as `model/<label>`, each analog channel as
    `analog/<label>` in the unit that it states, poses as `<body>/rotation` and `/translation`.

    Options: `unit` of length where the file states none, `sd` of a coordinate (as 0.3mm; 0: not
    stated), `frame` (default capture). A point that was not seen is NaN. Raises `UsageError`
    without a unit of length, `RecordingError` for a file that is cut, damaged or no C3D.
    """
    require_known(options, _OPTIONS)
    _require_whole(path)
    found = decoded("c3d_arrays", path)
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
    return streams, {"kind": "motion capture (C3D)", **told, **_trial(found)}, never


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
    _require_parameters(path, head(path, lies.at(0)), BLOCK * max(first[0] - 1, 1))


def _require_parameters(path: Path, raw: bytes, begin: int) -> None:
    """No parameter declares more values than the file has bytes left: ezc3d takes memory for them
    before it reads, for seconds."""
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


def _trial(found: Held) -> Record:
    """Its first frame and events, and what of a long one no parameter counts."""
    left = int(found["uncounted"])
    told = {
        "first_frame": f"{int(found['first_frame'])} of the trial, time 0 here",
        **_events(found),
    }
    if left > BLOCK:
        told[LEFT_OUT] = (
            f"{left} bytes after frame {MOST}: its header cannot count further, and no parameter "
            f"does"
        )
    return told


def _events(found: Held) -> dict[str, str]:
    """Events as the file states them; its times count as the trial's, which may begin earlier."""
    times = 60 * found["event_times"][0] + found["event_times"][1]
    names = distinct(found["events"].tolist(), len(times))
    told = "; ".join(f"{name} {t:.6g} s" for name, t in zip(names, times, strict=True))
    return (
        {"events": f"{told} (events of the trial, listed but not stored as a stream)"}
        if told
        else {}
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
)
