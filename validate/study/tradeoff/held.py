"""Memory of a prepared solver: arrays, sparse matrices and factors in bytes, each once."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU

_OF_A_FACTOR = 12  # bytes of an entry of L or U: a number and its row
DEFINITION = (
    "bytes of all arrays, sparse matrices and factors of the prepared solver, its scene, mesh "
    "and system; temporary memory of the set-up is not included"
)


def held_bytes(thing: Any) -> int:
    """Bytes reachable from `thing` through dataclasses, cached properties, tuples and mappings."""
    seen: set[int] = set()
    total, left = 0, [thing]
    while left:
        one = left.pop()
        one = _owner(one) if isinstance(one, np.ndarray) else one
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            total += one.nbytes
        elif isinstance(one, SuperLU):
            total += _OF_A_FACTOR * int(one.nnz)
        else:
            left += _inside(one)
    return total


def _owner(array: np.ndarray) -> np.ndarray:
    """The array whose memory a view shows."""
    base = array.base
    return _owner(base) if isinstance(base, np.ndarray) else array


def _inside(one: Any) -> Iterable[Any]:
    if isinstance(one, Mapping):
        return list(one.values())
    if isinstance(one, (tuple, list)):
        return list(one)
    if sparse.issparse(one):
        return [
            getattr(one, n) for n in ("data", "indices", "indptr", "offsets") if hasattr(one, n)
        ]
    if is_dataclass(one) and not isinstance(one, type):
        own = [getattr(one, f.name) for f in fields(one)]
        return own + list(getattr(one, "__dict__", {}).values())  # cached properties too
    module = type(one).__module__ or ""
    return (
        list(vars(one).values())
        if module.startswith("validate") and hasattr(one, "__dict__")
        else []
    )
