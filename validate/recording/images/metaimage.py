"""Reader of MetaImage (.mha, .mhd) with the frames of the PLUS toolkit in its header.

ITK's own reader, the library for this format, refuses sequences of transforms without images
(DimSize 0 0 n) and knows nothing of frames: the header is text, and it is read as such, without a
limit to a line, within one to the whole. Pixels are raw or one zlib stream.
"""

import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import ANY_SIZE, inside, open_file
from validate.recording.images.image import luma
from validate.recording.images.sequence import MAX_PIXELS, OPTIONS, Sequence, by_frame, recorded
from validate.recording.reader import Options, Reader, head
from validate.recording.types import Recording

_HEADER = 128 * 2**20  # bytes: some 200 000 frames of two tools
_LAST = "ElementDataFile"
_DEPTHS = {"MET_UCHAR": np.uint8, "MET_USHORT": np.uint16, "MET_SHORT": np.int16}
_CHANNELS = ("1", "3", "4")  # grey, colour, colour with opacity
_BIG = ("BinaryDataByteOrderMSB", "ElementByteOrderMSB")
_KNOWN = ("ObjectType", "NDims", "Comment", "ObjectSubType", "DimSize")


def read_metaimage(path: Path, options: Options) -> Recording:
    """Transforms and images of a sequence, as `sequence.recorded` has them.

    Raises `RecordingError` for a file that is cut, damaged, too large, or of other pixels than
    grey or colour of 8 or 16 bits, and a .mhd whose pixels do not lie beside it; `UsageError` as
    `recorded`.
    """
    # Texts by key, and where the header ends; the name of the pixels' file is its last line.
    if not path.is_file():
        raise RecordingError(
            f"{path}: no such file" if not path.exists() else f"{path}: not a file"
        )
    text = head(path, _HEADER) if _recognises(path) else b""
    last = re.search(rf"\n{_LAST}[ \t]*=[^\n]*\n".encode(), text)
    if last is None:
        raise RecordingError(
            f"{path.name}: not a MetaImage, or its header does not end with '{_LAST} = ...' within "
            f"{min(len(text), _HEADER)} bytes: truncated or damaged"
        )
    lines = text[: last.end()].decode("utf-8", "replace").splitlines()
    pairs = (line.partition("=") for line in lines)
    fields, after = {key.strip(): value.strip() for key, sign, value in pairs if sign}, last.end()
    images = _images(path, fields, after)
    kind = "MetaImage sequence"
    way = fields.get("UltrasoundImageOrientation", "")
    # Sides of a pixel as the file states them; 1 1 where it does not.
    sides = fields.get("ElementSpacing", "1 1").split()
    try:
        x, y = float(sides[0]), float(sides[1])
    except (ValueError, IndexError):
        x = y = 0.0
    if not (0 < x < np.inf and 0 < y < np.inf):
        raise RecordingError(f"{path.name}: ElementSpacing '{' '.join(sides)[:60]}' is not a size")
    # Three axes of space, where no kind says another.
    of_space = set(fields.get("Kinds", "").split()) <= {"domain", "space"}
    volume = of_space and fields.get("NDims") == "3"
    deep = f"spacing {fields.get('ElementSpacing', 'not stated')}" if volume else ""
    held = Sequence(by_frame(fields.items()), images, (x, y), kind, way, deep=deep)
    return recorded(path, held, options)


def _images(path: Path, fields: dict[str, str], after: int) -> tuple[NDArray[Any], ...]:
    """Images n x (h, w); none where the sequence has transforms alone."""
    # Width, height and count; of four numbers the third is the depth of each image: 1.
    text = fields.get("DimSize", "")
    try:
        sizes = [int(word) for word in text.split()]
    except ValueError:
        raise RecordingError(f"{path.name}: DimSize '{text[:60]}': not numbers") from None
    if len(sizes) not in (2, 3, 4) or min(sizes) < 0:
        raise RecordingError(f"{path.name}: DimSize {sizes}: expected 2, 3 or 4 numbers")
    if len(sizes) == 4 and sizes[2] > 1:
        raise RecordingError(
            f"{path.name}: DimSize {sizes}: volumes {sizes[2]} px deep; images (depth 1) are read"
        )
    width, height, count = sizes[0], sizes[1], sizes[-1] if len(sizes) > 2 else 1
    if not width * height * count:
        return ()
    # The type of a level, in the file's order of bytes.
    kind, layers = fields.get("ElementType", ""), fields.get("ElementNumberOfChannels", "1")
    if kind not in _DEPTHS or layers not in _CHANNELS:
        raise RecordingError(
            f"{path.name}: pixels {kind or 'of no type'} x {layers}; save as grey or "
            "colour of 8 or 16 bits"
        )
    said = (fields.get(key, "False").lower() for key in _BIG)
    depth = np.dtype(_DEPTHS[kind]).newbyteorder(">" if "true" in said else "<")
    channels = int(layers)
    size = width * height * count * channels * depth.itemsize
    if size > MAX_PIXELS:
        raise RecordingError(f"{path.name}: {size} bytes of pixels, limit {MAX_PIXELS}; split it")
    packed = _packed(path, fields, after, size)
    data, whole = packed[:size], len(packed) >= size
    if fields.get("CompressedData", "False").lower() == "true":
        unpacker = zlib.decompressobj()
        try:
            data = unpacker.decompress(packed, size + 1)
        except zlib.error as error:
            raise RecordingError(
                f"{path.name}: damaged: its pixels cannot be unpacked ({error})"
            ) from None
        whole = len(data) == size and unpacker.eof
    if not whole:
        raise RecordingError(
            f"{path.name}: {len(data)} bytes of pixels, its header needs {size}: truncated or "
            f"damaged"
        )

    pixels = np.frombuffer(data, dtype=depth).reshape(count, height, width, channels)
    return tuple(pixels[..., 0] if channels == 1 else luma(pixels))


def _packed(path: Path, fields: dict[str, str], after: int, size: int) -> bytes:
    """The bytes of the pixels as they lie in the file, or in one of that name beside it."""
    name = fields[_LAST]
    local = name.upper() == "LOCAL"
    if not local and (name.upper().startswith("LIST") or "%" in name):
        raise RecordingError(
            f"{path.name}: its pixels are in '{name[:60]}'; only one file in the same folder is "
            f"read"
        )
    try:
        with open_file(path if local else inside(path.parent, name), ANY_SIZE) as stream:
            stream.seek(after if local else 0)
            return stream.read(2 * size + 4096)
    except (OSError, RecordingError) as error:
        raise RecordingError(f"{path.name}: its pixels cannot be read ({error})") from error


def _recognises(path: Path) -> bool:
    first = head(path, 256).partition(b"\n")[0].decode("ascii", "replace")
    key, sign, _ = first.partition("=")
    return bool(sign) and key.strip() in _KNOWN


METAIMAGE = Reader(
    "metaimage",
    "tracked sequence (MetaImage)",
    _recognises,
    read_metaimage,
    "it begins with fields of MetaImage, as ObjectType",
    options=OPTIONS,
    extensions=(".mha", ".mhd"),
)
