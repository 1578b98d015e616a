"""Reader of a folder of PNG images, in the order of the numbers in their names."""

import re
import struct
from itertools import pairwise
from pathlib import Path

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RecordingError, UsageError
from validate.files import ANY_SIZE, member, members, open_file, read_bytes
from validate.recording.images.image import Pixels, decode_png, straightened
from validate.recording.reader import (
    LENS_FILE,
    M_PER_PX,
    RATE,
    TOPIC,
    Options,
    Reader,
    above_zero,
    asked,
    head,
)
from validate.recording.scales import odd_pixel
from validate.recording.types import Frames, Recording, Source, clock_of
from validate.units import in_si, split

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm")
OTHERS = tuple(s for s in SUFFIXES if s != ".png")


def pictures(folder: Path, kinds: tuple[str, ...] = (".png",)) -> list[Path]:
    """Files of these endings; hidden ones, as macOS leaves on foreign disks, are none."""
    return [f for f in members(folder) if f.suffix.lower() in kinds]


def number_key(stem: str) -> tuple[int, ...]:
    """Numbers in a name, by which files are in order."""
    return tuple(int(n) for n in re.findall(r"\d+", stem)[:8])


def numbered(folder: Path, kinds: tuple[str, ...] = (".png",)) -> list[Path]:
    """Its files of these kinds in the order of the numbers in their names.

    Raises `RecordingError` for a folder without any, for numbers that are alike, and for a pipe, a
    device or a link out of the folder.
    """
    files = pictures(folder, kinds)
    if not files:
        raise RecordingError(f"{folder}: no {' or '.join(f'*{kind}' for kind in kinds)} files")
    keys = {f: number_key(f.stem) for f in files}
    files.sort(key=lambda f: (keys[f], f.name))
    for a, b in pairwise(files):
        if keys[a] == keys[b]:
            raise RecordingError(
                f"{folder.name}: '{a.name}' and '{b.name}' have the same number; "
                "number the files in order of time"
            )
    for file in files:
        open_file(member(file), ANY_SIZE).close()
    return files


MAX_STACK = 400 * 2**20  # bytes of all images of one stack
MAX_FILE = 64 * 2**20  # bytes of one PNG
_PRINTERS = (
    1,
    72,
    75,
    90,
    96,
    100,
    120,
    144,
    150,
    200,
    240,
    300,
    360,
    400,
    600,
    1200,
)  # dots an inch


def read_png_stack(folder: Path, options: Options) -> Recording:
    """All *.png of a folder as one stream of frames, in the order of the numbers in their names.

    Options are `m_per_px` (m, or with its unit), `rate` (Hz), `topic` (default images) and `lens`,
    a file of the camera's calibration. Frames are in the image's own metres, x right, y down.
    Raises `UsageError` without size or rate, for a pixel beyond reason and for what is no folder,
    `RecordingError`: no files, equal numbers, damaged images, over `MAX_STACK`. Images of several
    sizes are streams of their own.
    """
    if not {"m_per_px", "rate"} <= options.keys():
        said = ""
        if folder.is_dir() and "m_per_px" not in options:
            # Dots an inch of the first image (PNG specification, pHYs), where it states them.
            first = head(numbered(folder)[0])
            at = first.find(b"pHYs")
            dots = np.empty(0)
            if 0 <= at <= len(first) - 13 and first[at + 12] == 1:
                dots = np.array(struct.unpack(">II", first[at + 4 : at + 12])) * 0.0254
            said = offered(dots)
        raise UsageError(f"png-stack needs --m-per-px and --rate, e.g. 1e-4 and 10{said}")
    if not folder.is_dir():
        raise UsageError(f"{folder} is not a folder of PNG images")
    # Side of a pixel, m.
    text = options["m_per_px"]
    number, unit = split(text) or (0.0, "")
    side = in_si(number, unit or "m", "m")
    if side is None or side <= 0:
        raise UsageError(f"m_per_px={text}: expected a length above 0, as 1e-4 (m) or 0.1mm")
    rate = above_zero(options, "rate")
    pixels: list[Pixels] = []
    for file in numbered(folder):
        try:
            pixels.append(decode_png(read_bytes(file, MAX_FILE)))
        except RecordingError as error:
            raise RecordingError(f"{file.name}: {error}; --as image-stack reads others") from None
        if sum(image.size for image in pixels) > MAX_STACK:
            raise RecordingError(f"{folder.name}: more than {MAX_STACK} bytes; split the stack")
    images, lens = straightened(tuple(pixels), options)
    # A bare number beyond reason is asked back; one with its unit is meant.
    text = options["m_per_px"]
    height, width = images[0].shape
    bare = (split(text) or (0.0, ""))[1] == ""
    if bare and (odd := odd_pixel((side, side), (height, width))):
        raise UsageError(f"m_per_px={text}: {odd} With its unit it is taken")
    t = np.arange(len(images)) / rate
    ns = np.rint(1e9 * t).astype(np.int64)
    topic, name = options.get("topic", "images"), folder.resolve().name
    streams = by_size(topic, images)
    made = {"kind": "folder of PNG images", "images": str(len(images)), "rate_hz": repr(rate),
            **lens}  # fmt: skip
    return Recording(
        name=name,
        source=Source(name, "", 0, "folder of images: integrity not provable"),
        t0_ns=0,
        frames={
            name: Frames(t[at], tuple(images[i] for i in at), (side, side), np.eye(4), "image")
            for name, at in streams.items()
        },
        clock={name: clock_of(name, None, ns[at], ns[at]) for name, at in streams.items()},
        metadata={"provenance": made},
    )


def offered(dots: Floats) -> str:
    """What dots (x, y) an inch would mean as a scale, for the user to confirm: programs write them
    for printers and screens too; empty where they are none or not the same both ways."""
    if len(dots) != 2 or not (np.isfinite(dots).all() and dots[0] > 0 and dots[0] == dots[1]):
        return ""
    stated = f"; the file declares {dots[0]:.6g} dots an inch"
    if np.isclose(dots[0], _PRINTERS, atol=0.05).any():
        return f"{stated}, as for printers and screens: not a scale"
    return f"{stated}: if the instrument wrote them, give --m-per-px {25.4 / dots[0]:.6g}mm"


def by_size(topic: str, images: tuple[Pixels, ...]) -> dict[str, Ints]:
    """Numbers of the images by stream: those of several sizes are streams of their own."""
    sizes = [f"{image.shape[1]}x{image.shape[0]}" for image in images]
    if len(set(sizes)) == 1:
        return {topic: np.arange(len(images))}
    return {f"{topic}_{s}": np.flatnonzero(np.array(sizes) == s) for s in dict.fromkeys(sizes)}


def _recognises(path: Path) -> bool:
    try:
        return path.is_dir() and bool(pictures(path)) and not pictures(path, OTHERS)
    except (OSError, RecordingError):  # a name too long; a folder of too many entries
        return False


PNG_STACK = Reader(
    "png-stack",
    "a folder of PNG images",
    _recognises,
    read_png_stack,
    "a folder that holds PNG files and no other images",
    options=(asked(M_PER_PX), asked(RATE), TOPIC, LENS_FILE),
    extensions=(".png",),
)
