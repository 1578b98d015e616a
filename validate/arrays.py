"""Array checks (shape, finite values) and root mean square."""

import copyreg
from collections.abc import Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from validate.errors import ValidateError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def checked(
    value: ArrayLike,
    name: str,
    shape: Sequence[int | None],
    *,
    nan: bool = False,
    error: type[ValidateError] = ValidateError,
) -> Floats:
    """A read-only float copy of `value` with the given shape; `None` stands for any length.

    `nan=True` admits NaN ("not seen"), never infinity. Raises `error` with the shapes or counts.
    """
    array = np.array(value, dtype=np.float64)
    _check_shape(array.shape, name, shape, error)
    bad = np.isinf(array) if nan else ~np.isfinite(array)
    if bad.any():
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        raise error(f"{name}: {int(bad.sum())} of {array.size} values not finite, first at {first}")
    array.setflags(write=False)
    return array


def checked_indices(
    value: ArrayLike,
    name: str,
    shape: Sequence[int | None],
    below: int,
    *,
    error: type[ValidateError] = ValidateError,
) -> Ints:
    """A read-only integer copy of `value` with the given shape and 0 <= entries < `below`."""
    array = np.array(value, dtype=np.int64)
    _check_shape(array.shape, name, shape, error)
    if array.size and (array.min() < 0 or array.max() >= below):
        raise error(f"{name}: entries {array.min()}..{array.max()} outside 0..{below - 1}")
    array.setflags(write=False)
    return array


def _check_shape(
    got: tuple[int, ...], name: str, want: Sequence[int | None], error: type[ValidateError]
) -> None:
    fits = len(got) == len(want) and all(
        w is None or w == g for g, w in zip(got, want, strict=True)
    )
    if not fits:
        pattern = ", ".join("any" if w is None else str(w) for w in want)
        raise error(f"{name}: shape {got}, expected ({pattern})")


def _read_only(content: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(content)


#: Frozen types hold read-only mappings, which Python by itself does not pickle.
copyreg.pickle(MappingProxyType, lambda proxy: (_read_only, (dict(proxy),)))


def rebuilt(instance: Any) -> tuple[type, tuple[Any, ...]]:
    """`__reduce__` of a dataclass that checks itself: a copy is made and checked anew, so that its
    arrays are read-only again."""
    given = (getattr(instance, f.name) for f in fields(instance) if f.init)
    return type(instance), tuple(given)


def rms(values: ArrayLike, weights: Floats | None = None) -> float:
    """Root mean square of numbers (k,) or of the lengths of vectors (..., c), in their unit.

    `weights` (...), one a number or vector, need not add up to 1.
    """
    squares = np.asarray(values, dtype=np.float64) ** 2
    lengths = squares.sum(axis=-1) if squares.ndim > 1 else squares
    return float(np.sqrt(lengths.mean() if weights is None else np.average(lengths, None, weights)))
