"""States, outcomes and runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Literal, Protocol, runtime_checkable

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
    """One step: drives (k,) m, pressures (c,) Pa, updates it took, surface (s, d) m.

    `surface` is the displacement of the cavity and plate nodes, what a haptic tick needs.
    `failure` is empty or the ending and its reason. Schemes whose fields are not sums of fixed
    columns keep the displacements `u` (N,) m of all unknowns and their numbers by trace name.
    Dynamic schemes keep the number `k` of steps done, velocities `v` (N,) m/s and accelerations
    `a` (N,) m/s^2, and what else they need in `extra` (a filter its covariance); their `drives`
    are all inputs: drives in m, then loads in N.
    """

    drives: Floats
    pressures: Floats
    updates: int
    surface: Floats
    failure: tuple[Ending, str] | None = None
    u: Floats | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    k: int = 0
    v: Floats | None = None
    a: Floats | None = None
    extra: Any = None

    @property
    def inputs(self) -> Floats:
        return np.concatenate([self.drives, self.pressures])

    @property
    def light(self) -> "State":
        """The state without its fields: what is kept of every step."""
        return replace(self, u=None, v=None, a=None, extra=None)


NOTHING = np.zeros(0)
NOTHING.setflags(write=False)
NO_SURFACE = np.zeros((0, 3))
NO_SURFACE.setflags(write=False)


class Stepper(Protocol):
    """A prepared scheme: steps, and what a state means: field (n, d) m, traces per step.

    `traces` gets states without their fields (`State.light`).
    """

    @property
    def scene(self) -> Scene: ...

    def rest(self) -> State: ...

    def step(self, state: State, drives: Floats) -> State: ...

    def field(self, state: State) -> Floats: ...

    def traces(self, states: Sequence[State]) -> dict[str, "Trace"]: ...


@runtime_checkable
class Uncertain(Protocol):
    """A stepper that knows how sure it is: a filter."""

    def sd(self, state: State) -> Floats:
        """Standard deviations (n, d) m of the field."""
        ...


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

    `u` keeps the output frames only, and so does a filter's `sd`; `traces` every step.
    """

    method: str
    t: Floats
    at: Ints
    u: Floats
    traces: Mapping[str, Trace]
    outcome: Outcome
    setup_s: float
    step_s: StepTimes | None
    sd: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", checked(self.t, "run t [s]", (None,)))
        object.__setattr__(self, "u", checked(self.u, "run u [m]", (len(self.at), None, None)))
        if self.sd is not None:
            object.__setattr__(self, "sd", checked(self.sd, "run sd [m]", self.u.shape))
        object.__setattr__(self, "traces", MappingProxyType(dict(self.traces)))

    @property
    def finished(self) -> bool:
        return self.outcome.state == "finished"
