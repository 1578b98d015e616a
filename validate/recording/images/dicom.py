"""Reader of DICOM images, mainly ultrasound: one stream per calibrated region."""

from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.files import member, members
from validate.recording.formats.streams import recorded
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import shallow
from validate.recording.reader import (
    M_PER_PX,
    RATE,
    WHITE,
    Options,
    Reader,
    above_zero,
    frame,
    head,
    length,
    source_of,
)
from validate.recording.types import Frames, Recording, Source, Stream

# --- Which files are DICOM: known by what stands at byte 128.

MAGIC, AT = b"DICM", 128
_MOST = 20_000  # files of one folder


def is_dicom(path: Path) -> bool:
    """Return whether the file begins as one."""
    return head(path, AT + 4)[AT:] == MAGIC


def begins_as_dicom(path: Path) -> bool:
    """Return whether a file is one, or a folder's first file by name; raises nothing."""
    try:
        if not path.is_dir():
            return is_dicom(path)
        first = min((f for f in members(path) if _may_be(f)), default=None)
    except (OSError, RecordingError):  # a name too long; a folder of too many entries
        return False
    return first is not None and is_dicom(first)


def files_of(folder: Path) -> list[Path]:
    """Return the DICOM files of a folder by name; raises `RecordingError` where others lie beside
    them, or there are more than `_MOST`."""
    files = [member(f) for f in members(folder) if _may_be(f)]
    others = [f.name for f in files if not is_dicom(f)]
    if others:
        said = f"{len(others)} of {len(files)} files are not DICOM ({', '.join(others[:3])})"
        raise RecordingError(f"{said}; take them out")
    if len(files) > _MOST:
        raise RecordingError(f"{len(files)} files, the limit is {_MOST}; split the folder")
    return files


def _may_be(path: Path) -> bool:
    return path.name != "DICOMDIR"


# -------------------------------------------------------------------------------------------------

IMAGES = "images"
_PLANE = 1  # PS3.3 C.8.5.5.1.1: spatial format, a plane
_TISSUE = (1.0, 2.0)  # C.8.5.5.1.2: data type, tissue or colour flow
_SECONDS = 5  # of the processor: black images pack to little
_Box = tuple[int, int, int, int]


def read_dicom(path: Path, options: Options) -> Recording:
    """Images (h, w) grey of every region of tissue, cut out, with the sides of its pixels in m:
    `images`, or `images/1`, `images/2` from the left where there are several.

    Without regions the whole image, with the stated spacing. A folder is one series, a file an
    image. Options: `m_per_px` (then the whole image, with that scale), `rate` (Hz) in place of the
    file's times, `frame` (default image), `white`: the level of 16 bits that becomes 255.
    Raises `UsageError` where scale or times are stated nowhere, or the regions are those of an
    image of another size, `RecordingError` for a file that is cut, damaged or holds no such image.
    """
    if not (path.is_dir() or is_dicom(path)):
        raise RecordingError(f"{path.name}: not a DICOM file, or truncated in its first 132 bytes")
    found = decoded("validate.recording.images.dicom_arrays", path, None, _SECONDS, "dicom")
    images, levels = shallow(list(found["images"]), options)
    height, width = images[0].shape
    count = len(found["images"])
    if "rate" in options:
        t = np.arange(count) / above_zero(options, "rate")
    else:
        if len(found["t"]) != count:
            raise UsageError(
                f"{path.name}: {count} images without times; give --map rate=HZ (a volume is not "
                "read)"
            )
        t = np.asarray(np.rint(1e9 * found["t"]) / 1e9)
    frame = options.get("frame", "image")
    # Where each stream lies in the image, px, and the sides of its pixels, m; what states them.
    planes = [r for r in found["regions"] if r[6] == _PLANE and r[7] in _TISSUE
              and np.isfinite(r[4:6]).all() and (r[4:6] > 0).all()]  # fmt: skip
    if "m_per_px" in options:
        side = length(options, "m_per_px", "0.1mm")
        regions = [((0, 0, width, height), (side, side))]
        scale = f"{options['m_per_px']} per pixel (entered)"
    elif planes:
        regions = [
            (_box(path, r, width, height), (float(r[4]), float(r[5])))
            for r in sorted(planes, key=lambda r: (float(r[0]), float(r[1])))
        ]
        listed = ", ".join(f"{1e3 * x:.6g} x {1e3 * y:.6g}" for _, (x, y) in regions)
        scale = f"{listed} mm per pixel (SequenceOfUltrasoundRegions)"
    else:
        spacing = found["spacing"]
        if len(spacing) != 2 or not (np.isfinite(spacing).all() and (spacing > 0).all()):
            raise UsageError(
                f"{path.name}: has no scale, neither regions in cm nor a spacing; give --map "
                f"m_per_px=0.1mm"
            )
        x, y = 1e-3 * float(spacing[0]), 1e-3 * float(spacing[1])
        regions = [((0, 0, width, height), (x, y))]
        scale = f"{1e3 * x:.6g} x {1e3 * y:.6g} mm per pixel (PixelSpacing)"
    streams: dict[str, Stream] = {}
    told = dict(text.split(": ", 1) for text in found["told"].tolist())
    for i, (box, sides) in enumerate(regions, start=1):
        topic = IMAGES if len(regions) == 1 else f"{IMAGES}/{i}"
        left, top, right, bottom = box
        cut = tuple(np.ascontiguousarray(image[top:bottom, left:right]) for image in images)
        streams[topic] = Frames(t, cut, sides, np.eye(4), frame)
        told[f"{topic} px"] = f"{left}..{right} x {top}..{bottom} of {width} x {height}"
    times = f"{options['rate']} Hz (entered)" if "rate" in options else str(found["timed"])
    told |= {"kind": "images (DICOM)", "times": times, "levels": levels, "scale": scale}
    whole = "DICOM keeps no checksum: integrity not provable"
    name = path.resolve().name if path.is_dir() else path.stem
    source = Source(name, "", 0, whole) if path.is_dir() else source_of(path, whole)
    return recorded(name, source, streams, told)


def _box(path: Path, region: Floats, width: int, height: int) -> _Box:
    left, top, right, bottom = (int(v) for v in region[:4])
    if right > width or bottom > height:
        raise UsageError(
            f"{path.name}: its region ends at pixel {right}, {bottom} of an image of {width} x "
            f"{height}: it was resized after its scale was written; give --map m_per_px=0.1mm"
        )
    if left < 0 or top < 0 or right <= left or bottom <= top:
        raise RecordingError(
            f"{path.name}: a region from {left}, {top} to {right}, {bottom}; damaged"
        )
    return left, top, min(right + 1, width), min(bottom + 1, height)


DICOM = Reader(
    "dicom",
    "ultrasound and other images (DICOM)",
    begins_as_dicom,
    read_dicom,
    "byte 128 of the file, or of a folder's first file, begins DICM",
    options=(M_PER_PX, RATE, frame("image"), WHITE),
    extensions=(".dcm",),
)
