"""Reader of videos (MP4, MOV, AVI, Matroska): grey images on the container's time stamps.

A container states no size of a pixel; a camera that is not calibrated (`lens`) has none that
holds over the whole image. Its end is checked by its own account of lengths.
"""

import os
import struct
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.files import ANY_SIZE, open_file
from validate.recording.formats.streams import recorded
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import straightened
from validate.recording.reader import (
    LENS_FILE,
    M_PER_PX,
    RATE,
    TOPIC,
    MapOption,
    Options,
    Reader,
    above_zero,
    asked,
    frame,
    head,
    length,
    source_of,
)
from validate.recording.types import Frames, Recording

LIBRARIES = ("cv2",)
MOST = 400 * 2**20  # bytes of all frames together


def arrays(path: Path, every: float = 1) -> dict[str, NDArray[Any]]:
    """`images` (nt, h, w) uint8 of every so many frames, `t` (nt,) s as the container stamps them,
    `rate` Hz as it declares it, `declared` and `decoded` counts of frames, whether any is `colour`.

    Raises `RecordingError` for a file without frames, for frames beyond `MOST` bytes, and for
    pixels that are not square.
    """
    import cv2

    declared = (cv2.CAP_PROP_FRAME_COUNT, cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
    # One thread: each takes address space, and a machine has many cores. A name of ours: FFmpeg
    # takes one with % for a row of pictures.
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "protocol_whitelist;file"
    with TemporaryDirectory(prefix="validate-") as folder:
        link = Path(folder) / "video"
        link.symlink_to(path.resolve())
        video = cv2.VideoCapture(str(link), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    wide = video.get(cv2.CAP_PROP_SAR_NUM)
    high = video.get(cv2.CAP_PROP_SAR_DEN)
    if wide > 0 and high > 0 and wide != high:
        raise RecordingError(
            f"its pixels are {wide:g}:{high:g}, not square; convert them first, as with `ffmpeg "
            f"-i IN -vf scale=iw*sar:ih,setsar=1 OUT.mp4`"
        )
    count, width, height = (video.get(key) for key in declared)
    _require_few(count, width, height, every)
    images, t, made, colour = [], [], 0, False
    while video.isOpened():
        done, frame = video.read()
        if not done:
            break
        stamp = video.get(cv2.CAP_PROP_POS_MSEC)  # of the frame just read
        if made % int(every) == 0:
            shade = np.ptp(frame[::8, ::8].astype(np.int16), axis=2) if frame.ndim == 3 else [0]
            colour = colour or float(np.max(shade)) > _GREY
            images.append(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame)
            t.append(1e-3 * stamp)
        made += 1
        if sum(image.size for image in images[:1]) * len(images) > MOST:
            raise RecordingError(
                f"frames of {images[0].shape[1]} x {images[0].shape[0]} beyond {MOST} bytes after "
                f"{made}; read fewer with --map every=10, or shorten the video"
            )
    if not images:
        raise RecordingError("no frame can be decoded: truncated, damaged, or not a video")
    return {
        "images": np.stack(images),
        "t": np.array(t),
        "rate": np.array(video.get(cv2.CAP_PROP_FPS)),
        "declared": np.array(video.get(cv2.CAP_PROP_FRAME_COUNT)),
        "decoded": np.array(made),
        "colour": np.array(colour),
    }


def _require_few(count: float, width: float, height: float, every: float) -> None:
    """What is declared, before anything is decoded: packed, it may be small."""
    if width * height * (count // every) > MOST:
        raise RecordingError(
            f"it declares {count:.0f} frames of {width:.0f} x {height:.0f}, beyond {MOST} bytes; "
            "take fewer: --map every=10, or cut it"
        )


_GREY = 24  # levels between channels that a codec makes of grey


_BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")  # an MP4 or MOV begins with one
_EBML, _SEGMENT = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67"  # Matroska and WebM (RFC 9559)
_STILLS = (b"heic", b"heix", b"mif1", b"avif")  # photographs in the same container
_LARGEST = 2**30
EVERY = MapOption("every", "one frame of this many is taken", "1", "1")
_EVEN = 2.0  # ms by which even frames differ: containers count in coarse ticks


def read_video(path: Path, options: Options) -> Recording:
    """Frames (h, w) in grey. Options: `m_per_px` (needed), `rate` (Hz, in place of the container's
    times), `every` (10: one frame in ten), `topic` (default images), `frame`, `lens`: a file of the
    camera's calibration, by which they are straightened.

    Raises `UsageError` without a scale, and for times that the container does not tell;
    `RecordingError` for a file that is cut, damaged, or shorter than it declares, or whose pixels
    are not square.
    """
    # Raises `RecordingError` for a file that ends before its own account of lengths.
    if not path.is_file():
        raise RecordingError(f"{path.name}: not a file")
    size, first = path.stat().st_size, head(path, 12)
    if _matroska(path):
        # Where the segment ends by its own account; a live stream tells none.
        lead = head(path)
        end, begin = _sized(lead, 4)
        at = begin + (end or 0)
        if lead[at : at + 4] != _SEGMENT:
            raise RecordingError(
                f"{path.name}: a Matroska header without its segment: truncated or damaged"
            )
        extent, begin = _sized(lead, at + 4)
        at = size if extent is None else begin + extent
    else:
        at = (
            (8 + int(struct.unpack("<I", first[4:8])[0]) if len(first) >= 8 else 8)
            if first.startswith(b"RIFF")
            else _last_box(path, size)
        )
    if at > size:
        raise RecordingError(f"{path.name}: {size} bytes, its parts need {at}: truncated")
    if "m_per_px" not in options:
        raise UsageError(f"{path.name}: a video has no scale; give it, as --m-per-px 0.1mm")
    every = above_zero({"every": "1", **options}, "every")
    if every != int(every):
        raise UsageError(f"--map every={options['every']}: expected a whole number")
    side, every = length(options, "m_per_px", "0.1mm"), int(every)
    found = decoded("validate.recording.images.video", path, {"every": every}, _SECONDS)
    declared, count = int(found["declared"]), int(found["decoded"])
    if count < declared and not _matroska(path):  # which declares a duration, no count
        raise RecordingError(
            f"{path.name}: {count} frames can be decoded, {declared} are declared: damaged"
        )
    t, told = _times(path, found["t"], float(found["rate"]), every, options)
    images, lens = straightened([np.ascontiguousarray(i) for i in found["images"]], options)
    topic, frame = options.get("topic", "images"), options.get("frame", "image")
    streams = {topic: Frames(t, images, (side, side), np.eye(4), frame)}
    said = {
        "kind": "video",
        "frames": f"{len(images)} of {count}" + (f", one in {every}" if every > 1 else ""),
        "times": told,
        "colour": "converted to grey (ITU-R 601)" if bool(found["colour"]) else "grey, as recorded",
        "m_per_px": f"{options['m_per_px']} (entered)",
        **lens,
    }
    source = source_of(path, "a video keeps no checksum: integrity not provable")
    return recorded(path.stem, source, streams, said)


def _times(path: Path, t: Floats, rate: float, every: int, options: Options) -> tuple[Floats, str]:
    """Times from the first frame, s, and where they are from."""
    if "rate" in options:
        hz = above_zero(options, "rate")
        return every * np.arange(len(t)) / hz, f"{options['rate']} Hz (entered)"
    if len(t) > 1 and not (np.diff(t) > 0).all():
        if not (np.isfinite(rate) and rate > 0):
            raise UsageError(f"{path.name}: {len(t)} frames without times; give --rate HZ")
        return every * np.arange(len(t)) / rate, f"{rate:.6g} Hz as declared; frames have no times"
    steps = 1e3 * np.diff(t)
    words = "from the container, evenly spaced"
    if len(steps) and np.ptp(steps) > _EVEN:
        words = f"from the container, uneven: steps of {steps.min():.3g} to {steps.max():.3g} ms"
    return np.asarray(np.rint(1e9 * (t - t[0])) / 1e9), words


def _matroska(path: Path) -> bool:
    return head(path, 4) == _EBML


def _sized(data: bytes, at: int) -> tuple[int | None, int]:
    """A size of EBML (RFC 8794, section 4; None: unknown), and where what it counts begins."""
    lead = data[at] if at < len(data) else 0
    more = 8 - lead.bit_length()
    bits = 7 * (more + 1)
    value = int.from_bytes(data[at : at + more + 1], "big") & ((1 << bits) - 1)
    return (None if value == (1 << bits) - 1 else value), at + more + 1


def _last_box(path: Path, size: int) -> int:
    """Where the last of an MP4's boxes ends; raises `RecordingError` for what is no box."""
    at = 0
    with open_file(path, ANY_SIZE) as file:
        while at < size:
            file.seek(at)
            tag = file.read(16)
            if len(tag) < 8:
                return at + 8
            count = struct.unpack(">I", tag[:4])[0]
            if count == 1 and len(tag) == 16:
                count = struct.unpack(">Q", tag[8:])[0]
            if count == 0:  # to the end of the file
                return size
            if count < 8:
                raise RecordingError(f"{path.name}: a part of {count} bytes at {at}: damaged")
            at += count
    return at


def _recognises(path: Path) -> bool:
    first = head(path, 12)
    moving = first[4:8] in _BOXES and first[8:] not in _STILLS
    return moving or first[:4] == _EBML or (first[:4] == b"RIFF" and first[8:12] == b"AVI ")


_SECONDS = 60  # of decoding, and one more for each MB
VIDEO = Reader(
    "video",
    "a video (MP4, MOV, AVI, Matroska)",
    _recognises,
    read_video,
    "its first bytes are those of MP4, MOV, AVI or Matroska",
    _LARGEST,
    options=(asked(M_PER_PX), RATE, EVERY, TOPIC, frame("image"), LENS_FILE),
    extensions=(".mp4", ".mov", ".avi", ".mkv", ".webm"),
)
