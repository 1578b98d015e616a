"""Arrays of a MATLAB 5 file. The only file that imports scipy.io."""

import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import open_file

LIBRARIES = ("scipy.io",)
MAGIC = b"MATLAB 5.0 MAT-file"
HEADER = 128  # bytes
_ORDERS = {b"IM": "<", b"MI": ">"}  # of bytes, by the header's last two
MATRIX, COMPRESSED = 14, 15  # types of what may stand behind the header
_CHUNK = 2**20  # bytes unpacked at once
MOST = 2**29  # bytes of one variable, unpacked


def elements(path: Path) -> list[tuple[int, int, int]]:
    """Type, begin and bytes of every variable, by the file's own account of its length.

    Raises `RecordingError` for what ends before it or is no variable.
    """
    size, found, at = path.stat().st_size, [], HEADER
    with open_file(path) as file:
        first = file.read(HEADER)
        order = _ORDERS.get(first[-2:])
        if len(first) < HEADER or not first.startswith(MAGIC) or order is None:
            raise RecordingError(f"not a MATLAB 5 file, or truncated in its first {HEADER} bytes")
        while at < size:
            file.seek(at)
            tag = file.read(8)
            kind, count = struct.unpack(f"{order}II", tag) if len(tag) == 8 else (MATRIX, 0)
            at += 8 + count
            if at > size or len(tag) < 8:
                raise RecordingError(f"{size} bytes, its variables need {at} and more; truncated")
            if kind not in (MATRIX, COMPRESSED):
                raise RecordingError(f"no variable {8 + count} bytes before byte {at}; damaged")
            found.append((kind, at - count, count))
    return found


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Every array of numbers by its path, after the checksums of variables that are compressed.

    `data.load` is the field `load` of the struct `data`. What is no array of numbers stands as its
    own word for what it is: an array () of text.
    """
    from scipy.io import loadmat

    # Every packed variable unpacks to the size that it states itself, and to its checksum.
    parts = elements(path)
    with open_file(path) as file:
        order = _ORDERS[file.read(HEADER)[-2:]]
        for kind, at, count in parts:
            file.seek(at)
            if kind == COMPRESSED and not _unpacks(file.read(count), order):
                raise RecordingError(f"the variable at byte {at} fails its checksum; damaged")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the second reading loses what is imaginary
        # As stored (whole doubles in one byte each), and of the class that they had.
        stored, classed = loadmat(path), loadmat(path, mat_dtype=True)
    found: dict[str, NDArray[Any]] = {}
    for name, value in stored.items():
        if not name.startswith("__"):
            found |= dict(_fields(name, value, classed[name]))
    return found


def _fields(path: str, stored: Any, classed: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """A struct's fields by path; what else is no array of numbers is a word."""
    dtype = getattr(stored, "dtype", np.dtype(object))
    if type(stored).__name__ == "MatlabOpaque":  # the name stands within
        yield _text(stored["s0"]) or path, np.array(_text(stored["s2"]) or "object")
    elif dtype.names and stored.size == 1 and type(stored) is np.ndarray:
        for name in dtype.names:
            yield from _fields(f"{path}.{name}", stored.flat[0][name], classed.flat[0][name])
    elif dtype.kind in "fiubc" and type(stored) is np.ndarray:
        yield path, stored if dtype.kind == "c" else classed
    else:
        yield path, np.array(_word(stored, dtype))


def _text(field: Any) -> str:
    first = np.asarray(field).reshape(-1)[0]
    return first.decode("ascii", "replace") if isinstance(first, bytes) else ""


def _word(value: Any, dtype: np.dtype[Any]) -> str:
    if type(value) is np.ndarray:
        return "struct array" if dtype.names else {"O": "cell", "U": "char"}.get(dtype.kind, "?")
    return (
        "sparse" if hasattr(value, "nnz") else type(value).__name__.removeprefix("Matlab").lower()
    )


def _unpacks(packed: bytes, order: str) -> bool:
    """Whether the packed bytes end where their own size and checksum (Adler-32) hold.

    Raises `RecordingError` for a size beyond `MOST`, before that much is unpacked.
    """
    unpack = zlib.decompressobj()
    size, stated = 0, 8
    while not unpack.eof:
        try:
            some = unpack.decompress(packed, _CHUNK if size else stated)
        except zlib.error:
            return False
        if not some and len(unpack.unconsumed_tail) == len(packed):
            return False  # nothing more comes
        if not size:
            # Bytes that a variable states, its tag of 8 among them.
            if len(some) < 8:
                stated = 8
            else:
                count = 8 + int(struct.unpack(f"{order}II", some)[1])
                if count > MOST:
                    raise RecordingError(
                        f"a variable of {count} bytes unpacked, the limit is {MOST}"
                    )
                stated = count
        size += len(some)
        if size > stated + 8:  # with what fills its last eight
            return False
        packed = unpack.unconsumed_tail
    return not unpack.unused_data
