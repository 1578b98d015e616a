"""Plug-ins: entry points of other packages, and the registry of each kind of part.

A package declares `[project.entry-points."validate.readers"] gauge = "my_package:GAUGE"`. The
package's own parts, those of plug-ins and those that a script adds are in one `Registry` a kind.
Entry points are looked up where a registry is first gone through, not at start-up. A plug-in that
cannot be used is left out with one warning.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache, cached_property
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import Path
from typing import Any, TypeVar

from validate.errors import UsageError, one_line

PREFIX = "validate."
#: Kinds of parts that plug-ins add: `validate.<kind>` is the group of the entry points.
KINDS = ("readers", "schemes", "filters", "laws", "sensors", "views", "simulators",
         "experiments")  # fmt: skip

_T = TypeVar("_T")
_R = TypeVar("_R")
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PlugIn:
    """One entry point: kind of part, its name, where it is (`module:attribute`), and the package
    with its version."""

    kind: str
    name: str
    value: str
    package: str
    version: str

    def __str__(self) -> str:
        return f"plug-in '{self.name}' of {self.package} {self.version} ({PREFIX}{self.kind})"


@dataclass(frozen=True)
class _Entry:
    """What became of an entry point: its part, or why there is none."""

    plug_in: PlugIn
    part: Any = None
    why: str = ""


@dataclass(frozen=True, eq=False)
class Registry(Sequence[_T]):
    """The parts of one `kind`: the package's `own`, those of plug-ins, those that a script adds.

    `faults` says what is wrong with an object as such a part ("" for nothing), `name_of` what a
    user calls the part; names are unique. Of two registries of one kind each takes what `belongs`.
    """

    kind: str
    own: tuple[_T, ...]
    name_of: Callable[[_T], str]
    faults: Callable[[Any], str]
    belongs: Callable[[Any], bool] = lambda part: True
    _added: list[_T] = field(default_factory=list)

    def __iter__(self) -> Iterator[_T]:
        yield from self.own
        yield from self.further

    def __len__(self) -> int:
        return len(self.own) + len(self.further)

    def __getitem__(self, index: Any) -> Any:
        return (*self.own, *self.further)[index]

    @property
    def further(self) -> tuple[_T, ...]:
        """Parts that are not the package's own."""
        return (*(one.part for one in self._loaded if not one.why), *self._added)

    @property
    def states(self) -> tuple[tuple[PlugIn, str], ...]:
        """Every plug-in of this kind and why it is left out; "" for one that is used."""
        return tuple((one.plug_in, one.why) for one in self._loaded)

    def add(self, part: _T) -> _T:
        """Add a part for this process and its workers, from a script or notebook, and return it.

        It replaces one that was added by the same name, so that a cell can be run again. Raises
        `UsageError` for an object of another kind and a name that is taken.
        """
        if why := self._refused(part, [self.name_of(p) for p in self if p not in self._added]):
            raise UsageError(f"{self.kind}: {why}")
        name = self.name_of(part)
        self._added[:] = [*(p for p in self._added if self.name_of(p) != name), part]
        return part

    @property
    def added(self) -> tuple[_T, ...]:
        """What a script added."""
        return tuple(self._added)

    def origin(self, part: Any) -> PlugIn | None:
        """The plug-in that a part is of; None for the package's own and those of a script."""
        if part in self.own:
            return None
        return next((one.plug_in for one in self._loaded if one.part is part), None)

    def answer(self, part: _T, question: Callable[[_T], _R], otherwise: _R) -> _R:
        """What a part answers to a question that every part of its kind is asked.

        One that is not the package's own and raises gets `otherwise`, with a warning.
        """
        if part in self.own:
            return question(part)
        try:
            return question(part)
        except Exception as error:  # code of others: whatever it does
            _log.warning(
                "%s is not asked further: %s: %s",
                self.whose(part), type(error).__name__, one_line(str(error)),
            )  # fmt: skip
            return otherwise

    def whose(self, part: _T) -> str:
        """A part that is not the package's own, in words: its plug-in, or its name."""
        return str(self.origin(part) or f"'{self.name_of(part)}' ({self.kind})")

    @cached_property
    def _loaded(self) -> tuple[_Entry, ...]:
        """The entry points of this kind, loaded; a warning for each that is left out."""
        taken = [self.name_of(part) for part in self.own]
        done = []
        for plug_in, point in _installed():
            if plug_in.kind != self.kind:
                continue
            one = self._load(plug_in, point, taken)
            if one.why:
                left_out(plug_in, one.why)
            elif not self.belongs(one.part):
                continue
            else:
                taken.append(self.name_of(one.part))
            done.append(one)
        return tuple(done)

    def _load(self, plug_in: PlugIn, point: EntryPoint, taken: list[str]) -> _Entry:
        try:
            part = point.load()
            why = self._refused(part, taken) if self.belongs(part) else ""
        except (Exception, SystemExit) as error:  # code of others: whatever it does
            return _Entry(plug_in, why=f"{type(error).__name__}: {error}")
        return _Entry(plug_in, part, why)

    def _refused(self, part: Any, taken: list[str]) -> str:
        if why := self.faults(part):
            return why
        name = self.name_of(part)
        return f"the name '{name}' is taken; choose another one" if name in taken else ""


