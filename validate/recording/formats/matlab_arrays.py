"""Arrays of MATLAB 5 and 7.3 files. The only reader that imports scipy.io and h5py.

HDF5 (7.3) counts axes the other way round: an array of h rows and w columns stands there as (w, h).
Links to other files, and data that lie in them, are not followed.
"""

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
from validate.recording.reader import head

LIBRARIES = ("scipy.io", "h5py")
MAGIC = b"MATLAB 5.0 MAT-file"
MAGIC_73 = b"MATLAB 7.3"
_HDF5 = b"\x89HDF"  # without the header that MATLAB writes before it
HEADER = 128  # bytes
_ORDERS = {b"IM": "<", b"MI": ">"}  # of bytes, by the header's last two
MATRIX, COMPRESSED = 14, 15  # types of what may stand behind the header
_CHUNK = 2**20  # bytes unpacked at once
MOST = 2**29  # bytes of one variable, unpacked
MOST_NUMBERS = 2**28  # numbers of all arrays
_DEPTH = 16  # structs in structs
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_NUMBERS = ("double", "single", "logical", *_INTEGERS)


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
    own word for what it is: an array () of text. Raises `RecordingError` for a variable that fails
    its checksum, and for more numbers than `MOST_NUMBERS` of an HDF5 file.
    """
    if head(path, len(MAGIC_73)).startswith((MAGIC_73, _HDF5)):
        # Axes as MATLAB shows them.
        import h5py

        with h5py.File(path, "r") as file:
            held = dict(_held(h5py, file, "", _DEPTH))
            count = sum(v.size for v in held.values() if not isinstance(v, str))
            if count > MOST_NUMBERS:
                raise RecordingError(f"{count} numbers, the limit is {MOST_NUMBERS}; split it")
            return {n: np.array(v) if isinstance(v, str) else _values(v) for n, v in held.items()}
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
    elif type(stored) is np.ndarray:
        kind = {"O": "cell", "U": "char"}.get(dtype.kind, "?")
        yield path, np.array("struct array" if dtype.names else kind)
    else:
        kind = type(stored).__name__.removeprefix("Matlab").lower()
        yield path, np.array("sparse" if hasattr(stored, "nnz") else kind)


def _text(field: Any) -> str:
    first = np.asarray(field).reshape(-1)[0]
    return first.decode("ascii", "replace") if isinstance(first, bytes) else ""


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


# --- MATLAB 7.3: HDF5.


def _held(h5py: Any, group: Any, before: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Datasets of numbers and words for what is none, by path."""
    for name in group:
        if name.startswith("#"):  # where MATLAB keeps what cells and objects refer to
            continue
        path = f"{before}{name}"
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            yield path, "a link, not followed"
            continue
        item = group[name]
        kind = _kind(item)
        if isinstance(item, h5py.Group) and kind == "struct" and depth:
            yield from _held(h5py, item, f"{path}.", depth - 1)
        elif not isinstance(item, h5py.Dataset):
            yield path, kind
        elif item.dtype.kind == "O" and kind in ("", "struct", *_NUMBERS):
            yield path, "struct array"  # a reference for each element
        elif kind and kind not in _NUMBERS:
            yield path, kind
        elif item.attrs.get("MATLAB_empty", 0):
            yield path, f"empty {kind}"
        elif item.is_virtual or item.external:
            yield path, "data in another file, not followed"
        elif item.dtype.names:
            yield path, f"{item.shape[::-1]} complex"  # real, imag
        else:
            yield path, item if item.dtype.kind in "fiub" else str(item.dtype)


def _kind(item: Any) -> str:
    if "MATLAB_sparse" in item.attrs:
        return "sparse"
    said = item.attrs.get("MATLAB_class", b"struct" if hasattr(item, "keys") else b"")
    return said.decode("ascii", "replace") if isinstance(said, bytes) else str(said)


def _values(dataset: Any) -> NDArray[Any]:
    values = np.asarray(dataset[()]).T
    return values.astype(bool) if _kind(dataset) == "logical" else values
