"""States, outcomes and runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, Protocol

import numpy as np

from validate.arrays import Floats, Ints, checked
from validate.fem.system import System
from validate.scene.scene import Scene

Ending = Literal["finished", "diverged", "not_converged", "refused", "invalid"]


@dataclass(frozen=True)
class Outcome:
    """How a run ended: at which step and why."""

    state: Ending
    step: int
    why: str = ""


@dataclass(frozen=True)
class State:
    """One static step: drives (k,) m, pressures (c,) Pa, updates it took, surface (s, d) m.

    `surface` is the displacement of the cavity and plate nodes, what a haptic tick needs.
    `failure` is empty or the ending and its reason. Schemes whose fields are not sums of fixed
    columns keep the displacements `u` (N,) m of all unknowns and their numbers by trace name.
    """

    drives: Floats
    pressures: Floats
    updates: int
    surface: Floats
    failure: tuple[Ending, str] | None = None
    u: Floats | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def inputs(self) -> Floats:
        return np.concatenate([self.drives, self.pressures])


class Stepper(Protocol):
    """A prepared scheme: steps, and what a state means: field (n, d) m, traces per step."""

    @property
    def scene(self) -> Scene: ...

    def rest(self) -> State: ...

    def step(self, state: State, drives: Floats) -> State: ...

    def field(self, state: State) -> Floats: ...

    def traces(self, states: Sequence[State]) -> dict[str, "Trace"]: ...


class Scheme(Protocol):
    """Settings of a scheme. `prepare` does all that is done once."""

    def prepare(self, system: System) -> Stepper: ...


@dataclass(frozen=True)
class StepTimes:
    """Seconds per step over `n` timed steps."""

    p50: float
    p99: float
    max: float
    n: int

    @property
    def rate_hz(self) -> float:
        return 1 / self.p50


@dataclass(frozen=True)
class Trace:
    """One number every step: y (nt,) in `unit`."""

    y: Floats
    unit: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "y", checked(self.y, "trace", (None,)))


@dataclass(frozen=True)
class Run:
    """t (nt,) s of the steps done; u (no, n, d) m at the output steps `at`; traces by name.

    `u` keeps the output frames only; `traces` every step.
    """

    method: str
    t: Floats
    at: Ints
    u: Floats
    traces: Mapping[str, Trace]
    outcome: Outcome
    setup_s: float
    step_s: StepTimes | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", checked(self.t, "run t [s]", (None,)))
        object.__setattr__(self, "u", checked(self.u, "run u [m]", (len(self.at), None, None)))
        object.__setattr__(self, "traces", MappingProxyType(dict(self.traces)))

    @property
    def finished(self) -> bool:
        return self.outcome.state == "finished"
