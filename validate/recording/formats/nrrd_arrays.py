"""What an NRRD file holds, as plain arrays. The only file that imports pynrrd."""

import zlib
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.recording.formats.sequence import MAX_PIXELS

LIBRARIES = ("nrrd",)
_GZIP = 31  # of zlib: with its header and its checksum
_CHUNK = 2**20  # bytes
_WIDEST = 8  # bytes of a number


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Pixels (w, h, n), the texts of all keys, and the sides (2,) of a pixel as stated."""
    import nrrd

    with path.open("rb") as lines:  # a name with a line break is taken for the header itself
        header = nrrd.read_header(lines)
    count = prod(map(int, header["sizes"]))
    if count > MAX_PIXELS:
        raise RecordingError(f"{count} pixels, limit {MAX_PIXELS}; split it")
    if header["encoding"] in ("gz", "gzip") and "data file" not in header:
        _require_end(path, _WIDEST * count)
    pixels, header = nrrd.read(str(path))
    own = {key: text for key, text in header.items() if isinstance(text, str)}
    return {
        "pixels": pixels,
        "keys": np.array(list(own), dtype=str),
        "texts": np.array(list(own.values()), dtype=str),
        "spacing": _spacing(header),
    }


def _spacing(header: dict[str, Any]) -> NDArray[np.float64]:
    """From the spacings, or the lengths of the axes' directions; 1 1 where none is stated."""
    if "spacings" in header:
        return np.asarray(header["spacings"][:2], dtype=np.float64)
    directions = header.get("space directions")
    if directions is None:
        return np.ones(2)
    return np.array([np.linalg.norm(axis) for axis in list(directions)[:2]], dtype=np.float64)


def _require_end(path: Path, most: int) -> None:
    """The library takes a stream without its end, which holds the checksum, and unpacks all of one
    that holds more than the sizes say: more than `most` bytes are refused before it does."""
    packed = path.read_bytes().partition(b"\n\n")[2]
    unpacker = zlib.decompressobj(_GZIP)
    found = 0
    while packed and not unpacker.eof:
        found += len(unpacker.decompress(packed, _CHUNK))
        if found > most:
            raise RecordingError(f"over {most} bytes unpacked, more than its sizes hold")
        packed = unpacker.unconsumed_tail
    if not unpacker.eof:
        raise RecordingError("cut: its pixels do not end with their checksum")
