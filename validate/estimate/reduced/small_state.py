"""Stepper of filters with a small state, with an exchangeable core."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from validate.arrays import Floats
from validate.estimate.gating import Care, gate_numbers, gate_units
from validate.estimate.kalman.coordinates import OneAtATime
from validate.estimate.kalman.formulas import Innovation, innovation_units
from validate.estimate.measurements import Measurements, Timetable
from validate.estimate.smoother import Note, Transition, smoothed
from validate.fem.system import System
from validate.scene.scene import Scene
from validate.solve.dynamic.linear import spread
from validate.solve.types import State


class Core(Protocol):
    """A small filter: its state is opaque, `loads` (l,) are the forces in N at the step's end."""

    @property
    def units(self) -> Mapping[str, str]:
        """Of what else it estimates, by trace name."""
        ...

    def start(self) -> Any: ...

    def step(self, inner: Any, k: int, loads: Floats, z: Floats | None) -> tuple[Any, Innovation]:
        """Step k = 1, 2, ... with what was measured there (m,), NaN = missing; None: predict."""
        ...

    def free(self, inner: Any) -> Floats:
        """Estimated displacements (m,) m of the free unknowns."""
        ...

    def variances(self, inner: Any) -> Floats:
        """Their claimed variances (m,) m^2."""
        ...

    def numbers(self, inner: Any) -> Mapping[str, float]: ...


@runtime_checkable
class SmoothCore(Core, Protocol):
    """A core whose states can be smoothed."""

    def note(self, inner: Any, framed: bool) -> Note:
        """Of the last step."""
        ...

    def transition(self) -> Transition: ...

    def corrected(self, inner: Any, e: Floats, W: Floats | None) -> Any:
        """Return the state with e (n,) added, and at output frames P_s = P - (P W)(P W)^T."""
        ...


@dataclass(frozen=True)
class CoreStepper(OneAtATime):
    """States carry what the core does."""

    system: System
    core: Core
    offered: Measurements
    table: Timetable
    care: Care | None
    smooth: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return self.offered.names

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """NIS with its degrees, innovations with their sd, and the core's own."""
        return {**innovation_units(self.names), **gate_units(self.care), **self.core.units}

    def unheard(self, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why no measurement reached the estimate; empty where one did."""
        return self.table.unheard(len(numbers), numbers)

    def rest(self) -> State:
        return State(0, self.core.start())

    def step(self, state: State, inputs: Floats) -> State:
        """Return the posterior at the end of a step; `inputs` are those there, loads alone."""
        k = state.k + 1
        inner, seen = self.core.step(state.inner, k, inputs, self.table.at(k))
        if not np.isfinite(self.core.free(inner)).all():
            return State(k, inner, ("diverged", f"the estimate is not finite at step {k}"))
        numbers = {**seen.numbers(self.names), **gate_numbers(self.care, seen)}
        numbers |= self.core.numbers(inner)
        return State(k, inner, numbers=numbers)

    def note(self, state: State, framed: bool) -> Note:
        assert isinstance(self.core, SmoothCore)
        return self.core.note(state.inner, framed)

    def smoother(self, notes: Sequence[Note]) -> Callable[[State], State]:
        """With what else the core estimates."""
        core = self.core
        assert isinstance(core, SmoothCore)
        found = smoothed(core.transition(), notes)

        def shown(state: State) -> State:
            inner = core.corrected(state.inner, found.after(state.k), found.roots.get(state.k))
            return replace(state, inner=inner, numbers={**state.numbers, **core.numbers(inner)})

        return shown

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        return self._nodal(self.core.free(state.inner))

    def sd(self, state: State) -> Floats:
        """Claimed standard deviations (n, d) m; held unknowns have none."""
        return self._nodal(np.sqrt(np.maximum(self.core.variances(state.inner), 0.0)))

    def _nodal(self, free: Floats) -> Floats:
        return spread(self.system, free, np.zeros(0)).reshape(self.scene.mesh.nodes.shape)
