"""Parameters of an experiment: nested frozen dataclasses whose fields have unit and description.

One grammar of paths reaches them all: `material.E`, `methods.p2_fluid.tolerance`; of several parts
of one kind each goes by its name, `contacts.plate.friction`, or by its number. Values given as text
are checked against the field's type and unit (`15kPa`; a bare number is in SI); an unknown path is
an error naming the nearest ones.
"""

import difflib
import math
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from validate.errors import UsageError
from validate.units import in_si, split

# Where sizes and moduli of bodies lie, and the unit whose name is forgotten most easily.
_PLAUSIBLE = {"Pa": (100.0, 1e9, "kPa"), "m": (1e-5, 1.0, "mm")}

_OPEN = ("none", "null")

# Read from the recording; given in the experiment's file or by --set; the library's; or fitted.
Origin = Literal["recorded", "entered", "default", "identified"]


def quantity(
    default: Any,
    unit: str,
    doc: str,
    *,
    asked: bool = False,
    opened: bool = False,
    more: Callable[[], Sequence[str]] | None = None,
) -> Any:
    """A dataclass field with default, SI unit ("1" for none) and what it is.

    `asked`: nothing may run while it is None; the recording says it, or the user does. `opened`:
    a declaration, or the user by "none", may leave it open (None), whatever its type. `more`
    returns the choices that plug-ins add to those of its type.
    """
    known = {"unit": unit, "doc": doc, "asked": asked, "opened": opened, "more": more}
    return field(default=default, metadata=known)


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


@dataclass(frozen=True)
class Changed:
    """A parameter that is not as its experiment declares it, in SI."""

    path: str
    default: Any
    value: Any
    unit: str


def changed(declared: Sequence[Parameter], used: Sequence[Parameter]) -> tuple[Changed, ...]:
    """What differs of the parameters that both have; what a method changes of a scene by a path
    that it did not have is held against the scene's own value."""
    own = {p.path: p for p in declared}
    pairs = ((p, own.get(p.path) or own.get(_without_method(p.path))) for p in used)
    return tuple(
        Changed(p.path, d.default, p.default, d.unit)
        for p, d in pairs
        if d and d.default != p.default
    )


def _without_method(path: str) -> str:
    """The path of the scene in methods.NAME.PATH; "" of another one."""
    parts = path.split(".", 2)
    return parts[2] if parts[0] == "methods" and len(parts) == 3 else ""


def describe(settings: Any, prefix: str = "", library: Any = None) -> tuple[Parameter, ...]:
    """Every parameter of a nested dataclass (or mapping of dataclasses), in order.

    `library` holds the defaults that its owner has for it (None: the fields' own): what differs
    from them was entered.
    """
    found: list[Parameter] = []
    for name, value, hint, meta in _members(settings):
        path, default = f"{prefix}{name}", None
        if is_dataclass(settings):
            own = settings.__dataclass_fields__[name].default
            default = getattr(library, name) if type(library) is type(settings) else own
        # Names of parts, arrays, and parts of which there are none are no settings.
        if isinstance(value, tuple) and get_origin(hint) is tuple:
            is_setting = "unit" in meta and not _is_of_parts(hint)
        else:
            absent = value is None and is_dataclass(hint)
            plain = not absent and (value is None or isinstance(value, str | int | float | tuple))
            is_setting = plain and ("unit" in meta or isinstance(hint, type))
        if meta.get("part"):
            found += describe(value, prefix, default) if _branches(value) else ()
        elif _branches(value):
            found += describe(value, f"{path}.", default)
        elif not is_setting or (name == "name" and not meta):
            continue
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


def _is_of_parts(hint: Any) -> bool:
    """Whether a tuple's type is that of several parts."""
    return any(is_dataclass(kind) for kind in _kinds(get_args(hint)[0]))


