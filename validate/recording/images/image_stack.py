"""Reader of camera and microscope images (PNG, JPEG, TIFF, BMP): a folder or a TIFF stack."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.formats.options import (
    LENS_FILE,
    M_PER_PX,
    RATE,
    TOPIC,
    WHITE,
    above_zero,
    frame,
    length,
)
from validate.recording.formats.streams import recorded
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import shallow
from validate.recording.images.lens import straightened
from validate.recording.images.numbered_files import OTHERS, pictures
from validate.recording.images.png_stack import by_size, offered
from validate.recording.reader import Options, Reader, head, source_of
from validate.recording.types import Frames, Recording, Source
from validate.units import in_si

_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_SECONDS = 60


def read_image_stack(path: Path, options: Options) -> Recording:
    """Frames (h, w) in grey, in the order of the numbers in the files' names or of the pages.

    Options: `m_per_px` and `rate` (Hz), where a TIFF of ImageJ or OME states none; `white`: the
    level that becomes 255 in images deeper than 8 bits (default: the stack's largest, which is
    told); `lens`: a file of the camera's calibration; `topic` and `frame`. Raises `UsageError`
    without scale or times, `RecordingError` for damage. Images of several sizes are streams of
    their own.
    """
    found = decoded("validate.recording.images.stack_arrays", path, None, _SECONDS)
    deep = [found[f"image.{i}"] for i in range(sum(k.startswith("image.") for k in found))]
    if not deep:
        raise RecordingError(f"{path.name}: no image in it")
    images, levels = shallow(deep, options)
    images, lens = straightened(images, options)
    sides, scale = _sides(path, found, options)
    t, times = _times(path, len(images), found, options)
    topic, frame = options.get("topic", "images"), options.get("frame", "image")
    streams = {
        name: Frames(t[at], tuple(images[i] for i in at), sides, np.eye(4), frame)
        for name, at in by_size(topic, images).items()
    }
    said = {
        "kind": "images", "images": str(len(images)), "m_per_px": scale, "times": times,
        "levels": levels,
        "colour": "converted to grey (ITU-R 601)" if bool(found["colour"]) else "grey, as recorded",
        **lens,
    }  # fmt: skip
    name = path.resolve().name if path.is_dir() else path.stem
    whole = "images keep no common checksum: integrity not provable"
    source = Source(name, "", 0, whole) if path.is_dir() else source_of(path, whole)
    return recorded(name, source, streams, said)


def _sides(
    path: Path, found: Mapping[str, Any], options: Options
) -> tuple[tuple[float, float], str]:
    if "m_per_px" in options:
        side = length(options, "m_per_px", "0.1mm")
        return (side, side), f"{options['m_per_px']} (entered)"
    unit = str(found["unit"]) if "unit" in found else ""
    factor = in_si(1.0, unit, "m") if unit else None
    if factor is None:
        raise UsageError(
            f"{path.name}: has no scale{f' (unit {unit})' if unit else ''}; give it, as "
            f"--m-per-px 0.1mm{offered(found['dots']) if 'dots' in found else ''}"
        )
    x, y = (factor * float(side) for side in found["side"])
    return (x, y), f"{found['side'][0]:.6g} {unit} per pixel (declared by {found['by']})"


def _times(
    path: Path, count: int, found: Mapping[str, Any], options: Options
) -> tuple[Floats, str]:
    if "rate" in options:
        rate = above_zero(options, "rate")
        return np.arange(count) / rate, f"{rate:g} Hz (entered)"
    interval = float(found["interval"]) if "interval" in found else 0.0
    if np.isfinite(interval) and interval > 0:
        return np.asarray(
            interval * np.arange(count)
        ), f"every {interval:g} s (declared by {found['by']})"
    if count == 1:
        return np.zeros(1), "one image"
    raise UsageError(
        f"{path.name}: {count} images without times; give --rate HZ (a volume is not read)"
    )


def _recognises(path: Path) -> bool:
    try:
        if path.is_dir():
            return bool(pictures(path, OTHERS))
    except OSError:
        return False
    return head(path, 4) in _TIFF


IMAGE_STACK = Reader(
    "image-stack",
    "images (JPEG, TIFF, BMP, PNG of any depth): a folder, or a TIFF's pages",
    _recognises,
    read_image_stack,
    "a folder that holds JPEG, TIFF or BMP files, or a TIFF's first bytes",
    options=(M_PER_PX, RATE, TOPIC, frame("image"), WHITE, LENS_FILE),
    extensions=(".jpg", ".tif", ".bmp", ".png"),
)
