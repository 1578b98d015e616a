"""Reader of camera and microscope images (PNG, JPEG, TIFF, BMP): a folder or a TIFF stack."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError, UsageError
from validate.recording.formats.streams import recorded
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import shallow, straightened
from validate.recording.images.png_stack import (
    OTHERS,
    SUFFIXES,
    by_size,
    numbered,
    offered,
    pictures,
)
from validate.recording.reader import (
    LENS_FILE,
    M_PER_PX,
    RATE,
    TOPIC,
    WHITE,
    Options,
    Reader,
    above_zero,
    frame,
    head,
    length,
    source_of,
)
from validate.recording.types import Frames, Recording, Source
from validate.units import in_si

LIBRARIES = ("PIL.Image",)
MOST = 400 * 2**20  # bytes of all images of one stack, in their own depth
_BIG = b"MM\0\x2b"
_DESCRIPTION = 270  # TIFF's tag of a text, in which ImageJ states scale and times
_X_RESOLUTION, _Y_RESOLUTION = 282, 283
_OME = re.compile(r"<(?:\w+:)?Pixels\s[^>]*SizeT=[^>]*>")  # no parser of XML: nothing unfolds
_ATTRIBUTE = re.compile(r"""(\w+)\s*=\s*["']([^"']*)["']""")
_DECODE_SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
_GREY = ("1", "L", "LA", "I;16", "I;16B", "I;16L", "I", "F")


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """`image.0` (h, w), `image.1`, ... in their own depth, uint8, uint16 or float64; whether any
    was in `colour`; of ImageJ's TIFF and OME's `side` (2,) in its `unit` and `interval` s, stated
    `by` whom; of others `dots` (2,) an inch, where stated.

    Raises `RecordingError` for images beyond `MOST` bytes, and what Pillow finds damaged.
    """
    import warnings

    from PIL import Image

    warnings.simplefilter("error", Image.DecompressionBombWarning)
    files = numbered(path, SUFFIXES) if path.is_dir() else [path]
    found: dict[str, NDArray[Any]] = {}
    colour, taken = False, 0
    for file in files:
        for pixels, coloured in _pages(file):
            taken += pixels.nbytes
            if taken > MOST:
                raise RecordingError(f"more than {MOST} bytes of images; split the stack")
            found[f"image.{len(found)}"] = pixels
            colour = colour or coloured
    return {**found, "colour": np.array(colour), **_stated(files[0])}


def _pages(file: Path) -> Iterator[tuple[NDArray[Any], bool]]:
    """Every page in grey, and whether it was in colour."""
    from PIL import Image, ImageSequence

    if head(file, len(_BIG)) == _BIG:
        raise RecordingError(
            f"{file.name}: a BigTIFF whose numbers are big-endian, which Pillow does not read; "
            "write it little-endian, as with tiffcp -L x.tif y.tif"
        )
    try:
        with Image.open(file) as opened:
            # What the pages declare, before any is decoded: packed, they may be small.
            pages, (width, height) = getattr(opened, "n_frames", 1), opened.size
            if pages * width * height > MOST:
                raise RecordingError(
                    f"{pages} images of {width} x {height} px, more than {MOST} bytes; split the "
                    "stack"
                )
            for page in ImageSequence.Iterator(opened):
                coloured = page.mode not in _GREY
                plain = page.convert("L") if coloured or page.mode in ("1", "LA") else page
                pixels = np.asarray(plain)
                depth: Any = np.uint8
                if pixels.dtype != np.uint8:
                    whole = pixels.dtype.kind in "iu" and 0 <= pixels.min() <= pixels.max() < 2**16
                    depth = np.uint16 if whole else np.float64
                if coloured:  # which a page of a mode for colour may lack
                    colours = np.asarray(page.convert("RGB"))[::4, ::4].astype(np.int16)
                    coloured = bool(np.ptp(colours, axis=2).max(initial=0) > 0)
                yield pixels.astype(depth), coloured
    except RecordingError:
        raise
    except Exception as error:  # whatever a codec raises on damage
        why = " ".join(str(error).split())[:150] or type(error).__name__
        raise RecordingError(f"{file.name}: damaged ({why})") from None


def _stated(file: Path) -> dict[str, NDArray[Any]]:
    """Scale and interval of ImageJ or OME; `dots` (2,) an inch of others, which may be a
    printer's."""
    from PIL import Image

    with Image.open(file) as opened:
        tags: Any = getattr(opened, "tag_v2", {})
        text = str(tags.get(_DESCRIPTION, ""))
        if pixels := _OME.search(text):
            # Scale and interval of OME-XML's Pixels, whose units are um and s where it says none.
            said = dict(_ATTRIBUTE.findall(pixels[0]))
            pages = getattr(opened, "n_frames", 1)
            times, channels, planes = (int(_amount(said.get(f"Size{c}", "1"))) for c in "TCZ")
            _require_times(pages, times, channels, planes, "OME")
            found: dict[str, NDArray[Any]] = {"by": np.array("OME")}
            sides = [_amount(said.get(f"PhysicalSize{c}", "")) for c in "XY"]
            units = {_plain(said.get(f"PhysicalSize{c}Unit", "um")) for c in "XY"}
            if min(sides) > 0 and len(units) == 1:
                found |= {"side": np.array(sides), "unit": np.array(units.pop())}
            factor = _DECODE_SECONDS.get(said.get("TimeIncrementUnit", "s"))
            if factor and "TimeIncrement" in said:
                found["interval"] = np.array(factor * _amount(said["TimeIncrement"]))
            return found
        if not text.startswith("ImageJ"):
            dots = opened.info.get("dpi")
            return {"dots": np.array(dots, dtype=np.float64)} if dots else {}
        lines = dict(re.findall(r"(?m)^(\w+)=(.*)$", text))
        sides = [1 / float(tags[k]) for k in (_X_RESOLUTION, _Y_RESOLUTION) if tags.get(k)]
        if "finterval" not in lines and "fps" not in lines:
            times, planes = (int(_amount(lines.get(key, "1"))) for key in ("frames", "slices"))
            _require_times(getattr(opened, "n_frames", 1), times, 1, planes, "ImageJ")
    found = {"by": np.array("ImageJ")}
    if len(sides) == 2 and lines.get("unit", "pixel") not in ("pixel", "inch"):
        found |= {"side": np.array(sides), "unit": np.array(lines["unit"].replace("\\u00B5", "u"))}
    if "finterval" in lines:
        found["interval"] = np.array(float(lines["finterval"]))
    return found


