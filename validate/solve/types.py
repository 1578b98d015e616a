"""Types of the solvers: states, outcomes and runs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

from validate.arrays import Floats, Ints, checked
from validate.display import brief
from validate.fem.system import System
from validate.scene.contact import Needle
from validate.scene.scene import Scene
from validate.solve.handles import Handles

Ending = Literal["finished", "diverged", "not_converged", "refused", "invalid"]


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run: its state, last step and reason."""

    state: Ending
    step: int
    why: str = ""


@dataclass(frozen=True)
class State:
    """After `k` steps: `inner` is what the scheme itself carries, the rest is common to all.

    `failure` is empty or the ending and its reason; `updates` counts what an iteration took;
    `numbers` are what the step found, by the trace names of the stepper's `units`.
    """

    k: int
    inner: Any
    failure: tuple[Ending, str] | None = None
    updates: int = 0
    numbers: Mapping[str, float] = field(default_factory=dict)


class Stepper(Protocol):
    """A prepared scheme: steps through inputs (k + l,), drives in m, then loads in N.

    `units` names every number of its states; `field` gives displacements (n, d) m of all nodes.
    """

    @property
    def scene(self) -> Scene: ...

    @property
    def units(self) -> Mapping[str, str]: ...

    def rest(self) -> State: ...

    def step(self, state: State, inputs: Floats) -> State: ...

    def field(self, state: State) -> Floats: ...


@runtime_checkable
class HandStepper(Stepper, Protocol):
    """A stepper at a hand: displacements (d,) m of a `tool` in, its numbers `<tool>.force.x` .. N,
    `.contact`, `.changed` and `.clipped` out, `rate` times a second. No force is beyond `limit` N.
    """

    @property
    def tool(self) -> Needle: ...

    @property
    def rate(self) -> float: ...

    @property
    def limit(self) -> float: ...

    @property
    def threads(self) -> tuple[int, ...]:
        """The system's numbers of threads that it computes in, besides its caller's."""
        ...

    def warm(self) -> None:
        """What a first touch costs, paid before the clock starts."""
        ...


@runtime_checkable
class Uncertain(Protocol):
    """A stepper that knows how sure it is: a filter."""

    def sd(self, state: State) -> Floats:
        """Standard deviations (n, d) m of the field."""
        ...


@runtime_checkable
class Listening(Protocol):
    """A stepper that is given measurements: a filter."""

    def unheard(self, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why none reached it in steps that told these numbers; empty where one did."""
        ...


@runtime_checkable
class Noticing(Protocol):
    """A stepper that does not do all that its settings ask, and says what it does instead."""

    def notices(self, state: State) -> tuple[str, ...]:
        """What was rounded or left out up to this state, in words."""
        ...


@runtime_checkable
class Smoothing(Protocol):
    """A filter that can estimate every step from later measurements too; `smooth`: it is to."""

    @property
    def smooth(self) -> bool: ...

    def note(self, state: State, framed: bool) -> Any:
        """What must be kept of a step until the run is over; `framed`: an output frame."""
        ...

    def smoother(self, notes: Sequence[Any]) -> Callable[[State], State]:
        """Turn the states of the same steps, in order, into smoothed ones."""
        ...


class Scheme(Protocol):
    """Settings of a scheme that steps. `prepare` does all that is done once."""

    handles: ClassVar[Handles]

    def prepare(self, system: System) -> Stepper: ...


@runtime_checkable
class SceneSolver(Protocol):
    """Settings that solve a whole scene for inputs (nt, k) at times t (nt,) s, a program of others
    among them; the run has every step as an output frame, and no name yet."""

    handles: ClassVar[Handles]

    def solve(self, scene: Any, t: Floats, inputs: Floats) -> "Run": ...


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

    `u` keeps the output frames only, and so does a filter's `sd`; `traces` every step, and
    `seconds` (nt,) what each took, where it was timed. `said`: what a `Noticing` stepper noticed.
    `memory` bytes is the peak of the process that it ran in, until its end; 0: not measured.
    `points` (nt, p, d) m are the displacements of points that were asked for, at every step.
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
    seconds: Floats | None = None
    said: tuple[str, ...] = ()
    memory: int = 0
    points: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", checked(self.t, "run t [s]", (None,)))
        object.__setattr__(self, "u", checked(self.u, "run u [m]", (len(self.at), None, None)))
        if self.sd is not None:
            object.__setattr__(self, "sd", checked(self.sd, "run sd [m]", self.u.shape))
        object.__setattr__(self, "traces", MappingProxyType(dict(self.traces)))

    __repr__ = brief

    @property
    def finished(self) -> bool:
        return self.outcome.state == "finished"
