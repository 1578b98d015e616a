"""Parts of a declaration as the lines of an experiment's file: what differs from the defaults, with
units in comments. Values are Python literals: nothing of a recording becomes code."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

_WIDTH = 100
_INDENT = "    "
_AXES = "xyz"
_OPEN = ", identified"  # what stands open


def rendered(part: Any, depth: int = 1) -> str:
    """The part's constructor over several lines, indented `depth` levels; what is inside it stands
    on one line each where that fits."""
    inner = _INDENT * depth
    body = "\n".join(f"{inner}{line}" for f in _told(part) for line in _lines(part, f, depth))
    return f"{type(part).__name__}(\n{body}\n{_INDENT * (depth - 1)})"


def imports(parts: Iterable[Any], more: Mapping[str, tuple[str, ...]]) -> str:
    """The import lines of the parts' classes, and of `more` names by module."""
    found = {module: set(names) for module, names in more.items()}
    for kind in {kind for part in parts for kind in _classes(part)}:
        found.setdefault(kind.__module__, set()).add(kind.__name__)
    return "\n".join(
        f"from {module} import {', '.join(sorted(names))}"
        for module, names in sorted(found.items())
    )


def _classes(value: Any) -> set[type]:
    """Of what is written out."""
    if isinstance(value, tuple):
        return {kind for v in value for kind in _classes(v)}
    if not is_dataclass(value):
        return set()
    return {type(value)}.union(*(_classes(getattr(value, f.name)) for f in _told(value)))


def _told(part: Any) -> list[Any]:
    return [f for f in fields(part) if f.init and getattr(part, f.name) != f.default]


def _lines(part: Any, f: Any, depth: int) -> list[str]:
    value = getattr(part, f.name)
    said = f"{f.name}={_field(f, value)},"
    units = _units(value) if _of_parts(value) else _unit(f)
    line = said + (f"  # {units}" if units else "")
    if len(_INDENT * depth + line) <= _WIDTH:
        return [line]
    if units and len(_INDENT * depth + said) <= _WIDTH:
        return [f"# {units}", said]
    if is_dataclass(value):
        return [f"{f.name}={rendered(value, depth + 1)},"]
    if _of_parts(value):
        each = [f"{_INDENT}{_literal(v)}," + (f"  # {u}" if (u := _units(v)) else "")
                for v in value]  # fmt: skip
        inner = "".join(f"{_INDENT * depth}{line}\n" for line in each)
        return [f"{f.name}=(\n{inner}{_INDENT * depth}),"]
    return [*([f"# {units}"] if units else []), said]


def _of_parts(value: Any) -> bool:
    return is_dataclass(value) or (isinstance(value, tuple) and any(map(is_dataclass, value)))


def _unit(f: Any) -> str:
    unit: str = f.metadata.get("unit", "1")
    return "" if unit == "1" else unit


def _units(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(dict.fromkeys(unit for v in value if (unit := _units(v))))
    told = _told(value)
    own = [f"{f.name}: {_unit(f)}{_OPEN if getattr(value, f.name) is None else ''}"
           for f in told if _unit(f)]  # fmt: skip
    inner = [_units(v) for f in told if _of_parts(v := getattr(value, f.name))]
    return ", ".join(text for text in (*own, *inner) if text)


def _field(f: Any, value: Any) -> str:
    """A direction along an axis is a word."""
    if f.name == "direction" and sorted(map(abs, value or ())) == [0.0, 0.0, 1.0]:
        axis = next(i for i, c in enumerate(value) if c)
        return repr(f"{'+' if value[axis] > 0 else '-'}{_AXES[axis]}")
    return _literal(value)


def _literal(value: Any) -> str:
    if is_dataclass(value):
        inside = ", ".join(f"{f.name}={_field(f, getattr(value, f.name))}" for f in _told(value))
        return f"{type(value).__name__}({inside})"
    if isinstance(value, float):
        return f"{value:.6g}" if float(f"{value:.6g}") == value else repr(value)
    if isinstance(value, tuple):
        inside = ", ".join(_literal(v) for v in value)
        return f"({inside},)" if len(value) == 1 else f"({inside})"
    return repr(value)
