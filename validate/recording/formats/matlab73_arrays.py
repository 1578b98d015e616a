"""Arrays of a MATLAB 7.3 file (HDF5). The only reader that imports h5py.

HDF5 counts axes the other way round: an array of h rows and w columns stands there as (w, h). Links
to other files, and data that lie in them, are not followed.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError

LIBRARIES = ("h5py",)
MOST = 2**28  # numbers of all arrays
_DEPTH = 16  # structs in structs
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_NUMBERS = ("double", "single", "logical", *_INTEGERS)


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays by their path (`data.load.N`: fields of structs), axes as MATLAB shows them.

    What is no array of numbers is its own word: an array () of text. Raises `RecordingError` for
    more numbers than `MOST`.
    """
    import h5py

    with h5py.File(path, "r") as file:
        found = dict(_held(h5py, file, "", _DEPTH))
        count = sum(v.size for v in found.values() if not isinstance(v, str))
        if count > MOST:
            raise RecordingError(f"{count} numbers, the limit is {MOST}; split it")
        return {n: np.array(v) if isinstance(v, str) else _values(v) for n, v in found.items()}


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
        else:
            yield path, _dataset(h5py, item, kind)


def _kind(item: Any) -> str:
    if "MATLAB_sparse" in item.attrs:
        return "sparse"
    said = item.attrs.get("MATLAB_class", b"struct" if hasattr(item, "keys") else b"")
    return said.decode("ascii", "replace") if isinstance(said, bytes) else str(said)


def _dataset(h5py: Any, item: Any, kind: str) -> Any:
    """The dataset where it holds numbers, else a word for what it is."""
    if not isinstance(item, h5py.Dataset):
        return kind
    if item.dtype.kind == "O" and kind in ("", "struct", *_NUMBERS):
        return "struct array"  # a reference for each element
    if kind and kind not in _NUMBERS:
        return kind
    if item.attrs.get("MATLAB_empty", 0):
        return f"empty {kind}"
    if item.is_virtual or item.external:
        return "data in another file, not followed"
    if item.dtype.names:
        return f"{item.shape[::-1]} complex"  # real, imag
    return item if item.dtype.kind in "fiub" else str(item.dtype)


def _values(dataset: Any) -> NDArray[Any]:
    values = np.asarray(dataset[()]).T
    return values.astype(bool) if _kind(dataset) == "logical" else values
