"""Programs of others among the methods of any experiment: those it declares, those a user adds."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.solve.external.program import words
from validate.solve.external.scheme import Guest

_LEVELS = 20  # of statics with one input, where the experiment does not say


def guests_of(methods: dict[str, Method]) -> dict[str, Method]:
    """Those that are programs of others."""
    return {name: m for name, m in methods.items() if isinstance(m.settings, Guest)}


def added_guests(methods: Mapping[str, Method], commands: Sequence[str]) -> tuple[str, ...]:
    """Names of those that `with_guests` made of these commands; declared ones are none of them."""
    labels = [_label(command) for command in commands]
    return tuple(name for name, m in methods.items() if m.label in labels)


def _label(command: str) -> str:
    return f"guest: {command}"


def with_guests(experiment: Experiment, commands: Sequence[str]) -> Experiment:
    """The experiment with a method a command beside its own: run as the first guest that it
    declares, else as what it accepts is.

    Raises `UsageError` for a command that is no program's.
    """
    methods = dict(experiment.methods)
    accepted = next(iter(experiment.accepted), next(iter(methods), ""))
    for command in commands:
        words(command)
        methods[_named(command, methods)] = _as(methods, accepted, command)
    return replace(experiment, methods=methods) if commands else experiment


def _as(methods: dict[str, Method], accepted: str, command: str) -> Method:
    declared = next(iter(guests_of(methods).values()), None)
    label = _label(command)
    if declared is not None:
        return replace(declared, label=label, settings=replace(declared.settings, command=command))
    like = methods[accepted]
    handles = getattr(like.settings, "handles", None)
    moving = handles is not None and handles.inertia
    settings = Guest(command, inertia=moving, levels=0 if moving else _LEVELS)
    return replace(like, label=label, settings=settings, markers=(), steps=None, chosen="")


def _named(command: str, taken: dict[str, Method]) -> str:
    """After its script: `felupe` of `python benchmarks/guests/felupe_guest.py`."""
    stems = [Path(word).stem for word in shlex.split(command) if not word.startswith("-")]
    last = next((s for s in stems[1:] if s), stems[0])
    name = re.sub(r"\W+", "_", last.removesuffix("_guest")) or "guest"
    while name in taken:
        name += "_2"
    return name
