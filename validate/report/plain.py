"""Values as JSON has them: dataclasses as objects, what is not finite as null, no absolute path."""

import math
from dataclasses import fields, is_dataclass
from typing import Any

from validate.report.environment import without_folder

Json = dict[str, Any]


def recorded(value: object) -> Any:
    """The value as JSON can hold it; the fields of a dataclass by their names."""
    if is_dataclass(value):
        return members(value)
    if isinstance(value, (list, tuple)):
        return [recorded(v) for v in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return without_folder(value)


def members(value: object, *names: str) -> Json:
    """Some of an object's members by their names; all fields of a dataclass without names."""
    return {name: recorded(getattr(value, name)) for name in names or _fields(value)}


def _fields(value: object) -> tuple[str, ...]:
    return tuple(f.name for f in fields(value)) if is_dataclass(value) else ()
