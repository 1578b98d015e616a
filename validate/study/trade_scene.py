"""What a trade is measured on: a body on a ladder of meshes, how it is loaded, what solves it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.scene import LawName, Scene
from validate.solve.types import Scheme

Rung = Literal[
    "static superposition", "modal", "condensed", "prefactored", "explicit", "large strain"
]
RUNGS: tuple[Rung, ...] = (
    "static superposition", "modal", "condensed", "prefactored", "explicit", "large strain",
)  # fmt: skip


@dataclass(frozen=True)
class Solver:
    """A scheme of the trade: `make(dt)` s. `stepped`: whether its answer depends on dt.

    It runs on `elements` (none: all) at meshes up to `finest` (0: all) and down to `shortest`
    steps (0: all): slow baselines need no fine ones. `law` is what its scenes are made of; `order`
    that of its error in dt. `lacks`: what the scene has and it leaves out; it is run as evidence
    and never chosen.
    """

    name: str
    rung: Rung
    make: Callable[[float], Scheme]
    stepped: bool = True
    law: LawName = "linear"
    elements: tuple[str, ...] = ()
    finest: int = 0
    shortest: float = 0.0
    order: float = 2.0
    lacks: str = ""

    def takes(self, element: str, level: int, dt: float) -> bool:
        known = not self.elements or element in self.elements
        return known and not 0 < self.finest < level and dt >= self.shortest * (1 - 1e-9)


@dataclass(frozen=True)
class LawPair:
    """Two solvers, of the declared law and at large strain, alike in all else, on one coarse mesh.

    The difference of their answers is what the declared law costs.
    """

    element: str
    level: int
    dt: float
    declared: Callable[[float], Scheme]
    large: Callable[[float], Scheme]


@dataclass(frozen=True)
class TradeScene:
    """A body and its loading, made on any mesh of the ladder by any element.

    `build(element, level, law)`; `size(level)` m is that of a cell; `meshes` the levels by element,
    rising, `orders` their theoretical orders of convergence in displacements. `inputs(t)` (nt, k)
    at the steps' ends t (nt,) s; every dt of `steps` divides the time between `frames` (no,) s, at
    which displacements at `points` (p, d) m are compared. `best(dt)` is the solver without solver
    error, taken on `reference` (element, level) for the reference and on every mesh to split the
    error. `rise_s`: time in which the load comes on; `noise` m of a recording and where it is
    declared. In a static scene a step is a load increment.
    """

    name: str
    title: str
    source: str
    build: Callable[[str, int, LawName], Scene]
    size: Callable[[int], float]
    meshes: Mapping[str, tuple[int, ...]]
    orders: Mapping[str, float]
    steps: tuple[float, ...]
    inputs: Callable[[Floats], Floats]
    frames: Floats
    points: Floats
    reference: tuple[str, int]
    best: Callable[[float], Scheme]
    solvers: tuple[Solver, ...]
    pair: LawPair
    dynamic: bool
    rise_s: float
    noise: tuple[float, str] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "meshes", MappingProxyType(dict(self.meshes)))
        object.__setattr__(self, "orders", MappingProxyType(dict(self.orders)))
        for dt in self.steps:
            ends = self.frames / dt
            if np.abs(ends - ends.round()).max() > 1e-6:
                raise SceneError(f"{self.name}: steps of {dt:g} s do not land on the frames")

    @property
    def duration(self) -> float:
        return float(self.frames[-1])

    def times(self, dt: float) -> Floats:
        """Ends (nt,) s of all steps of dt s."""
        return dt * np.arange(1, round(self.duration / dt) + 1, dtype=np.float64)
