"""Plan of a coverage study: readings of a perfect model and of wrong ones, then draws."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtri

from validate.arrays import Floats
from validate.compare.effects import REACH, joint_draws
from validate.engine.store import key_of
from validate.errors import ComparisonError
from validate.parameters import Parameter, describe, with_values
from validate.pipeline.experiment.experiment import Experiment, Input
from validate.pipeline.run.job import Job

DRAWS, QUICK_DRAWS = 200, 40
BLOCK = 10  # draws in one cell
CHECKS, FEW_CHECKS = 6, 2  # full solutions that a linear response is held against
BUDGET_S = 30.0  # s of solving, beyond which inputs are taken to act linearly
HERE_S = 8.0  # s of work for which no workers are started
NUMBERS = 2_000_000  # that all readings of full solutions may hold
WRONG = (0.05, 0.10, 0.20)  # by which a true parameter is larger than the judged one
WRONG_DRAWS = 100  # of every wrong model
FILTER_DRAWS = 20  # the same of a filter, which is run anew on each
# Parameters that describe the twin, the ranges, the recording, what is judged of it, or the mesh.
_OTHERS = (
    "twin.", "ranges.", "registration.", "mesh.", "clock.", "load.", "loading.", "loads", "image.",
    "voxel", "dwell.", "tip.sd", "box.", "bin", "fit_to", "predict_to", "limit_",
)  # fmt: skip
_MODULI, _LENGTHS, _FRICTIONS = ("Pa",), ("m",), ("N/m3", "N/m^3")


@dataclass(frozen=True)
class World:
    """What is true: inputs `moves` (name, z) standard uncertainties off, and a parameter `wrong`
    (path, relative)."""

    moves: tuple[tuple[str, float], ...] = ()
    wrong: tuple[str, float] | None = None

    @property
    def label(self) -> str:
        if self.wrong:
            return f"{self.wrong[0]} {100 * self.wrong[1]:+g} %"
        if len(self.moves) > 1:
            return f"{len(self.moves)} inputs drawn"
        return ", ".join(f"{name} {z:+.3g} u" for name, z in self.moves) or "as judged"


@dataclass(frozen=True)
class ReadingCell:
    """Cell of the readings of exact sensors of `method` in a world."""

    method: str
    world: World
    key: str = ""
    timed: bool = False

    @property
    def label(self) -> str:
        return f"{self.method}, {self.world.label}"


@dataclass(frozen=True)
class TermsCell:
    """Cell of the terms of every check of a method."""

    method: str
    key: str = ""
    timed: bool = False

    @property
    def label(self) -> str:
        return f"u_num and u_input of {self.method}"


@dataclass(frozen=True)
class DrawCell:
    """`count` draws from `first` on, of a method's recordings in all worlds."""

    method: str
    first: int
    count: int
    key: str = ""
    timed: bool = False

    @property
    def label(self) -> str:
        return f"{self.method}, draws {self.first + 1} to {self.first + self.count}"


def true_method(experiment: Experiment, name: str) -> str:
    """Return the method whose runs are the truth: the judged one itself, for a filter the reference
    or the first accepted one that sees no marker. Raises `ComparisonError` where there is none."""
    methods = experiment.methods
    wanted = (name, experiment.reference, *experiment.accepted, *methods)
    for other in wanted:
        if other in methods and not methods[other].markers and methods[other].steps is None:
            return other
    raise ComparisonError(
        f"{experiment.name}: every method uses markers, so none can be the "
        "truth; declare one without markers"
    )


def reading_cells(job: Job, method: str, worlds: Sequence[World]) -> tuple[ReadingCell, ...]:
    bare = (ReadingCell(method, w) for w in worlds)
    return tuple(replace(c, key=key_of(job, "reading", c)) for c in bare)


def steps_of(inputs: Sequence[str]) -> tuple[World, ...]:
    """One standard uncertainty to both sides of each input."""
    return tuple(World(((name, z),)) for name in inputs for z in (1.0, -1.0))


def wrong_paths(parameters: Any) -> Iterator[Parameter]:
    """Moduli, lengths and frictions of the body that are positive numbers."""
    for p in describe(parameters):
        friction = "friction" in p.path.rpartition(".")[2] or p.unit in _FRICTIONS
        if p.path.startswith(_OTHERS) or not (friction or p.unit in _MODULI + _LENGTHS):
            continue
        per_metre = p.path == "thickness" and p.default == 1.0  # or of a 3-D body
        if isinstance(p.default, float) and p.default > 0 and not per_metre:
            yield p


def inputs_of(experiment: Experiment) -> dict[str, Input]:
    """Uncertain inputs by name; another of the same name (an axis of a covariance) is numbered."""
    declared = experiment.uncertainty.inputs if experiment.uncertainty else ()
    return dict(zip(numbered([i.name for i in declared]), declared, strict=True))


def draws_of(experiment: Experiment, draws: int, seed: int) -> Floats:
    """(draws, inputs) standard uncertainties: uniform ranges, a normal law of what was identified
    from noise."""
    declared = inputs_of(experiment).values()
    if not declared:
        return np.zeros((draws, 0))
    z = joint_draws(draws, len(declared), seed)
    return np.where([i.identified for i in declared], ndtri((1 + z / REACH) / 2), z)


def numbered(names: Sequence[str]) -> list[str]:
    """Return the names, made distinct."""
    return [
        name if name not in names[:k] else f"{name} ({1 + names[:k].count(name)})"
        for k, name in enumerate(names)
    ]


def in_world(experiment: Experiment, parameters: Any, world: World) -> Any:
    """Return the parameters as they are in a world."""
    by_name = inputs_of(experiment)
    for name, z in world.moves:
        parameters = by_name[name].move(parameters, z)
    if world.wrong is None:
        return parameters
    path, by = world.wrong
    values: Mapping[str, Any] = {p.path: p.default for p in describe(parameters)}
    return with_values(parameters, {path: repr((1 + by) * values[path])})
