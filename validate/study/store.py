"""What a study keeps: one JSON file a cell, under a key of all that makes its numbers."""

import hashlib
import json
import types
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from validate.places import write_whole
from validate.report.made import code_sha256

R = TypeVar("R")


@dataclass(frozen=True)
class Record(Generic[R]):
    """What a cell gave: its `value`, or why there is none.

    `refused` is a known error's line, `failed` a bug's or a dead worker's. `seconds` is what the
    whole cell took. `lasting` is False for a failure that another try may not have.
    """

    key: str
    value: R | None = None
    refused: str = ""
    failed: str = ""
    seconds: float = 0.0
    lasting: bool = True

    @property
    def why(self) -> str:
        """Why there is no value; "" where there is one."""
        return self.refused or self.failed


def key_of(*content: Any) -> str:
    """Equal for equal content, code and libraries."""
    text = json.dumps([code_sha256(), *content], default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def write_record(folder: Path, cell: Any, record: Record[Any]) -> None:
    """Writes <key>.json whole or not at all; `cell` is for whoever reads the file."""
    content = {"cell": cell, "record": record}
    text = json.dumps(content, default=_plain, allow_nan=False, ensure_ascii=False)
    write_whole(folder / f"{record.key}.json", text)


def read_records(folder: Path, keys: Iterable[str], kind: type[R]) -> dict[str, Record[R]]:
    """By key, those that were finished before; a damaged file counts as not finished."""
    found = {}
    for key in keys:
        record = _read(folder / f"{key}.json", kind)
        if record is not None and record.key == key:
            found[key] = record
    return found


def _read(path: Path, kind: type[R]) -> Record[R] | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))["record"]
        value = content.pop("value")
        return Record(value=None if value is None else _made(kind, value), **content)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _plain(value: Any) -> Any:
    """A dataclass, mapping or array as what JSON knows."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return repr(value)


def _made(hint: Any, value: Any) -> Any:
    """The value of that type again; raises `TypeError` or `KeyError` where it does not fit."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return None if value is None else _made(inner[0], value)
    if origin is tuple:
        kinds = [inner[0]] * len(value) if inner[-1] is Ellipsis else inner
        return tuple(_made(k, v) for k, v in zip(kinds, value, strict=True))
    if origin is np.ndarray:
        return np.array(value, dtype=np.float64)
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        return hint(**{name: _made(hints[name], v) for name, v in value.items()})  # type: ignore[operator]
    if origin is not None and issubclass(origin, Mapping):
        return {k: _made(inner[1], v) for k, v in value.items()}
    return value
