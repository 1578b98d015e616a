"""JSON values and documents: dataclasses as objects, no non-finite number, no absolute path."""

import json
import math
import re
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from validate.checksums import sealed
from validate.report.stored.environment import without_folder

Json = dict[str, Any]
_NUMBERS_ONLY = re.compile(r"\[\s+(-?[\d.eE+-]+(?:,\s+-?[\d.eE+-]+)*)\s+\]")


def recorded(value: object) -> Any:
    """Return the value as JSON can hold it; the fields of a dataclass by their names."""
    if is_dataclass(value):
        return members(value)
    if isinstance(value, (list, tuple)):
        return [recorded(v) for v in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return without_folder(value)


def members(value: object, *names: str) -> Json:
    """Some of an object's members by their names; all fields of a dataclass without names."""
    if not names and is_dataclass(value):
        names = tuple(f.name for f in fields(value))
    return {name: recorded(getattr(value, name)) for name in names}


def write_json(content: Json, path: Path) -> None:
    """The document as text, sealed; a NaN that slipped through is a bug: `ValueError`."""
    text = json.dumps(sealed(content), allow_nan=False, ensure_ascii=False, indent=1)
    # No string holds a line break, so only arrays match.
    text = _NUMBERS_ONLY.sub(lambda m: "[" + " ".join(m.group(1).split()) + "]", text)
    path.write_text(text + "\n", encoding="utf-8")