@cache
def left_out(plug_in: PlugIn, why: str) -> None:
    """Warn once that a plug-in is not used."""
    _log.warning(
        "%s is left out: %s; update or uninstall %s",
        plug_in, one_line(why).rstrip("."), plug_in.package,
    )  # fmt: skip


def plug_ins(kind: str = "") -> tuple[PlugIn, ...]:
    """The installed plug-ins of one kind, or all of them, by kind and name; none is loaded."""
    return tuple(plug_in for plug_in, _ in _installed() if kind in ("", plug_in.kind))


@cache
def _installed() -> tuple[tuple[PlugIn, EntryPoint], ...]:
    """Entry points of `validate.<kind>`; of two packages of one name the first on Python's path.

    The current folder, which `python -m` puts on the path, holds data: nothing in it is a plug-in.
    """
    here = Path.cwd()
    found: dict[tuple[str, str, str], tuple[PlugIn, EntryPoint]] = {}
    for dist in distributions():
        for point in _declared_by(dist):
            plug_in = PlugIn(
                point.group.removeprefix(PREFIX), point.name, point.value, *_package(dist)
            )
            if Path(str(dist.locate_file(""))).resolve() == here:
                continue
            if plug_in.kind in KINDS:
                found.setdefault((plug_in.kind, plug_in.name, plug_in.package), (plug_in, point))
            else:
                near = get_close_matches(plug_in.kind, KINDS, n=1)
                mean = f"did you mean {PREFIX}{near[0]}? " if near else ""
                known = f"{mean}known: {', '.join(KINDS)}"
                left_out(plug_in, f"no group '{PREFIX}{plug_in.kind}' of entry points; {known}")
    return tuple(found[key] for key in sorted(found))


def _declared_by(dist: Distribution) -> list[EntryPoint]:
    """The entry points of a package for this one; none where its file of them is damaged."""
    try:
        return [point for point in dist.entry_points if point.group.startswith(PREFIX)]
    except Exception as error:  # a file that anybody may have written
        _log.warning(
            "entry points of an installed package cannot be read: %s", one_line(f"{error}")
        )
        return []


def _package(dist: Distribution) -> tuple[str, str]:
    """Name and version of a package."""
    try:
        return str(dist.name), str(dist.version)
    except Exception:  # its metadata are missing
        return "an unknown package", "?"


def kind_fault(part: Any, kind: type) -> str:
    """Return which kind of object was expected, and found; "" for one of it."""
    return "" if isinstance(part, kind) else f"expected a {kind.__name__}, found {_found(part)}"


def _found(part: Any) -> str:
    """What an object is, without its own words."""
    if isinstance(part, type):
        return f"the class {part.__name__}"
    return f"an object of the class {type(part).__name__}"


def settings_faults(part: Any, *methods: str) -> str:
    """What keeps a class from being settings that experiments declare; "" for nothing."""
    if not isinstance(part, type) or not hasattr(part, "__dataclass_fields__"):
        return f"expected a frozen dataclass, found {_found(part)}"
    missing = [name for name in methods if not hasattr(part, name)]
    return f"{part.__name__} has no {', '.join(missing)}" if missing else ""
