"""External simulators as methods of an experiment, declared or added."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.solve.external.program import words
from validate.solve.external.scheme import ExternalSimulator

_SUFFIX = re.compile("_(simulator|guest)$")  # of a script; the second is a former one
_LEVELS = 20  # of statics with one input, where the experiment does not say


def external_methods(methods: dict[str, Method]) -> dict[str, Method]:
    """Return the methods that are external simulators."""
    return {name: m for name, m in methods.items() if isinstance(m.settings, ExternalSimulator)}


def added_simulators(methods: Mapping[str, Method], commands: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the methods that `with_simulators` adds for these commands."""
    labels = [_label(command) for command in commands]
    return tuple(name for name, m in methods.items() if m.label in labels)


def _label(command: str) -> str:
    return f"external: {command}"


def with_simulators(experiment: Experiment, commands: Sequence[str]) -> Experiment:
    """Return the experiment with one more method for each command.

    A method has the settings of the first external simulator that the experiment declares, else
    those of its accepted method. Raises `UsageError` for a command whose program is missing.
    """
    methods = dict(experiment.methods)
    accepted = next(iter(experiment.accepted), next(iter(methods), ""))
    for command in commands:
        words(command)
        # A free name after the script: `felupe` for `python felupe_simulator.py`
        stems = [Path(word).stem for word in shlex.split(command) if not word.startswith("-")]
        last = next((s for s in stems[1:] if s), stems[0])
        name = re.sub(r"\W+", "_", _SUFFIX.sub("", last)) or "external"
        while name in methods:
            name += "_2"
        methods[name] = _as(methods, accepted, command)
    return replace(experiment, methods=methods) if commands else experiment


def _as(methods: dict[str, Method], accepted: str, command: str) -> Method:
    declared = next(iter(external_methods(methods).values()), None)
    label = _label(command)
    if declared is not None:
        return replace(declared, label=label, settings=replace(declared.settings, command=command))
    like = methods[accepted]
    handles = getattr(like.settings, "handles", None)
    moving = handles is not None and handles.inertia
    settings = ExternalSimulator(command, inertia=moving, levels=0 if moving else _LEVELS)
    return replace(like, label=label, settings=settings, markers=(), steps=None, chosen="")
