"""Explicit prediction step and stepper of the nonlinear filters.

Explicit step that the nonlinear filters predict with (paper 003, eqs 18-23). Central difference on
lumped masses: U_{t+dt} from U_t, U_{t-dt} and the forces at time t. Damping is the
mass-proportional share of Rayleigh's, which stays diagonal.

Departures: the paper drops the damping matrix (eq 19); here that is a scene without damping.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.estimate.extended import kernels as kernel
from validate.estimate.gating import Care, gate_numbers, gate_units
from validate.estimate.kalman.coordinates import OneAtATime
from validate.estimate.kalman.formulas import Innovation, innovation_units, nothing
from validate.estimate.measurements import Measurements, Timetable
from validate.estimate.smoother import Look, Note, Transition, smoothed
from validate.fem.critical import CriticalStep
from validate.fem.large_strain.explicit import ExplicitBody, Precision
from validate.fem.system import System
from validate.scene.scene import Scene
from validate.solve.explicit.central import lumped_damping
from validate.solve.types import Ending, State

FAR = 10  # body lengths
MARGIN = 0.05  # of the critical step, which falls as a body deforms: as in `CentralDifference`


@dataclass(frozen=True)
class ExplicitStep:
    """U' = c2 U - c1 U_{t-h} + w (F - R(U)), all (N,); held unknowns have zeros in c2, c1 and w.

    `parts` steps of h s make one step of `march`. Loads reach the `loaded` unknowns by `columns`,
    drives the `driven` ones by `moves`.
    """

    system: System
    model: ExplicitBody
    h: float
    parts: int
    c2: Floats
    c1: Floats
    w: Floats
    loaded: Ints
    columns: Floats
    driven: Ints
    moves: Floats

    @cached_property
    def far(self) -> float:
        """A displacement m that no body of this size has: the run has diverged."""
        return FAR * float(np.ptp(self.system.scene.mesh.nodes, axis=0).max())

    def lost(self, largest: float) -> str:
        """Why a run ends whose largest displacement is that many m, or not a number."""
        found = f"{largest:.3g} m" if np.isfinite(largest) else "not finite"
        return (
            f"displacements of {found} in a body of {self.far / FAR:.3g} m at steps of {self.h:g} "
            "s: take smaller steps, or correct U_{t-dt} together with U_t"
        )

    def inputs(self, old: Floats, new: Floats, part: int) -> tuple[Floats, Floats]:
        """Return the loads N at the start and drives m at the end of a part of the way between two
        inputs."""
        k = self.system.moves.shape[1]
        if self.parts == 1:
            return old[k:], new[:k]
        start, end = part / self.parts, (part + 1) / self.parts
        return old[k:] + start * (new - old)[k:], old[:k] + end * (new - old)[:k]

    def following(
        self, u: Floats, before: Floats, R: Floats, loads: Floats, drives: Floats
    ) -> Floats:
        """U_{t+h} (N,) m; R (N,) N are the internal forces at t, with the loads then."""
        return kernel.follow(
            u, before, R, self.c2, self.c1, self.w,
            self.loaded, self.columns, loads, self.driven, self.moves, drives,
        )  # fmt: skip


def explicit_step(
    system: System, dt: float, parts: int, precision: Precision = "double"
) -> ExplicitStep:
    """Return the step of h = dt/parts; raises `SceneError` for damping that is not diagonal."""
    h, lags = dt / parts, system.scene.per_cell(lambda m: m.stiffness_damping)
    if lags.any():
        raise SceneError(
            f"stiffness damping {lags.max():g} s couples the nodes: the explicit filters know mass "
            "damping only; set it to 0"
        )
    half = h / 2 * lumped_damping(system) / system.masses
    free = np.zeros(len(system.moves))
    free[system.free] = 1 / (1 + half[system.free])
    loaded, driven = (np.flatnonzero(X.any(axis=1)) for X in (system.loads, system.moves))
    return ExplicitStep(
        system, ExplicitBody(system.scene, precision=precision), h, parts,
        2 * free, (1 - half) * free, free * h * h / system.masses,
        loaded, np.ascontiguousarray(system.loads[loaded]),
        driven, np.ascontiguousarray(system.moves[driven]),
    )  # fmt: skip


def beyond(system: System, h: float) -> str:
    """Why a step of h s is refused; empty where it keeps the margin below the critical one."""
    found = CriticalStep.of(system)
    if h <= (1 - MARGIN) * found.lanczos:
        return ""
    return (
        f"dt {h:g} s is {h / found.lanczos:.3g} times the critical step {found.lanczos:.3g} s; "
        f"{found.limited_by}; take at most {found.recommended:.3g} s or more substeps"
    )


class Memory(Protocol):
    """State of a core: displacements (N,) m, and its further data."""

    @property
    def u(self) -> Floats: ...


class ExplicitCore(Protocol):
    """A filter between and at measurements; explicit steps are numbered 1, 2, ..."""

    @property
    def units(self) -> Mapping[str, str]:
        """Of what else it estimates, by trace name."""
        ...

    def start(self) -> Memory: ...

    def predict(self, memory: Any, loads: Floats, drives: Floats) -> Memory:
        """One explicit step from the loads N at its start to the drives m at its end."""
        ...

    def failure(self, memory: Any) -> tuple[Ending, str] | None: ...

    def correct(self, memory: Any, number: int, z: Floats) -> tuple[Memory, Innovation]:
        """By what was measured at the end of step `number` (m,), NaN = missing."""
        ...

    def sd(self, memory: Any, number: int) -> Floats:
        """Standard deviations (n, 3) m after step `number`."""
        ...

    def numbers(self, memory: Any) -> Mapping[str, float]: ...


@runtime_checkable
class SmoothExplicitCore(ExplicitCore, Protocol):
    """A core whose memory can be smoothed."""

    def look(self, memory: Any) -> Look | None:
        """What it took at its last correction."""
        ...

    def transition(self) -> Transition: ...

    def corrected(self, memory: Any, number: int, e: Floats, W: Floats | None) -> Memory:
        """After step `number`, with e (n,) added, and at output frames P_s = P - (P W)(P W)^T."""
        ...


@dataclass(frozen=True)
class AtInputs:
    """The core's memory, the inputs (k + l,) at the end of the step, and what was taken in its
    explicit steps, to be smoothed."""

    memory: Any
    inputs: Floats
    looks: tuple[Look | None, ...] = ()


@dataclass(frozen=True)
class ExplicitFilterStepper(OneAtATime):
    """`refusal` says why no step is made; empty where the step is small enough."""

    explicit: ExplicitStep
    core: ExplicitCore
    offered: Measurements
    times: Timetable
    refusal: str
    care: Care | None
    smooth: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return self.offered.names

    @property
    def scene(self) -> Scene:
        return self.explicit.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """NIS with its degrees, innovations with their sd, and the core's own."""
        return {**innovation_units(self.names), **gate_units(self.care), **self.core.units}

    def unheard(self, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why no measurement reached the estimate; empty where one did."""
        return self.times.unheard(len(numbers) * self.explicit.parts, numbers)

    def rest(self) -> State:
        """U_0 = U_{-h} = 0."""
        return State(0, AtInputs(self.core.start(), np.zeros(len(self.scene.inputs))))

    def step(self, state: State, inputs: Floats) -> State:
        """`parts` explicit steps, each with an update where something was measured."""
        if self.refusal:
            return replace(state, failure=("refused", self.refusal))
        core, parts, last = self.core, self.explicit.parts, state.inner
        memory, found, looks = last.memory, None, list[Look | None]()
        for part in range(parts):
            memory = core.predict(memory, *self.explicit.inputs(last.inputs, inputs, part))
            if not (largest := kernel.farthest(memory.u)) < self.explicit.far:
                return replace(state, failure=("diverged", self.explicit.lost(largest)))
            if failure := core.failure(memory):
                return replace(state, failure=failure)
            number = state.k * parts + part + 1
            z = self.times.at(number)
            if z is not None:
                memory, new = core.correct(memory, number, z)
                found = new.after(found) if found else new
            if self.smooth:
                looks.append(None if z is None else self._smoothing.look(memory))
        found = found or nothing(len(self.names))
        numbers = {**found.numbers(self.names), **gate_numbers(self.care, found)}
        numbers |= core.numbers(memory)
        return State(state.k + 1, AtInputs(memory, inputs, tuple(looks)), numbers=numbers)

    @property
    def _smoothing(self) -> SmoothExplicitCore:
        assert isinstance(self.core, SmoothExplicitCore)
        return self.core

    def note(self, state: State, framed: bool) -> tuple[Note, ...]:
        """Of every explicit step; the last one is the frame."""
        *parts, end = state.inner.looks
        return (*(Note(look) for look in parts), Note(end, framed))

    def smoother(self, notes: Sequence[tuple[Note, ...]]) -> Callable[[State], State]:
        """With what else the core estimates, by its linearisation."""
        core = self._smoothing
        found = smoothed(core.transition(), [note for step in notes for note in step])

        def shown(state: State) -> State:
            number = state.k * self.explicit.parts
            e, W = found.after(number), found.roots.get(number)
            memory = core.corrected(state.inner.memory, number, e, W)
            numbers = {**state.numbers, **core.numbers(memory)}
            return replace(state, inner=replace(state.inner, memory=memory), numbers=numbers)

        return shown

    def field(self, state: State) -> Floats:
        """Displacements (n, 3) m."""
        u: Floats = state.inner.memory.u
        return u.reshape(-1, 3)

    def sd(self, state: State) -> Floats:
        """Standard deviations (n, 3) m of the nodes."""
        return self.core.sd(state.inner.memory, state.k * self.explicit.parts)
