"""Kinds of experiments: the settings of a kind complete its declaration."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from validate.errors import UsageError
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree

#: What a declaration of such a kind holds.
DECLARED = ("name", "title", "source", "parameters", "methods", "accepted", "accept", "kind")


@cache
def kinds() -> Mapping[type, Callable[..., Experiment]]:
    """What makes an experiment, by the class of its settings; they read all formats, so that they
    are imported where one is asked for."""
    from validate.pipeline.bodies.choices import MeasuredBody
    from validate.pipeline.bodies.measured import measured_body
    from validate.pipeline.plates.choices import Compression
    from validate.pipeline.plates.compression import compression
    from validate.pipeline.plates.inclusion import InclusionTest, inclusion_test

    return MappingProxyType({
        MeasuredBody: measured_body,
        Compression: compression,
        InclusionTest: lambda *, folder, **given: inclusion_test(**given),
    })  # fmt: skip


def of_a_kind(experiment: Experiment) -> bool:
    """Return whether its scene and settings say all that is declared of it."""
    return _kind(experiment) in kinds()


def _kind(experiment: Experiment) -> type:
    """The class that says what the experiment measures."""
    return type(experiment.parameters.settings)


def completed(experiment: Experiment, path: Path) -> Experiment:
    """Return the experiment declared in that file, with what its kind adds."""
    if not isinstance(experiment.parameters, Tree):
        raise UsageError(
            f"{path}: parameters of type {type(experiment.parameters).__name__}; declare a scene: "
            "Experiment(scene=Scene(...), settings=...)"
        )
    if of_a_kind(experiment) and not experiment.complete:
        given: dict[str, Any] = {name: getattr(experiment, name) for name in DECLARED}
        make = kinds()[_kind(experiment)]
        experiment = make(**given, folder=path.resolve().parent)
    return experiment.at(path)
