"""What an experiment declares. One experiment is one Python file in `experiments/`.

An experiment file is code: run only your own. A recording is data: nothing in it is executed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from validate.compare.effects import Sensor
from validate.compare.residual import Residual
from validate.compare.score import Score
from validate.compare.verdict import Accept, Published
from validate.recording.types import Recording
from validate.register.observe import Registered
from validate.scene.scene import Scene
from validate.solve.types import Run, Scheme

Change = Callable[[Any], Any]
Progress = Callable[[str], None]


def unchanged(parameters: Any) -> Any:
    return parameters


@dataclass(frozen=True)
class Variant:
    """A method with changed parameters."""

    method: str
    change: Change = unchanged


@dataclass(frozen=True)
class Input:
    """An uncertain input: `change` moves it, times `scale` that is one standard uncertainty."""

    name: str
    change: Change
    scale: Callable[[Any], float]
    doc: str


@dataclass(frozen=True)
class EffectSpec:
    """A row of the error budget: from one variant to another.

    `itself` names the declared input that this effect is: its range is then no excuse for not
    seeing it.
    """

    name: str
    doc: str
    one: Variant
    other: Variant
    itself: str = ""


@dataclass(frozen=True)
class Uncertainty:
    """How u_num and u_input are found: a finer mesh, the inputs, and a cheap method for them.

    `refinement` is r^p - 1 from the parameters: ratio of cell sizes r, order of convergence p.
    `stand_in` names, for a method too slow on the finer mesh, a faster one of the same element
    whose change between the meshes is taken for its own.
    """

    finer: Change
    refinement: Callable[[Any], float]
    inputs: tuple[Input, ...]
    surrogate: str
    stand_in: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Identified:
    """What was identified from the recordings: parameters to use, scores, and sentences to show.

    `headline` opens the verdict.
    """

    parameters: Any
    scores: tuple[Score, ...]
    notes: tuple[str, ...]
    headline: str = ""


@dataclass(frozen=True)
class Experiment:
    """One experiment; see the fields of each part for units.

    `methods` maps a name to its frozen settings, each with `label`. `load` gets the parameters and
    the experiment's folder. `published` turns scores by (method, name) into printed figures beside
    ours. `band` is the relative standard uncertainty of the force that the modulus brings.
    `twin_notice` is printed on the report of a twin.
    """

    name: str
    title: str
    source: str
    parameters: Any
    methods: Mapping[str, Any]
    accepted: tuple[str, ...]
    accept: tuple[Accept, ...]
    load: Callable[[Any, Path], tuple[Recording, ...]]
    build: Callable[[Recording, Any, Any], Scene]
    scheme: Callable[[Any], Scheme]
    place: Callable[[Recording, Any, Scene], Registered]
    residuals: Callable[[Registered, Run], tuple[Residual, ...]]
    uncertainty: Uncertainty
    effects: tuple[EffectSpec, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    published: Callable[[Mapping[str, Mapping[str, float]]], tuple[Published, ...]] | None = None
    identify: Callable[[Sequence[Recording], Any], Identified] | None = None
    record: Callable[[Any, Progress], Recording] | None = None
    band: Callable[[Any], float] | None = None
    quick: Change = unchanged
    same_model: bool = False
    seed: int | None = None
    twin_notice: str = ""
    path: Path | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "methods", MappingProxyType(dict(self.methods)))
