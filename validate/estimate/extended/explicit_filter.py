"""Stepper of filters that predict with the explicit step, with an exchangeable core."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from validate.arrays import Floats
from validate.estimate.extended import kernels as kernel
from validate.estimate.extended.explicit_step import ExplicitStep
from validate.estimate.gating import Care, gate_numbers, gate_units
from validate.estimate.kalman.batch import OneAtATime
from validate.estimate.kalman.formulas import Innovation, innovation_units, nothing
from validate.estimate.measurements import Measurements, Timetable
from validate.estimate.smoother import Look, Note, Transition, smoothed
from validate.scene.scene import Scene
from validate.solve.types import Ending, State


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
            if failure := self._failure(memory):
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

    def _failure(self, memory: Memory) -> tuple[Ending, str] | None:
        largest = kernel.farthest(memory.u)
        if not largest < self.explicit.far:
            return "diverged", self.explicit.lost(largest)
        return self.core.failure(memory)

    def field(self, state: State) -> Floats:
        """Displacements (n, 3) m."""
        u: Floats = state.inner.memory.u
        return u.reshape(-1, 3)

    def sd(self, state: State) -> Floats:
        """Standard deviations (n, 3) m of the nodes."""
        return self.core.sd(state.inner.memory, state.k * self.explicit.parts)
