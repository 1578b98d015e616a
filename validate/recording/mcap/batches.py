"""Many JSON messages of one channel at once: parsed together, judged by column.

A batch is taken only where every message is what this package itself writes, and all of them are
alike; what is not is `None`, and `schemas.decode` says of each message what is wrong. The messages
are parsed as one JSON list with a mark between each two. The mark occurs nowhere else in the
bytes, so where it stands at every second place, each message is one value by itself. Without a
backslash each colon belongs to a key or to a text that was kept, so their count shows a field that
occurs twice. `orjson` refuses NaN, infinity and numbers beyond float64, and rounds as `json` does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np
import orjson

from validate.arrays import Floats, Ints
from validate.recording.mcap.schemas import MARKERS, MAX_MESSAGE, SIGNAL, Json

_MARK = "|between|"
_NUMBER = {int, float}
_LAST_SECOND = 2**63 // 10**9


class _OddError(Exception):
    """Not what this package writes, or not all alike."""


@dataclass(frozen=True)
class Alike:
    """Messages that agree: stamps (n,) ns; values (n, ...) as of `schemas.Sample`."""

    stamps_ns: Ints
    frame: str
    sd: float
    names: tuple[str, ...]
    unit: str
    values: Floats


def batch(schema: str, messages: Sequence[bytes]) -> Alike | None:
    """The messages as one batch; None where one is odd, differs, or has another schema."""
    columns = {SIGNAL: _signals, MARKERS: _markers}.get(schema)
    if columns is None:
        return None
    try:
        return columns(*_parsed(messages))
    except (_OddError, ValueError, TypeError, KeyError, OverflowError):
        return None


def _parsed(messages: Sequence[bytes]) -> tuple[list[Json], int]:
    """The messages as objects, and how many colons their bytes have."""
    mark = f'"{_MARK}"'.encode()
    whole = (b"," + mark + b",").join(messages)
    _require(max(map(len, messages)) <= MAX_MESSAGE)
    _require(whole.count(mark) == len(messages) - 1)
    _require(b"\\" not in whole)
    values = orjson.loads(b"[" + whole + b"]")
    objects, marks = values[::2], values[1::2]
    _require(len(objects) == len(messages) and set(marks) <= {_MARK})
    _require(set(map(type, objects)) == {dict})
    return objects, whole.count(b":")


def _signals(objects: list[Json], colons: int) -> Alike:
    get = itemgetter("stamp", "frame", "unit", "values", "sd")
    stamps, frames, units, values, sds = zip(*map(get, objects), strict=True)
    frame, unit = _text(frames), _text(units)
    keys = _keys(objects, 5) + _keys(stamps, 2)
    _require(colons == keys + len(objects) * (frame.count(":") + unit.count(":")))
    found = _column(values, _NUMBER)
    return Alike(_stamps(stamps), frame, _number(sds), (), unit, found)


def _markers(objects: list[Json], colons: int) -> Alike:
    get = itemgetter("stamp", "frame", "names", "x", "y", "z", "sd")
    stamps, frames, lists, x, y, z, sds = zip(*map(get, objects), strict=True)
    frame, names = _text(frames), _names(lists)
    keys = _keys(objects, 7) + _keys(stamps, 2)
    _require(colons == keys + len(objects) * (frame.count(":") + "".join(names).count(":")))
    axes = [x, y] if z.count(None) == len(z) else [x, y, z]
    columns = [_column(axis, _NUMBER | {type(None)}) for axis in axes]
    _require({c.shape[1] for c in columns} == {len(names)})
    return Alike(_stamps(stamps), frame, _number(sds), names, "", np.stack(columns, axis=2))


def _require(true: bool) -> None:
    if not true:
        raise _OddError


def _only(values: Sequence[Any]) -> Any:
    """The value that all of them have."""
    (value,) = set(values)
    return value


def _text(values: Sequence[Any]) -> str:
    _require(set(map(type, values)) == {str})
    return str(_only(values))


def _number(values: Sequence[Any]) -> float:
    _require(set(map(type, values)) <= _NUMBER)
    return float(_only(values))


def _names(values: Sequence[Any]) -> tuple[str, ...]:
    _require(set(map(type, values)) == {list})
    names: tuple[str, ...] = _only(list(map(tuple, values)))
    _require(set(map(type, names)) <= {str})
    return names


def _keys(objects: Sequence[Any], count: int) -> int:
    """How many keys they have in all; odd unless each has `count`."""
    _require(set(map(type, objects)) == {dict} and set(map(len, objects)) == {count})
    return count * len(objects)


def _column(values: Sequence[Any], allowed: set[type]) -> Floats:
    """Lists of equal length as (n, c), null as NaN."""
    _require(set(map(type, values)) == {list})
    length = _only(list(map(len, values)))
    flat = list(chain.from_iterable(values))
    _require(set(map(type, flat)) <= allowed)
    return np.array(flat, dtype=np.float64).reshape(len(values), length)


def _stamps(stamps: Sequence[Any]) -> Ints:
    seconds, nanoseconds = zip(*map(itemgetter("sec", "nsec"), stamps), strict=True)
    _require(set(map(type, seconds)) == {int} == set(map(type, nanoseconds)))
    sec, nsec = np.array(seconds, dtype=np.int64), np.array(nanoseconds, dtype=np.int64)
    _require(sec.min() >= 0 and sec.max() < _LAST_SECOND)
    _require(nsec.min() >= 0 and nsec.max() < 10**9)
    return sec * 10**9 + nsec
