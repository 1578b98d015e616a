"""The stepper of filters with a small state: what they share, around a core that they bring."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.estimate.innovation import Innovation, innovation_traces
from validate.estimate.measured import Timetable
from validate.fem.system import System
from validate.solve.dynamic import InertialStepper, spread
from validate.solve.types import State, Trace


class Core(Protocol):
    """A small filter: its state is opaque, `loads` (l,) are the forces in N at the step's end."""

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

    def numbers(self, inner: Any) -> dict[str, tuple[float, str]]:
        """What else it estimates, with units, by trace name."""
        ...


@dataclass(frozen=True)
class CoreStepper(InertialStepper):
    core: Core
    names: tuple[str, ...]
    table: Timetable

    def rest(self) -> State:
        return self._state(np.zeros(len(self.scene.inputs)), 0, extra=self.core.start())

    def step(self, state: State, drives: Floats) -> State:
        """The posterior at the end of a step; `drives` are the inputs there, loads alone."""
        k = state.k + 1
        inner, seen = self.core.step(state.extra, k, drives, self.table.at(k))
        if not np.isfinite(self.core.free(inner)).all():
            why = ("diverged", f"the estimate is not finite at step {k}")
            return self._state(drives, k, extra=inner, failure=why)
        others = {name: value for name, (value, _) in self.core.numbers(inner).items()}
        return self._state(drives, k, extra=inner, numbers={**seen.numbers(self.names), **others})

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        u = spread(self.system, self.core.free(state.extra), np.zeros(0))
        return u.reshape(self.scene.mesh.nodes.shape)

    def sd(self, state: State) -> Floats:
        """Claimed standard deviations (n, d) m; held unknowns have none."""
        full = np.zeros(len(self.system.moves))
        full[self.system.free] = np.sqrt(np.maximum(self.core.variances(state.extra), 0.0))
        return full.reshape(self.scene.mesh.nodes.shape)

    def traces(self, states: Sequence[State]) -> dict[str, Trace]:
        """Of the inputs, NIS with its degrees, innovations with their sd, and the core's own."""
        units = {name: unit for name, (_, unit) in self.core.numbers(self.core.start()).items()}
        own = {
            name: Trace(np.array([s.numbers.get(name, 0.0) for s in states]), unit)
            for name, unit in units.items()
        }
        return super().traces(states) | innovation_traces(self.names, states) | own


def require_loads(system: System) -> None:
    """Raises `SceneError` unless loads alone move the body: small states know no drives."""
    if system.scene.drives or not system.scene.loads:
        raise SceneError(
            f"{len(system.scene.drives)} drives and {len(system.scene.loads)} loads: a filter with "
            "a small state needs loads alone; use KfFem or ModalKf"
        )
