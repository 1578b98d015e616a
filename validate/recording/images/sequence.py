"""Tracked sequences of the PLUS toolkit: images and 4 x 4 transforms of tools, frame by frame.

Every frame has fields `Seq_Frame0007_<Tool>To<Frame>Transform`, its `...Status`, `Timestamp` (s)
and `ImageStatus`. Only what is OK enters the recording: a tool that was not seen has no sample.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.formats.streams import begun
from validate.recording.formats.streams import recorded as of_streams
from validate.recording.images.image import shallow
from validate.recording.motion_capture.poses import pose_signals
from validate.recording.reader import (
    M_PER_PX,
    RATE,
    WHITE,
    MapOption,
    Options,
    above_zero,
    length,
    source_of,
)
from validate.recording.types import Frames, Recording, Stream

IMAGES = "images"
MAX_PIXELS = 400 * 2**20  # bytes of all images of one sequence
_MM = 1e-3  # m: PLUS writes millimetres
_FIELD = re.compile(r"Seq_Frame(\d{1,9})_(\w+)")
_TOOL = re.compile(r"(\w+To\w+)Transform")
OPTIONS = (M_PER_PX, RATE, MapOption("images", "no: read the poses alone", default="yes"), WHITE)


@dataclass(frozen=True)
class Sequence:
    """What a file holds: texts by frame and field, images n x (h, w) of 8 or 16 bits or none,
    `spacing` (2,) as the file states it, `kind` in words; how the image lies to the transducer,
    `orientation`, and `times` (n,) s of a file that has them apart, where it says so; what of its
    header makes the third axis one of space, `deep`: empty where nothing does."""

    fields: Mapping[int, Mapping[str, str]]
    images: tuple[NDArray[Any], ...]
    spacing: tuple[float, float]
    kind: str
    orientation: str = ""
    times: Floats | None = None
    deep: str = ""


def by_frame(pairs: Iterable[tuple[str, str]]) -> dict[int, dict[str, str]]:
    """Return the fields of every frame by their own names, from keys and texts of a header."""
    found: dict[int, dict[str, str]] = {}
    for key, text in pairs:
        named = _FIELD.fullmatch(key)
        if named:
            found.setdefault(int(named[1]), {})[named[2]] = text.strip()
    return found


def recorded(path: Path, held: Sequence, options: Options) -> Recording:
    """Return the sequence as a recording: of a transform XToY two signals, `XToY/rotation` (nt, 9),
    the linear part row by row, and `XToY/translation` (nt, 3) m; images as `images`.

    Options: `m_per_px`, which a spacing of 1 (pixels, not mm) needs; `images=no` leaves them out;
    `rate` (Hz) for frames without times; `white` as `shallow` has it. Raises `UsageError` where
    one of them is needed, `RecordingError` for a field that is none, and a file in which nothing
    was seen.
    """
    # Refuse slices of a volume; images with fields of their own, or times, are a film.
    count = len(held.images)
    if held.deep and count > 1 and not held.fields and held.times is None:
        raise RecordingError(
            f"{path.name}: {count} slices of a volume ({held.deep}), not images over time; save "
            f"an image sequence with an axis of kind list, or as TIFF or MP4"
        )
    t = _times(path, held, options)
    streams: dict[str, Stream] = {}
    never = []
    keys = {key for fields in held.fields.values() for key in fields}
    for tool in sorted(m[1] for key in keys if (m := _TOOL.fullmatch(key))):
        # Both signals of a transform where its status is OK, or says nothing.
        key = f"{tool}Transform"
        texts = {
            i: fields[key]
            for i, fields in sorted(held.fields.items())
            if key in fields and fields.get(f"{key}Status", "OK") == "OK"
        }
        if not texts:
            never.append(tool)
            continue
        T = np.array([_numbers(path, text, 16, i) for i, text in texts.items()]).reshape(-1, 4, 4)
        wrong = np.abs(T[:, 3] - [0, 0, 0, 1]).max(axis=1) > 1e-6
        if wrong.any():
            i = list(texts)[int(wrong.argmax())]
            raise RecordingError(f"{path.name}: frame {i}: the last row of {key} is not 0 0 0 1")
        R, x = T[:, :3, :3], _MM * T[:, :3, 3]
        streams |= pose_signals(tool, t[list(texts)], R, x, tool.rpartition("To")[2])
    levels: dict[str, str] = {}
    if held.images and options.get("images") != "no":
        shown, levels = _images(path, held, t, options)
        streams |= shown
    if not streams:
        raise RecordingError(
            f"{path.name}: {len(t)} frames, no image and no transform in them is OK; never "
            f"visible: {', '.join(never) or 'none'}"
        )
    streams = begun(streams)
    told = {
        "kind": held.kind,
        "frames": str(len(t)),
        "not_seen": "; ".join(
            f"{n}: {len(t) - len(s.t)}" for n, s in streams.items() if len(s.t) < len(t)
        ),
        **levels,
    }
    source = source_of(path, f"{held.kind} keeps no checksum: integrity not provable")
    unread = dict.fromkeys(never, "never seen")
    return of_streams(path.name.partition(".")[0], source, streams, told, unread)


def _times(path: Path, held: Sequence, options: Options) -> Floats:
    """Seconds (n,) of every frame from the first."""
    count = max(len(held.images), max(held.fields, default=-1) + 1)
    stamped = [i for i in range(count) if "Timestamp" in held.fields.get(i, {})]
    if not count:
        raise RecordingError(f"{path.name}: no frame, neither an image nor fields Seq_Frame0000_*")
    if not stamped and "rate" not in options and held.times is not None:
        return np.asarray(held.times - held.times[0])
    if count == 1 and not stamped:
        return np.zeros(1)
    if not stamped or "rate" in options:
        if "rate" not in options:
            raise UsageError(
                f"{path.name}: its frames have no times; give --map rate=HZ (a volume is not read)"
            )
        return np.asarray(np.rint(1e9 * np.arange(count) / above_zero(options, "rate")) / 1e9)
    if len(stamped) < count:
        first = next(i for i in range(count) if i not in set(stamped))
        raise RecordingError(
            f"{path.name}: {count - len(stamped)} of {count} frames without a time, the first is "
            f"{first}; the file is truncated, or give --map rate=HZ"
        )
    t = np.array([_numbers(path, held.fields[i]["Timestamp"], 1, i)[0] for i in range(count)])
    return np.asarray(np.rint(1e9 * (t - t[0])) / 1e9)


def _numbers(path: Path, text: str, count: int, frame: int) -> Floats:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise RecordingError(
            f"{path.name}: frame {frame}: '{text[:60]}' is not {count} finite numbers; damaged"
        )
    return values


def _images(
    path: Path, held: Sequence, t: Floats, options: Options
) -> tuple[dict[str, Frames], dict[str, str]]:
    """Images whose status is OK, or says nothing, as PLUS has them beside its transforms: columns
    go to the marked side of the transducer, rows away from it. And what was turned, and how they
    became 8 bits deep.

    Raises `RecordingError` for lines along rows, as of radio-frequency data.
    """
    way, told = held.orientation.upper(), {}
    across = along = 1
    if way[:2] in ("MF", "MN", "UF", "UN"):
        across, along = (-1 if way[0] == "U" else 1), (-1 if way[1] == "N" else 1)
    elif way[:1] in ("F", "N") and way[1:2] in ("M", "U"):
        raise RecordingError(
            f"{path.name}: its scan lines are rows (orientation {way}); save it as MF, or "
            f"give --map images=no"
        )
    sides = " and ".join((["columns"] if across < 0 else []) + (["rows"] if along < 0 else []))
    if sides:
        words = f"{sides} reversed: the file stores them as {way}, but its transforms need MF"
        told[IMAGES] = words
    fields = [held.fields.get(i, {}) for i in range(len(held.images))]
    said = [f.get("ImageStatus", f.get("Status", "OK")) for f in fields]
    good = [i for i, status in enumerate(said) if status == "OK"]
    if not good:
        return {}, {**told, "levels": "none"}
    images, levels = shallow([held.images[i][::along, ::across] for i in good], options)
    # Sides of a pixel, m.
    if "m_per_px" in options:
        side = length(options, "m_per_px", "0.1mm")
        pixel = side, side
    else:
        if held.spacing == (1.0, 1.0):
            raise UsageError(
                f"{path.name}: has a spacing of 1 1, which means pixels, not mm; give --map "
                f"m_per_px=0.1mm, or --map images=no for the transforms only"
            )
        pixel = _MM * held.spacing[0], _MM * held.spacing[1]
    frames = Frames(t[good], images, pixel, np.eye(4), "image")
    return {IMAGES: frames}, {**told, "levels": levels}