def _require_times(pages: int, times: int, channels: int, planes: int, by: str) -> None:
    """Refuse pages that are no times alone: channels of an instant, or planes of a volume."""
    if times == 1 and planes > 1:
        raise RecordingError(
            f"{pages} pages are {planes} planes of a volume ({by}), not images over time; if they "
            f"are a film, declare them as frames, as with ImageJ's Image > Properties"
        )
    if (times > 1 and pages > times) or (channels > 1 and pages > times * planes):
        raise RecordingError(
            f"{pages} pages are {times} times of {channels} channels and {planes} planes ({by}); "
            f"keep one channel and one plane, as with ImageJ's Image > Duplicate"
        )


def _amount(text: str) -> float:
    """A number above 0; 0 for anything else, as in a damaged file."""
    try:
        value = float(text)
    except ValueError:
        return 0.0
    return value if 0 < value < np.inf else 0.0


def _plain(unit: str) -> str:
    """A unit of length, its micro in whichever bytes it was written, as `um`."""
    return "um" if (unit.endswith("m") and not unit.isascii()) or unit == "&#181;m" else unit


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
    found = decoded("validate.recording.images.image_stack", path, None, _SECONDS)
    deep = [found[f"image.{i}"] for i in range(sum(k.startswith("image.") for k in found))]
    if not deep:
        raise RecordingError(f"{path.name}: no image in it")
    images, levels = shallow(deep, options)
    images, lens = straightened(images, options)
    if "m_per_px" in options:
        side = length(options, "m_per_px", "0.1mm")
        sides, scale = (side, side), f"{options['m_per_px']} (entered)"
    else:
        unit = str(found["unit"]) if "unit" in found else ""
        factor = in_si(1.0, unit, "m") if unit else None
        if factor is None:
            raise UsageError(
                f"{path.name}: has no scale{f' (unit {unit})' if unit else ''}; give it, as "
                f"--m-per-px 0.1mm{offered(found['dots']) if 'dots' in found else ''}"
            )
        x, y = (factor * float(side) for side in found["side"])
        sides = x, y
        scale = f"{found['side'][0]:.6g} {unit} per pixel (declared by {found['by']})"
    count, interval = len(images), float(found["interval"]) if "interval" in found else 0.0
    if "rate" in options:
        rate = above_zero(options, "rate")
        t, times = np.arange(count) / rate, f"{rate:g} Hz (entered)"
    elif np.isfinite(interval) and interval > 0:
        times = f"every {interval:g} s (declared by {found['by']})"
        t = np.asarray(interval * np.arange(count))
    elif count == 1:
        t, times = np.zeros(1), "one image"
    else:
        raise UsageError(
            f"{path.name}: {count} images without times; give --rate HZ (a volume is not read)"
        )
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
