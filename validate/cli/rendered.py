"""Cards of parameters as the lines of an experiment's file: what differs from the defaults, with
units in comments. Values are Python literals: nothing of a recording becomes code."""

from dataclasses import fields, is_dataclass
from typing import Any

_WIDTH = 100
_INDENT = "    "


def rendered(card: Any, depth: int = 1) -> str:
    """The card's constructor over several lines, indented `depth` levels; what is inside it stands
    on one line each where that fits."""
    inner = _INDENT * depth
    body = "\n".join(f"{inner}{line}" for f in _told(card) for line in _lines(card, f, depth))
    return f"{type(card).__name__}(\n{body}\n{_INDENT * (depth - 1)})"


def _told(card: Any) -> list[Any]:
    return [f for f in fields(card) if getattr(card, f.name) != f.default]


def _lines(card: Any, f: Any, depth: int) -> list[str]:
    value = getattr(card, f.name)
    said = f"{f.name}={_literal(value)},"
    units = _units(value) if is_dataclass(value) else _unit(f)
    line = said + (f"  # {units}" if units else "")
    if is_dataclass(value) and len(_INDENT * depth + line) > _WIDTH:
        return [f"{f.name}={rendered(value, depth + 1)},"]
    return [line]


def _unit(f: Any) -> str:
    unit: str = f.metadata.get("unit", "1")
    return "" if unit == "1" else unit


def _units(card: Any) -> str:
    return ", ".join(f"{f.name}: {_unit(f)}" for f in _told(card) if _unit(f))


def _literal(value: Any) -> str:
    if is_dataclass(value):
        inside = ", ".join(f"{f.name}={_literal(getattr(value, f.name))}" for f in _told(value))
        return f"{type(value).__name__}({inside})"
    if isinstance(value, float):
        return f"{value:.6g}" if float(f"{value:.6g}") == value else repr(value)
    if isinstance(value, tuple):
        inside = ", ".join(_literal(v) for v in value)
        return f"({inside},)" if len(value) == 1 else f"({inside})"
    return repr(value)
