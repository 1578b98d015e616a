"""Candidates of a ladder: settings of a scheme in studies of error against time.

Every scheme declares its own in `candidates`, for a swinging body or one at rest;
`solve.schemes.candidates` has them all, by their rung.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from validate.scene.material import LawName
from validate.solve.types import SceneSolver, Scheme

Rung = Literal[
    "static superposition", "modal", "condensed", "prefactored", "regions", "explicit",
    "large strain", "external simulators",
]  # fmt: skip
RUNGS: tuple[Rung, ...] = (  # that are climbed to choose a method of ours
    "static superposition", "modal", "condensed", "prefactored", "regions", "explicit",
    "large strain",
)  # fmt: skip
SHOWN: tuple[Rung, ...] = (*RUNGS, "external simulators")


@dataclass(frozen=True)
class Rival:
    """A scheme on the ladder: `make(dt)` s. `stepped`: whether its answer depends on dt.

    It runs on `elements` (none: all) at meshes up to `finest` (0: all) and down to `shortest`
    steps (0: all): slow baselines need no fine ones. `law` is what its scenes are made of; `order`
    that of its error in dt. `lacks`: what the scene has and it leaves out; it is run as evidence
    and never chosen. `uneven`: some of its steps are much longer than the median by design, so that
    a rate is held by the slow ones alone.
    """

    name: str
    rung: Rung
    make: Callable[[float], Scheme | SceneSolver]
    stepped: bool = True
    law: LawName = "linear"
    elements: tuple[str, ...] = ()
    finest: int = 0
    shortest: float = 0.0
    order: float = 2.0
    lacks: str = ""
    uneven: bool = False

    def steps(self, element: str, level: int, steps: tuple[float, ...]) -> tuple[float, ...]:
        """Those of the ladder's steps s that it takes on that mesh."""
        if (self.elements and element not in self.elements) or 0 < self.finest < level:
            return ()
        own = steps if self.stepped else steps[-1:]
        return tuple(dt for dt in own if dt >= self.shortest * (1 - 1e-9))


@dataclass(frozen=True)
class SwingingBody:
    """A body with inertia at these `steps` s, the longest first. Baselines that solve anew at every
    step run on meshes up to `small`, dense ones up to `medium`; `law` is that at large strain."""

    steps: tuple[float, ...]
    small: int
    medium: int
    law: LawName = "neo_hooke"


@dataclass(frozen=True)
class StillBody:
    """A body in statics, with fluid in `cavities` or without. A `table` of load runs on meshes up
    to `medium`; Newton at every step on `coarse` ones, in the largest `increment` s only."""

    cavities: bool
    increment: float
    table: float
    medium: int
    coarse: int
    law: LawName = "neo_hooke"


Asked = SwingingBody | StillBody
