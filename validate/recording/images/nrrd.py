"""Reader of NRRD with the frames of the PLUS toolkit, like a MetaImage sequence. The only file that
imports pynrrd.
"""

import zlib
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import inside, open_file, read_bytes
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.images.image import luma
from validate.recording.images.sequence import MAX_PIXELS, OPTIONS, Sequence, by_frame, recorded
from validate.recording.reader import Options, Reader, head
from validate.recording.types import Recording
from validate.units import in_si

LIBRARIES = ("nrrd",)
_LIST = "list"  # the kind of the axis that lists images
_SPACE = ("domain", "space")
_COLOUR = ("rgb-color", "rgba-color", "3-color", "4-color", "vector", "3-vector", "4-vector")
_GZIP = 31  # of zlib: with its header and its checksum
_CHUNK = 2**20  # bytes
_WIDEST = 8  # bytes of a number


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Pixels (w, h, n), the texts of all keys, the sides (2,) of a pixel as stated, `times` (n,) s
    of the images, none where they are not stated, and what makes all axes those of space, `deep`.
    """
    import nrrd

    with open_file(path) as lines:  # a name with a line break is taken for the header itself
        header = nrrd.read_header(lines)
    named = header.get("data file", header.get("datafile"))
    if named is not None:
        open_file(inside(path.parent, str(named))).close()
    count = prod(map(int, header["sizes"]))
    if count > MAX_PIXELS:
        raise RecordingError(f"{count} pixels, limit {MAX_PIXELS}; split it")
    if header["encoding"] in ("gz", "gzip") and named is None:
        _require_end(path, _WIDEST * count)
    pixels, header = nrrd.read(str(path))
    own = {key: text for key, text in header.items() if isinstance(text, str)}
    kinds = [str(kind).lower() for kind in header.get("kinds", ())]
    # Colour as grey, and the axis that lists the images, as 3D Slicer has it first, at the end.
    axes = kinds
    colours = (i for i, k in enumerate(kinds) if k in _COLOUR and pixels.shape[i] in (3, 4))
    if (colour := next(colours, None)) is not None:
        pixels = luma(np.moveaxis(pixels, colour, -1))
        axes = kinds[:colour] + kinds[colour + 1 :]
    if _LIST in axes:
        pixels = np.moveaxis(pixels, axes.index(_LIST), -1)
    # Sides of a pixel: from the spacings, or the lengths of the directions, of the first two axes
    # in space; 1 1 where none is stated.
    space = [i for i, kind in enumerate(kinds) if kind in _SPACE]
    plane = space[:2] if len(space) > 1 else [0, 1]
    directions = header.get("space directions")
    sides = np.ones(2)
    if "spacings" in header:
        sides = np.asarray(header["spacings"], dtype=np.float64)[plane]
    elif directions is not None:
        sides = np.array([np.linalg.norm(directions[k]) for k in plane], dtype=np.float64)
    # What makes all axes those of space, three without colour: their kinds, else their directions
    # or spacings.
    shown = [i for i in range(len(header["sizes"])) if not kinds or kinds[i] not in _COLOUR]
    units = [str(unit) for unit in header.get("units", ())]
    apart = np.array(header.get("spacings", ()), dtype=np.float64)
    rows = [] if directions is None else [row for row in directions if row is not None]
    deep, three = "", len(shown) == 3
    if three and kinds:
        deep = "its three axes are of space" * all(kinds[i] in _SPACE for i in shown)
    elif (
        three and np.isfinite(apart).sum() == 3 and not any(in_si(1.0, u, "s") for u in units if u)
    ):
        deep = f"spacings {' '.join(f'{side:g}' for side in apart)}"
    elif three and len(rows) == 3 and np.isfinite(rows).all():
        deep = "three space directions"
    return {
        "pixels": pixels,
        "keys": np.array(list(own), dtype=str),
        "texts": np.array(list(own.values()), dtype=str),
        "spacing": sides,
        "times": _times(header, kinds),
        "deep": np.array(deep),
    }


def _times(header: dict[str, Any], kinds: list[str]) -> NDArray[np.float64]:
    """Seconds of the images, as 3D Slicer lists them where they are times; none of what is not."""
    at = kinds.index(_LIST) if _LIST in kinds else 0
    values = str(header.get(f"axis {at} index values", "")).split()
    units = [*header.get("units", ()), *[""] * len(header["sizes"])]
    factor = in_si(1.0, str(header.get(f"axis {at} index unit") or units[at]) or "none", "s")
    try:
        t = np.array([float(v) for v in values])
    except ValueError:
        return np.empty(0)
    return t * factor if factor is not None and (np.diff(t) > 0).all() else np.empty(0)


def _require_end(path: Path, most: int) -> None:
    """The library takes a stream without its end, which holds the checksum, and unpacks all of one
    that holds more than the sizes say: more than `most` bytes are refused before it does."""
    packed = read_bytes(path).partition(b"\n\n")[2]
    unpacker = zlib.decompressobj(_GZIP)
    found = 0
    while packed and not unpacker.eof:
        found += len(unpacker.decompress(packed, _CHUNK))
        if found > most:
            raise RecordingError(f"over {most} bytes unpacked, more than its sizes hold")
        packed = unpacker.unconsumed_tail
    if not unpacker.eof:
        raise RecordingError("truncated: its pixels do not end with their checksum")


_MAGIC = b"NRRD000"


def read_nrrd(path: Path, options: Options) -> Recording:
    """Transforms and images of a sequence, as `sequence.recorded` has them.

    Raises `RecordingError` for a file that is cut, damaged, no NRRD, or of other pixels than grey
    of 8 or 16 bits; `UsageError` without the library, and as `recorded`.
    """
    if not path.is_file():
        raise RecordingError(
            f"{path}: no such file" if not path.exists() else f"{path}: not a file"
        )
    if not _recognises(path):
        raise RecordingError(f"{path.name}: not an NRRD file, or truncated in its first bytes")
    found = decoded("validate.recording.images.nrrd", path)
    keys, texts = found["keys"].tolist(), found["texts"].tolist()
    x, y = found["spacing"].tolist()
    fields = by_frame(zip(keys, texts, strict=True))
    images = _images(path, found["pixels"])
    way = dict(zip(keys, texts, strict=True)).get("UltrasoundImageOrientation", "")
    times = found["times"] if len(found["times"]) == len(images) else None
    deep = str(found["deep"])
    return recorded(path, Sequence(fields, images, (x, y), "NRRD", way, times, deep), options)


def _images(path: Path, pixels: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Images n x (h, w) of pixels (w, h, 1, n), (w, h, n) or (w, h), x first."""
    if not pixels.size:
        return ()
    if pixels.ndim == 4 and pixels.shape[2] == 1:
        pixels = pixels[:, :, 0]
    whole = pixels.dtype.kind in "iu" and (pixels.dtype == np.uint8 or pixels.itemsize == 2)
    if not whole or pixels.ndim not in (2, 3) or pixels.nbytes > MAX_PIXELS:
        raise RecordingError(
            f"{path.name}: pixels {pixels.shape} {pixels.dtype}; images of 8 or 16-bit grey, one "
            f"px deep, up to {MAX_PIXELS} bytes are read"
        )
    stack = pixels if pixels.ndim == 3 else pixels[..., None]
    return tuple(np.ascontiguousarray(image.T) for image in np.moveaxis(stack, 2, 0))


def _recognises(path: Path) -> bool:
    return head(path, len(_MAGIC)) == _MAGIC


NRRD = Reader(
    "nrrd",
    "tracked sequence (NRRD)",
    _recognises,
    read_nrrd,
    "it begins with NRRD",
    options=OPTIONS,
    extensions=(".nrrd", ".nhdr"),
)
