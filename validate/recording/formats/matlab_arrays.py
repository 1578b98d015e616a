"""What a MATLAB 5 file holds, as plain arrays. The only file that imports scipy.io."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError

MAGIC = b"MATLAB 5.0 MAT-file"
HEADER = 128  # bytes
MATRIX, COMPRESSED = 14, 15  # types of what may stand behind the header
_CHUNK = 2**20  # bytes unpacked at once
_NUMBERS = ("double", "single", "logical", *(f"{u}int{b}" for u in ("", "u") for b in (8, 16, 32)))


def elements(path: Path) -> list[tuple[int, int, int]]:
    """Type, begin and bytes of every variable, by the file's own account of its length.

    Raises `RecordingError` for what ends before it or is no variable.
    """
    size, found, at = path.stat().st_size, [], HEADER
    with path.open("rb") as file:
        first = file.read(HEADER)
        order = {b"IM": "<", b"MI": ">"}.get(first[-2:])
        if len(first) < HEADER or not first.startswith(MAGIC) or order is None:
            raise RecordingError(f"no MATLAB 5 file, or one cut in its first {HEADER} bytes")
        while at < size:
            file.seek(at)
            tag = file.read(8)
            kind, count = struct.unpack(f"{order}II", tag) if len(tag) == 8 else (MATRIX, 0)
            at += 8 + count
            if at > size or len(tag) < 8:
                raise RecordingError(f"{size} bytes, its variables need {at} and more; cut")
            if kind not in (MATRIX, COMPRESSED):
                raise RecordingError(f"no variable {8 + count} bytes before byte {at}; damaged")
            found.append((kind, at - count, count))
    return found


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Every variable of numbers by name, after the checksums of those that are compressed.

    Other variables stand as their own word for what they are: an array () of text.
    """
    from scipy.io import loadmat, whosmat

    _require_sums(path)
    listed = {name: kind for name, _, kind in whosmat(path)}
    wanted = [name for name, kind in listed.items() if kind in _NUMBERS]
    found = loadmat(path, variable_names=wanted) if wanted else {}
    return {n: np.asarray(found[n]) if n in wanted else np.array(k) for n, k in listed.items()}


def _require_sums(path: Path) -> None:
    with path.open("rb") as file:
        for kind, at, count in elements(path):
            file.seek(at)
            if kind == COMPRESSED and not _unpacks(file.read(count)):
                raise RecordingError(f"the variable at byte {at} fails its checksum; damaged")


def _unpacks(packed: bytes) -> bool:
    """Whether the packed bytes end where their own checksum (Adler-32) holds."""
    unpack = zlib.decompressobj()
    while not unpack.eof:
        try:
            some = unpack.decompress(packed, _CHUNK)
        except zlib.error:
            return False
        if not some and len(unpack.unconsumed_tail) == len(packed):
            return False  # nothing more comes
        packed = unpack.unconsumed_tail
    return not unpack.unused_data
