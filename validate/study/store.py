"""What a study keeps: one JSON file a cell, under a key of all that makes its numbers."""

import hashlib
import json
import types
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from validate.errors import RecordingError
from validate.places import write_whole
from validate.report.made import code_sha256
from validate.seals import read_sealed, sealed

R = TypeVar("R")


@dataclass(frozen=True)
class Record(Generic[R]):
    """What a cell gave: its `value`, or why there is none.

    `refused` is a known error's line, `failed` a bug's or a dead worker's. `seconds` is what the
    whole cell took. `lasting` is False for a failure that another try may not have. `code` is the
    hash of the code that made it, as its worker proved it.
    """

    key: str
    value: R | None = None
    refused: str = ""
    failed: str = ""
    seconds: float = 0.0
    lasting: bool = True
    code: str = ""

    @property
    def why(self) -> str:
        """Why there is no value; "" where there is one."""
        return self.refused or self.failed


def key_of(*content: Any) -> str:
    """Equal for equal content, code and libraries."""
    text = json.dumps([code_sha256(), *content], default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def write_record(folder: Path, cell: Any, record: Record[Any]) -> None:
    """Writes <key>.json whole or not at all, sealed; `cell` is for whoever reads the file."""
    content = {"cell": cell, "record": record}
    plain = json.loads(json.dumps(content, default=_plain, allow_nan=False))
    text = json.dumps(sealed(plain), ensure_ascii=False)
    write_whole(folder / f"{record.key}.json", text)


@dataclass(frozen=True)
class StoredRecords(Generic[R]):
    """Records by key that were finished before, and a line for each file that is not believed."""

    records: dict[str, Record[R]]
    doubts: tuple[str, ...]


def read_records(folder: Path, keys: Iterable[str], kind: type[R], code: str) -> StoredRecords[R]:
    """The records that the code of that hash finished before.

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
            record = _record(read_sealed(path)["record"], kind)
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


def _record(content: dict[str, Any], kind: type[R]) -> Record[R]:
    value = content.pop("value")
    return Record(value=None if value is None else _made(kind, value), **content)


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
