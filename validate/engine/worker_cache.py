"""Cache of a worker between cells: the last few values by key."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from hashlib import sha256
from typing import Any, Generic, TypeVar

import numpy as np

V = TypeVar("V")


class Kept(Generic[V]):
    """At most `most` values; a value that is asked for again becomes the youngest."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: OrderedDict[Hashable, V] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        if key not in self._values:
            self._values[key] = make()
            if len(self._values) > self._most:
                self._values.popitem(last=False)
        self._values.move_to_end(key)
        return self._values[key]


def fingerprint(value: Any) -> str:
    """Equal for equal content of nested dataclasses, mappings, tuples, arrays and plain values."""
    found = sha256()
    for part in _parts(value):
        found.update(part)
    return found.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif is_dataclass(value):
        yield type(value).__name__.encode()
        for f in fields(value):
            yield from _parts(getattr(value, f.name))
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield repr(key).encode()
            yield from _parts(inner)
    elif isinstance(value, tuple | list):
        yield f"{len(value)} of".encode()
        for inner in value:
            yield from _parts(inner)
    else:
        yield repr(value).encode()
