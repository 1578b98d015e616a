"""What a user may change of an experiment, and where the experiment lies."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.errors import ComparisonError, UsageError
from validate.parameters import nearest_names, with_values
from validate.replay.experiment import Experiment
from validate.replay.method import Method

Report = Callable[[int, int, str], None]  # done, total, what comes next


@dataclass(frozen=True)
class Options:
    """What the user changed: values by path, methods to run (none: all), quick."""

    values: Mapping[str, str]
    methods: tuple[str, ...] = ()
    quick: bool = False


def configure(experiment: Experiment, options: Options) -> tuple[Any, dict[str, Method]]:
    """Parameters and chosen methods with the user's values; `UsageError` names the nearest."""
    known = set(experiment.methods)
    for name in options.methods:
        if name not in known:
            raise UsageError(f"unknown method '{name}'; {nearest_names(name, known)}")
    parameters = experiment.quick(experiment.parameters) if options.quick else experiment.parameters
    mine = {k: v for k, v in options.values.items() if not k.startswith("methods.")}
    methods = all_methods(experiment, options)
    chosen = options.methods or tuple(methods)
    return with_values(parameters, mine), {name: methods[name] for name in chosen}


def all_methods(experiment: Experiment, options: Options) -> dict[str, Method]:
    """Every method with the user's values, whether it is run or not: what identifies follows."""
    theirs = {k[8:]: v for k, v in options.values.items() if k.startswith("methods.")}
    return dict(with_values(experiment.methods, theirs))


def folder_of(experiment: Experiment) -> Path:
    """The folder of the experiment's file; `ComparisonError` when it was not loaded from one."""
    if experiment.path is None:
        raise ComparisonError(f"experiment '{experiment.name}' was not loaded from a file")
    return experiment.path.parent
