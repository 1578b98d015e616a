"""Static scheme tabulated on a grid of loads, and interpolated between them.

A body without memory is in one state per load, so a recorded stage that ramps and holds needs no
solution per sample: cubic Lagrange interpolation between converged states is exact at the grid and
of fourth order between. Its step time is that of the interpolation, not of a solution.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import prod
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.handles import LARGE_STATICS, Handles
from validate.solve.static.newton import StaticNewton
from validate.solve.study_entries import Rival, StillBody, StudyBody
from validate.solve.types import Ending, Scheme, State, Stepper

_NODES = 4  # of the interpolation
_BEYOND = 0.01  # grid steps of extrapolation: the noise of a stage that stands at the last load


@dataclass(frozen=True)
class Tabulated:
    """Settings: solves `inner` at whole multiples of `step` of the one drive."""

    handles: ClassVar[Handles] = LARGE_STATICS

    inner: Scheme
    step: float = quantity(1e-3, "m", "spacing of the solved loads")

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        """Return a table of Newton's solutions over the load."""
        if not isinstance(asked, StillBody):
            return ()
        spacing = asked.table
        return (
            Rival("large strain, table", "large strain",
                   lambda dt: Tabulated(StaticNewton(), spacing), stepped=False, law=asked.law,
                   finest=asked.medium),
        )  # fmt: skip

    def __post_init__(self) -> None:
        if not self.step > 0:
            raise SceneError(f"load grid of {self.step:g} m: expected a positive number")

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` unless the scene has exactly one drive."""
        if len(system.scene.drives) != 1:
            raise SceneError(f"{len(system.scene.drives)} drives: a load grid supports one")
        inner = self.inner.prepare(system)
        return TabulatedStepper(inner, self.step, _Table(inner.rest()))


class _Table:
    """Converged states at 0, 1, 2 ... grid steps, and what ended the last attempt."""

    def __init__(self, rest: State) -> None:
        self.states = [rest]
        self.failure: tuple[Ending, str] | None = None


@dataclass(frozen=True)
class TabulatedStepper:
    """States carry their field (n, d) m."""

    inner: Stepper
    grid: float
    table: _Table

    @property
    def scene(self) -> Scene:
        return self.inner.scene

    @property
    def units(self) -> Mapping[str, str]:
        return self.inner.units

    def rest(self) -> State:
        return self._at(0, self.table.states[0])

    def step(self, state: State, inputs: Floats) -> State:
        """Return the state at a drive (1,) m; a failure beyond the last load that has a
        solution."""
        place = float(inputs[0]) / self.grid
        count = max(int(np.ceil(place - _BEYOND)), _NODES - 1)
        table = self.table
        while len(table.states) <= count and table.failure is None:
            load = np.array([len(table.states) * self.grid])
            found = self.inner.step(table.states[-1], load)
            if found.failure:
                table.failure = found.failure
            else:
                table.states.append(found)
        table, last = self.table, len(self.table.states) - 1
        if place > last + _BEYOND:
            return replace(self._at(state.k, table.states[last]), failure=table.failure)
        if abs(place - round(place)) < 1e-9 and 0 <= round(place) <= last:
            return self._at(state.k + 1, table.states[round(place)])
        first = max(0, min(int(np.floor(place)) - 1, last - _NODES + 1))
        end = min(first + _NODES, last + 1)
        states, nodes = self.table.states[first:end], range(first, end)
        weights = [prod((place - o) / (n - o) for o in nodes if o != n) for n in nodes]
        pairs = list(zip(weights, states, strict=True))
        u = sum(w * self.inner.field(s) for w, s in pairs)
        numbers = {name: float(sum(w * s.numbers[name] for w, s in pairs)) for name in self.units}
        return State(state.k + 1, u, numbers=numbers)

    def _at(self, k: int, solved: State) -> State:
        return State(k, self.inner.field(solved), None, solved.updates, solved.numbers)

    def field(self, state: State) -> Floats:
        return np.asarray(state.inner)