def _kinds(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def _branches(value: Any) -> bool:
    """Whether a value has parts of its own: a dataclass, named ones, or several of one kind."""
    if isinstance(value, tuple):
        return len(value) > 0 and all(map(is_dataclass, value))
    return is_dataclass(value) or isinstance(value, Mapping)


def _key(part: Any, number: int) -> str:
    """What one of several parts is called in a path: its name, where it has one."""
    name = getattr(part, "name", "")
    return name if isinstance(name, str) and name else str(number)


def _inner(settings: Any, name: str) -> Any:
    if isinstance(settings, tuple):
        return next(part for i, part in enumerate(settings) if _key(part, i) == name)
    return settings[name] if isinstance(settings, Mapping) else getattr(settings, name)


def with_values(settings: Any, values: Mapping[str, str]) -> Any:
    """A copy with the texts parsed into the fields at their paths.

    Raises `UsageError` for an unknown path (naming the nearest), a value of another type or a unit
    of another dimension. Values of one part are set at once: they may have to agree.
    """
    return _set(settings, [(_names(settings, path), path, text) for path, text in values.items()])


def with_given(settings: Any, values: Mapping[str, Any]) -> Any:
    """As `with_values`, of values that need not be texts: those in SI, and whole parts."""
    return _set(settings, [(_names(settings, k, whole=not isinstance(v, str)), k, v)
                           for k, v in values.items()])  # fmt: skip


def value_at(settings: Any, path: str) -> tuple[Any, str]:
    """The value at a path, and its unit; raises `UsageError` as `with_values` does."""
    names = _names(settings, path)
    unit, _ = _leaf(settings, names)
    for name in names:
        settings = _inner(settings, name)
    return settings, unit


def has_path(settings: Any, path: str) -> bool:
    return _resolved(settings, path.split("."), whole=True) is not None


def doubts(settings: Any, values: Mapping[str, str]) -> tuple[str, ...]:
    """A line for each path with a bare number so far off that its unit may have been forgotten.

    Only of fields whose default lies where such values do; a value that says its unit is meant.
    Raises what `with_values` does.
    """
    with_values(settings, values)
    asked = (_doubt(path, text, *_leaf(settings, _names(settings, path)))
             for path, text in values.items())  # fmt: skip
    return tuple(line for line in asked if line)


def _doubt(path: str, text: str, unit: str, default: Any) -> str:
    if unit not in _PLAUSIBLE:
        return ""
    low, high, short = _PLAUSIBLE[unit]
    usual = default if isinstance(default, tuple) else (default,)
    odd = [v for v in map(_bare, text.split(",")) if v > 0 and not low <= v <= high]
    if not odd or not all(v is None or low <= v <= high for v in usual):
        return ""
    near = low <= (in_si(odd[0], short, unit) or 0.0) <= high
    meant = f"a factor 1000? {path}=" if near else f"with its unit it is accepted: {path}="
    return (
        f"{path}={text}: {odd[0]:g} {unit} is outside {low:g} to {high:g} {unit} (default "
        f"{_plain(default)}); {meant}{odd[0]:g}{short if near else unit}"
    )


def _bare(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _leaf(settings: Any, names: list[str]) -> tuple[str, Any]:
    """Unit and value at the end of a resolved way."""
    for name in names[:-1]:
        settings = _inner(settings, name)
    found = {name: (meta.get("unit", "1"), value) for name, value, _, meta in _members(settings)}
    return found[names[-1]]


def _names(settings: Any, path: str, *, whole: bool = False) -> list[str]:
    names = _resolved(settings, path.split("."), whole)
    if names is None:
        known = {p.path for p in describe(settings)}
        raise UsageError(f"unknown parameter '{path}'; {_nearest(path, known)}")
    return names


def _resolved(settings: Any, names: list[str], whole: bool = False) -> list[str] | None:
    """The way to a value, or to a `whole` part, through the parts that paths leave out; None where
    there is none."""
    if not _branches(settings):
        return None
    members = _members(settings)
    head, rest = names[0], names[1:]
    for name, value, hint, _ in members:
        if name != head:
            continue
        empty = isinstance(value, tuple) and not value
        no_parts = empty and get_origin(hint) is tuple and _is_of_parts(hint)
        if not rest and (whole or not (_branches(value) or no_parts)):
            return [head]
        inner = _resolved(value, rest, whole) if rest else None
        if inner:
            return [head, *inner]
    for name, value, _, meta in members:
        inner = _resolved(value, names, whole) if meta.get("part") else None
        if inner:
            return [name, *inner]
    return None


def take_units(settings: Any) -> None:
    """Texts with units in a new frozen dataclass become SI numbers: `Box(("4 mm", "4 mm"), ...)`.

    Of the fields that have a unit. Raises as `with_values` does.
    """
    for f in fields(settings):
        value = getattr(settings, f.name)
        texts = value if isinstance(value, tuple) else (value,)
        if "unit" in f.metadata and any(isinstance(text, str) for text in texts):
            hint = _with_more(_hints(settings.__class__)[f.name], f.metadata, value)
            object.__setattr__(settings, f.name, _in_si(hint, f.name, value, f.metadata["unit"]))


def _in_si(hint: Any, name: str, value: Any, unit: str) -> Any:
    if isinstance(value, tuple):
        inner = get_args(hint)[0] if get_origin(hint) is tuple else hint
        return tuple(_in_si(inner, name, v, unit) for v in value)
    return parsed(hint, name, value, unit) if isinstance(value, str) else value


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
    if isinstance(settings, tuple):
        return [(_key(part, i), part, type(part), {}) for i, part in enumerate(settings)]
    hints = _hints(settings.__class__)
    return [
        (f.name, getattr(settings, f.name), hints[f.name], f.metadata) for f in fields(settings)
    ]


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    """A dataclass's types by field, which take a tenth of a millisecond to find."""
    return get_type_hints(kind)


def _set(settings: Any, asked: Sequence[tuple[list[str], str, Any]]) -> Any:
    """A copy with every text parsed into the field at the end of its way."""
    below: dict[str, list[tuple[list[str], str, Any]]] = {}
    for names, path, text in asked:
        below.setdefault(names[0], []).append((names[1:], path, text))
    new = {head: _member(settings, head, inner) for head, inner in below.items()}
    if isinstance(settings, tuple):
        return tuple(new.get(_key(part, i), part) for i, part in enumerate(settings))
    if isinstance(settings, Mapping):
        return types.MappingProxyType({**settings, **new})
    return replace(settings, **new) if new else settings


def _member(settings: Any, head: str, asked: Sequence[tuple[list[str], str, Any]]) -> Any:
    names, path, text = asked[-1]
    if names:
        return _set(_inner(settings, head), asked)
    if not isinstance(text, str):
        return text
    unit, _ = _leaf(settings, [head])
    hint, meta = next((hint, meta) for n, _, hint, meta in _members(settings) if n == head)
    if text.lower() in _OPEN and meta.get("opened"):
        return None
    return parsed(_with_more(hint, meta, text), path, text, unit)


def _with_more(hint: Any, meta: Mapping[str, Any], text: Any) -> Any:
    """The type of a field with the choices of plug-ins, where the text is none of its own."""
    more = meta.get("more")
    return hint if more is None or text in get_args(hint) else Literal[(*get_args(hint), *more())]


def parsed(hint: Any, path: str, text: str, unit: str) -> Any:
    """A text as the value of a field of this type and unit. Raises as `with_values` does."""
    if get_origin(hint) in (Union, types.UnionType):
        options = [a for a in get_args(hint) if a is not type(None)]
        return None if text.lower() in _OPEN else parsed(options[0], path, text, unit)
    if get_origin(hint) is Literal:
        choices = {str(choice): choice for choice in get_args(hint)}
        if text not in choices:
            raise UsageError(f"{path}={text}: expected one of {', '.join(choices)}")
        return choices[text]
    if get_origin(hint) is tuple:
        parts = text.split(",") if text else []
        if len({bool(found[1]) for found in map(split, parts) if found and found[0]}) > 1:
            raise UsageError(
                f"{path}={text}: expected all in {unit} without unit, or each with its unit"
            )
        return tuple(parsed(get_args(hint)[0], path, part.strip(), unit) for part in parts)
    if hint is bool:
        if text.lower() not in ("true", "false"):
            raise UsageError(f"{path}={text}: expected true or false")
        return text.lower() == "true"
    if hint is int:
        try:
            return int(text)
        except ValueError:
            raise UsageError(f"{path}={text}: not a whole number") from None
    return _number(path, text, unit) if hint is float else text


def _number(path: str, text: str, unit: str) -> float:
    """In SI: a bare number, or one with a unit of the field's dimension."""
    given = split(text)
    value = in_si(given[0], given[1] or unit, unit) if given else _bare(text)
    if value is None:
        expected = "a number without unit, or %" if unit == "1" else f"{unit}, or a unit like it"
        raise UsageError(f"{path}={text}: expected {expected}")
    if given is None and math.isnan(value) and text.strip().lower() != "nan":
        raise UsageError(f"{path}={text}: not a number, in {unit} or with a unit like it")
    if not math.isfinite(value):
        raise UsageError(f"{path}={text}: not finite")
    return value


def _type_name(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return "|".join(map(str, get_args(hint)))
    if get_origin(hint) in (Union, types.UnionType):
        return " | ".join("None" if a is type(None) else _type_name(a) for a in get_args(hint))
    return hint.__name__ if isinstance(hint, type) else str(hint).replace("typing.", "")


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
