"""Settings of a twin in its recording; the truth follows the recording, not later settings.

A user who changes a material asks what a wrong model does, so the truth must stay; a user who
changes the twin asks for another recording, so it is made anew in memory.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from validate.compare.result import Kind
from validate.errors import UsageError
from validate.parameters import describe, with_values
from validate.recording.types import MADE_WITH, Recording


def stamped(recording: Recording, parameters: Any) -> Recording:
    """Return the recording with a record of every parameter but files."""
    kept = MappingProxyType({**recording.metadata, MADE_WITH: _texts(parameters)})
    return replace(recording, metadata=kept)


def synthetic(recording: Recording) -> bool:
    """Return whether a recording says of itself that a model made it."""
    return MADE_WITH in recording.metadata or _told(recording) == "twin"


def computed(recording: Recording) -> bool:
    """Return whether a recording says of itself that a code of others computed it."""
    return _told(recording) == "reference"


def kind_of_recordings(
    recordings: Sequence[Recording], twin: Kind = "twin", *, remade: bool = False
) -> Kind:
    """What recordings are: measured, computed by third-party code, or what their `twin` is."""
    if recordings and all(computed(r) for r in recordings):
        return "reference"
    if not remade and not any(synthetic(r) for r in recordings):
        return "measured"
    return twin


def _told(recording: Recording) -> str:
    return dict(recording.metadata.get("provenance", {})).get("kind", "")


def made_by(
    recording: Recording,
    parameters: Any,
    declared: Any,
    remake: tuple[str, ...],
    record: Callable[[Any], Recording],
) -> tuple[Recording, Any, tuple[str, ...]]:
    """Return the recording to use, the parameters that made it, and what is to be said of it.

    `remake` are prefixes of the twin's own parameters: where the user's differ from the recording's
    it is made anew with them. Raises `UsageError` where they differ from the `declared` ones and
    the recording does not say which it was made with: they would be ignored.
    """
    made = dict(recording.made_with)
    mine = _texts(parameters)
    known = {path: text for path, text in made.items() if path in mine}
    require_known(recording, parameters, declared, remake, tuple(known))
    true = with_values(parameters, known)
    changed = {
        path: mine[path]
        for path, text in known.items()
        if path.startswith(remake) and mine[path] != text
    }
    if not changed:
        return recording, true, ()
    true = with_values(true, changed)
    said = ", ".join(f"{path} = {text}" for path, text in changed.items())
    note = (
        f"The twin was simulated again in memory with {said}; the shipped recording was not used."
    )
    return record(true), true, (note,)


def require_known(
    recording: Recording,
    parameters: Any,
    declared: Any,
    remake: tuple[str, ...],
    known: tuple[str, ...] = (),
) -> None:
    """Raise `UsageError` for a twin's parameter that differs from the `declared` one and is not
    `known` of the recording."""
    mine, own = _texts(parameters), _texts(declared)
    lost = [p for p in mine if p.startswith(remake) and p not in known and mine[p] != own.get(p)]
    if lost:
        raise UsageError(
            f"{recording.name}: --set {lost[0]}={mine[lost[0]]} would have no effect: the "
            f"recording does not contain its parameters; leave it out, or make one with `validate "
            f"record`"
        )


def _texts(parameters: Any) -> dict[str, str]:
    """Values by path, as `--set` takes them; files are left out."""
    found = {p.path: p.default for p in describe(parameters)}
    return {path: _text(v) for path, v in found.items() if not (isinstance(v, str) and "/" in v)}


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ",".join(_text(v) for v in value)
    if value is None or isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else repr(value)
