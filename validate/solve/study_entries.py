"""Entries of a scheme in studies: step maps of stability, candidates of ladders.

A mode is q'' + c q' + w^2 q = 0. Maps are taken in units of the step (w h, c h), which keeps their
entries of order 1 whatever the step. Linear solvers (direct, CG, Gauss-Seidel) share one map. Every
scheme declares its own in `steppings`; `solve.schemes.steppings` has them all.

Candidates of a ladder: settings of a scheme in studies of error against time. Every scheme declares
its own in `candidates`, for a swinging body or one at rest; `SCHEMES.candidates` has them
all, by their rung.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.fem.system import DampingTerms, MassName, System
from validate.scene.material import LawName
from validate.scene.mesh import Kind
from validate.solve.dynamic.newmark_rule import Rule, RuleName
from validate.solve.types import SceneSolver, Scheme

# --- Maps of (q, v, a) of one mode over a step, of implicit and explicit rules, and their radii.

UpdateName = Literal["printed", "lagged"]


def explicit_maps(h: float, c: Floats, k: Floats, update: UpdateName) -> Floats:
    """As `Rule.maps`, for the explicit schemes."""
    one, zero = np.ones_like(c), np.zeros_like(c)
    half = np.stack([zero, one, h / 2 * one], axis=-1)
    q = np.stack([one, zero, zero], axis=-1) + h * half
    J = one if update == "lagged" else 1 + h / 2 * c
    a = -(k[:, None] * q + c[:, None] * half) / J[:, None]
    return np.stack([q, half + h / 2 * a, a], axis=1)


def spectral_radii(maps: Floats) -> Floats:
    """Largest magnitude of the eigenvalues of every map (r, m, m)."""
    return np.asarray(np.abs(np.linalg.eigvals(maps)).max(axis=-1))


# -------------------------------------------------------------------------------------------------

Radii = Callable[["Rates"], Floats]
LOOSE = 1e-6  # rounding of double eigenvalues, squared and some more
TETS: tuple[Kind, ...] = ("tet4",)


@dataclass(frozen=True)
class Rates:
    """All modes in units of a step: `x` = w h (r,), `alpha` h, and `beta`/h of the damping."""

    x: Floats
    alpha: float
    beta: float

    def c(self, terms: DampingTerms) -> Floats:
        """Dampings c h (r,)."""
        full = terms == "full"
        return self.alpha + (self.beta * self.x**2 if full else np.zeros_like(self.x))


@dataclass(frozen=True)
class Stepping:
    """A scheme: its `maps` (r, m, m) per mode with the masses `mass`, and its predicted `limit` s.

    Without `limit` it is predicted to be stable at every step. `kinds`: the meshes it is for (none:
    all). `conserves`: undamped it keeps an energy exactly, that of half steps where it is explicit.
    `rounding`: how far above 1 a radius may lie by rounding alone; defective double
    eigenvalues, as undamped implicit rules have at large steps, cost half of the digits. `order`
    is that of its error in the step; 0: it has none.
    """

    name: str
    words: str
    mass: MassName
    maps: Radii
    limit: Callable[[System], float] | None = None
    kinds: tuple[Kind, ...] = ()
    rounding: float = 1e-9
    explicit: bool = False
    conserves: bool = False
    order: float = 2.0

    def radius(self, h: float, omegas: Floats, alpha: float, beta: float) -> float:
        """Spectral radius of a step of h s over all modes (r,) 1/s."""
        return float(spectral_radii(self.maps(Rates(omegas * h, alpha * h, beta / h))).max())


def implicit_maps(rule: RuleName) -> Radii:
    """Return the step map of a rule of Newmark's family."""
    unit = Rule.of(rule, 1.0)
    return lambda r: unit.maps(r.c("full"), r.x**2)


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


StudyBody = SwingingBody | StillBody
