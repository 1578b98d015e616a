"""Parameters of an experiment: nested frozen dataclasses whose fields carry a unit and a sentence.

One grammar of paths reaches them all: `material.E`, `methods.p2_fluid.tolerance`. Values given as
text are checked against the field's type; an unknown path is an error naming the nearest ones.
"""

import difflib
import math
import types
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from validate.errors import UsageError

# Read from the recording; given in the experiment's file or by --set; the library's; or fitted.
Origin = Literal["recorded", "entered", "default", "identified"]


def quantity(default: Any, unit: str, doc: str, *, asked: bool = False) -> Any:
    """A dataclass field with default, SI unit ("1" for none) and what it is.

    `asked`: nothing may run while it is None; the recording says it, or the user does.
    """
    return field(default=default, metadata={"unit": unit, "doc": doc, "asked": asked})


def known(value: float | None, path: str) -> float:
    """A value that must be set; raises `UsageError` where it is None."""
    if value is None:
        raise UsageError(f"{path} is not set; give it with --set {path}=VALUE")
    return value


def part(default: Any, doc: str) -> Any:
    """A field whose own fields belong to its owner's paths: `methods.NAME.tolerance`, wherever in
    the method the tolerance lies."""
    return field(default=default, metadata={"unit": "1", "doc": doc, "part": True})


@dataclass(frozen=True)
class Parameter:
    """One settable value, as `validate list NAME` shows it, and where the value comes from."""

    path: str
    type: str
    unit: str
    default: Any
    doc: str
    origin: Origin = "default"
    asked: bool = False

    @property
    def missing(self) -> bool:
        return self.asked and self.default is None


def describe(settings: Any, prefix: str = "", library: Any = None) -> tuple[Parameter, ...]:
    """Every parameter of a nested dataclass (or mapping of dataclasses), in order.

    `library` holds the defaults that its owner has for it (None: the fields' own): what differs
    from them was entered.
    """
    found: list[Parameter] = []
    for name, value, hint, meta in _members(settings):
        path, default = f"{prefix}{name}", _default(settings, name, library)
        if meta.get("part"):
            found += describe(value, prefix, default) if is_dataclass(value) else ()
        elif is_dataclass(value) or isinstance(value, Mapping):
            found += describe(value, f"{path}.", default)
        else:
            unit, doc = meta.get("unit", "1"), meta.get("doc", "")
            origin: Origin = "default" if value == default else "entered"
            found.append(
                Parameter(
                    path, _type_name(hint), unit, _plain(value), doc, origin,
                    meta.get("asked", False),
                )
            )  # fmt: skip
    return tuple(found)


def _default(settings: Any, name: str, library: Any) -> Any:
    """What a member is unless somebody gives it."""
    if isinstance(settings, Mapping):
        return None
    if type(library) is type(settings):
        return getattr(library, name)
    return next(f.default for f in fields(settings) if f.name == name)


def with_values(settings: Any, values: Mapping[str, str]) -> Any:
    """A copy with the texts parsed into the fields at their paths.

    Raises `UsageError` for an unknown path (naming the nearest) or a value of another type.
    """
    for path, text in values.items():
        names = _resolved(settings, path.split("."))
        if names is None:
            known = {p.path for p in describe(settings)}
            raise UsageError(f"unknown parameter '{path}'; {_nearest(path, known)}")
        settings = _set(settings, names, path, text)
    return settings


def _resolved(settings: Any, names: list[str]) -> list[str] | None:
    """The way to a value through the parts that paths leave out; None where there is no value."""
    if not (is_dataclass(settings) or isinstance(settings, Mapping)):
        return None
    members = {name: (value, meta) for name, value, _, meta in _members(settings)}
    head, rest = names[0], names[1:]
    if head in members:
        value = members[head][0]
        if not rest and not (is_dataclass(value) or isinstance(value, Mapping)):
            return [head]
        inner = _resolved(value, rest) if rest else None
        if inner:
            return [head, *inner]
    for name, (value, meta) in members.items():
        inner = _resolved(value, names) if meta.get("part") else None
        if inner:
            return [name, *inner]
    return None


@dataclass(frozen=True)
class Ranges:
    """Standard uncertainties of the inputs, declared before the comparison.

    Those without unit are relative or shares. Raises `UsageError` for one below 0, or a share
    above 1.
    """

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if not value >= 0 or (f.metadata.get("unit") == "1" and value > 1):
                raise UsageError(
                    f"ranges.{f.name} = {value:g}: a standard uncertainty is 0 or above"
                )


def nearest_names(name: str, known: set[str]) -> str:
    """A hint naming the known ones nearest to `name`."""
    return _nearest(name, known)


def _nearest(name: str, known: set[str]) -> str:
    near = difflib.get_close_matches(name, sorted(known), n=3, cutoff=0.4)
    return "nearest: " + ", ".join(near) if near else "known: " + ", ".join(sorted(known)[:8])


def _members(settings: Any) -> list[tuple[str, Any, Any, Mapping[str, Any]]]:
    if isinstance(settings, Mapping):
        return [(str(k), v, type(v), {}) for k, v in settings.items()]
    hints = get_type_hints(type(settings))
    return [
        (f.name, getattr(settings, f.name), hints[f.name], f.metadata) for f in fields(settings)
    ]


def _set(settings: Any, names: list[str], path: str, text: str) -> Any:
    head, rest = names[0], names[1:]
    inner = settings[head] if isinstance(settings, Mapping) else getattr(settings, head)
    if rest:
        value = _set(inner, rest, path, text)
    else:
        value = _parse(get_type_hints(type(settings))[head], path, text)
    if isinstance(settings, Mapping):
        return types.MappingProxyType({**settings, head: value})
    return replace(settings, **{head: value})


def _parse(hint: Any, path: str, text: str) -> Any:
    if get_origin(hint) in (Union, types.UnionType):
        options = [a for a in get_args(hint) if a is not type(None)]
        return None if text.lower() in ("none", "null") else _parse(options[0], path, text)
    if get_origin(hint) is Literal:
        choices = {str(choice): choice for choice in get_args(hint)}
        if text not in choices:
            raise UsageError(f"{path}={text}: one of {', '.join(choices)}")
        return choices[text]
    if get_origin(hint) is tuple:
        return tuple(_parse(get_args(hint)[0], path, part) for part in text.split(","))
    if hint is bool:
        if text.lower() not in ("true", "false"):
            raise UsageError(f"{path}={text}: true or false")
        return text.lower() == "true"
    return _number(hint, path, text) if hint in (int, float) else text


def _number(hint: type[int] | type[float], path: str, text: str) -> int | float:
    try:
        value = hint(text)
    except ValueError:
        kind = "a whole number" if hint is int else "a number in SI units"
        raise UsageError(f"{path}={text}: not {kind}") from None
    if not math.isfinite(value):
        raise UsageError(f"{path}={text}: not finite")
    return value


def _type_name(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return "|".join(map(str, get_args(hint)))
    return hint.__name__ if isinstance(hint, type) else str(hint).replace("typing.", "")


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
