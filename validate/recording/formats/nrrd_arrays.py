"""What an NRRD file holds, as plain arrays. The only file that imports pynrrd."""

import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError

_GZIP = 31  # of zlib: with its header and its checksum
_CHUNK = 2**20  # bytes


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Pixels (w, h, n), the texts of all keys, and the sides (2,) of a pixel as stated."""
    import nrrd

    pixels, header = nrrd.read(str(path))
    if header["encoding"] in ("gz", "gzip") and "data file" not in header:
        _require_end(path)
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


def _require_end(path: Path) -> None:
    """The library takes a stream without its end, which holds the checksum."""
    packed = path.read_bytes().partition(b"\n\n")[2]
    unpacker = zlib.decompressobj(_GZIP)
    while packed and not unpacker.eof:
        unpacker.decompress(packed, _CHUNK)
        packed = unpacker.unconsumed_tail
    if not unpacker.eof:
        raise RecordingError("cut: its pixels do not end with their checksum")
