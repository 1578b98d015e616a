"""Store of cells: one JSON file each, arrays in .npz, under a key of all inputs of its numbers."""

import hashlib
import io
import json
import math
import types
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Generic, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from validate.checksums import LARGEST, read_sealed, sealed
from validate.engine.cell import R, Record
from validate.engine.identity import code_sha256
from validate.errors import RecordingError
from validate.files import read_bytes
from validate.places import replacing, write_whole

_APART = 200  # numbers: an array of more, or of none, lies in the .npz
_ARRAY, _NUMBER, _ARRAYS = "array", "=number", "arrays_sha256"

Arrays = dict[str, NDArray[Any]]


def key_of(*content: Any) -> str:
    """Equal for equal content, code and libraries."""
    text = json.dumps([code_sha256(), *content], default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def write_record(folder: Path, cell: Any, record: Record[Any]) -> None:
    """Write <key>.json whole or not at all, sealed, and before it the arrays that it names; `cell`
    is for whoever reads the file."""
    arrays: Arrays = {}
    content = {"cell": _finite(cell, {}), "record": _finite(record, arrays)}
    if arrays:
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **arrays)
        content[_ARRAYS] = hashlib.sha256(stream.getbuffer()).hexdigest()
        with replacing(folder / f"{record.key}.npz") as out:
            out.write(stream.getbuffer())
    text = json.dumps(sealed(content), ensure_ascii=False)
    write_whole(folder / f"{record.key}.json", text)


def oldest_removed(folder: Path, most: int) -> None:
    """Remove the oldest files of a folder of records until at most so many bytes are left."""
    files = sorted(folder.glob("*.*"), key=lambda f: f.stat().st_mtime, reverse=True)
    total = 0
    for file in files:
        total += file.stat().st_size
        if total > most:
            file.unlink(missing_ok=True)


@dataclass(frozen=True)
class StoredRecords(Generic[R]):
    """Records by key that were finished before, and a line for each file that is not believed."""

    records: dict[str, Record[R]]
    doubts: tuple[str, ...]


def read_records(folder: Path, keys: Iterable[str], kind: type[R], code: str) -> StoredRecords[R]:
    """Return the records that the code of that hash finished before.

    A file that is not whole, or was changed after it was written, counts as not finished, and so
    does one of another code.
    """
    found: dict[str, Record[R]] = {}
    doubts = []
    for key in keys:
        path = folder / f"{key}.json"
        if not path.exists():
            continue
        try:
            record = _read(path, kind)
        except (RecordingError, ValueError, TypeError, KeyError, AttributeError) as error:
            why = (
                str(error)
                if isinstance(error, RecordingError)
                else (f"{path.name}: it contains no record")
            )
            doubts.append(f"{why}; the cell is computed again")
            continue
        if record.key == key and record.code == code:
            found[key] = record
        else:
            doubts.append(
                f"{path.name}: computed by a different version of the code; the cell "
                "is computed again"
            )
    return StoredRecords(found, tuple(doubts))


def _read(path: Path, kind: type[R]) -> Record[R]:
    content = read_sealed(path)
    arrays: Arrays = {}
    if _ARRAYS in content:
        beside = path.with_suffix(".npz")
        data = read_bytes(beside, LARGEST)
        if hashlib.sha256(data).hexdigest() != content[_ARRAYS]:
            raise RecordingError(f"{beside.name}: ignored (not as it was written)")
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = dict(file)
    given = content["record"]
    value = given.pop("value")
    made = None if value is None else _made(kind, value, arrays)
    return Record(value=made, **given)


def _plain(value: Any) -> Any:
    """A dataclass, mapping or array as what JSON knows."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return repr(value)


def _finite(value: Any, arrays: Arrays) -> Any:
    """As `_plain`, for JSON that is strict: numbers that are not finite are texts, and large arrays
    are put among `arrays` and named."""
    if isinstance(value, float) and not math.isfinite(value):
        return {_NUMBER: repr(float(value))}
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.ndarray) and not 0 < value.size <= _APART:
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {_ARRAY: name}
    if isinstance(value, tuple | list):
        return [_finite(v, arrays) for v in value]
    plain = _plain(value)
    if isinstance(plain, dict):
        return {str(k): _finite(v, arrays) for k, v in plain.items()}
    return _finite(plain, arrays)


def _made(hint: Any, value: Any, arrays: Arrays) -> Any:
    """The value of that type again; raises `TypeError` or `KeyError` where it does not fit."""
    origin, inner = get_origin(hint), get_args(hint)
    if isinstance(value, dict) and value.keys() == {_NUMBER}:
        return float(value[_NUMBER])
    if origin in (Union, types.UnionType):
        return None if value is None else _made(_one_of(inner, value), value, arrays)
    if origin is tuple:
        kinds = [inner[0]] * len(value) if inner[-1] is Ellipsis else inner
        return tuple(_made(k, v, arrays) for k, v in zip(kinds, value, strict=True))
    if origin is np.ndarray:
        if isinstance(value, dict):
            return arrays[value[_ARRAY]]
        return np.array(_numbers(value), dtype=get_args(inner[1])[0])
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        known = {f.name for f in fields(hint) if f.init}
        return hint(**{n: _made(hints[n], v, arrays) for n, v in value.items() if n in known})  # type: ignore[operator]
    if isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields"):
        return hint(*value)  # a named tuple of plain values
    if origin is Literal:
        return value
    if origin is not None and issubclass(origin, Mapping):
        return {k: _made(inner[1], v, arrays) for k, v in value.items()}
    return value


def _one_of(hints: tuple[Any, ...], value: Any) -> Any:
    """Of the types of a union the dataclass with the fields of a stored one, else the first."""
    if isinstance(value, dict):
        for hint in hints:
            if is_dataclass(hint) and {f.name for f in fields(hint)} == value.keys():
                return hint
    return hints[0]


def _numbers(value: Any) -> Any:
    """Nested lists with the numbers that are not finite."""
    if isinstance(value, list):
        return [_numbers(v) for v in value]
    return float(value[_NUMBER]) if isinstance(value, dict) else value
