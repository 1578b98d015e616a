"""What the library adds to a declaration: an experiment of one of its kinds is complete by its
parameters alone."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from validate.replay.experiment import Experiment
from validate.replay.tree import Tree

#: What a declaration of such a kind holds.
DECLARED = ("name", "title", "source", "parameters", "methods", "accepted", "accept", "kind")


@cache
def kinds() -> Mapping[type, Callable[..., Experiment]]:
    """What makes an experiment, by the class of its settings (or of parameters without a scene);
    they read all formats, so that they are imported where one is asked for."""
    from validate.replay.compression import compression
    from validate.replay.compression_cards import Compression
    from validate.replay.inclusion import InclusionTest, inclusion_test
    from validate.replay.measured_body import measured_body
    from validate.replay.measured_cards import MeasuredBody

    return MappingProxyType({
        MeasuredBody: measured_body,
        Compression: compression,
        InclusionTest: _without_folder(inclusion_test),
    })  # fmt: skip


def _without_folder(make: Callable[..., Experiment]) -> Callable[..., Experiment]:
    return lambda *, folder, **given: make(**given)


def kind_of(experiment: Experiment) -> type:
    """The class that says what the experiment measures: of its settings beside a scene."""
    parameters = experiment.parameters
    return type(parameters.settings if isinstance(parameters, Tree) else parameters)


def of_a_kind(experiment: Experiment) -> bool:
    """Whether its scene and settings say all that is declared of it."""
    return kind_of(experiment) in kinds()


def completed(experiment: Experiment, path: Path) -> Experiment:
    """The experiment declared in that file, with what its kind adds."""
    if of_a_kind(experiment) and not experiment.complete:
        given: dict[str, Any] = {name: getattr(experiment, name) for name in DECLARED}
        make = kinds()[kind_of(experiment)]
        experiment = make(**given, folder=path.resolve().parent)
    return experiment.at(path)
