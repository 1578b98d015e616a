"""Statics at every step, K u = f: what a slow enough motion tends to. No mass is assembled."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.system import System
from validate.solve.dynamic import InertialStepper, reactions, require_linear
from validate.solve.types import State, Stepper


@dataclass(frozen=True)
class QuasiStatic:
    """Linear statics of drives and loads, by superposition of one solved column per input."""

    def prepare(self, system: System) -> Stepper:
        """Raises `SceneError` for a law at large strain, cavities, or a body that can move."""
        require_linear(system)
        columns = np.hstack([system.moves, np.zeros_like(system.loads)])
        forces = np.hstack([-(system.K @ system.moves), system.loads])
        columns[system.free] = system.factor().solve(forces[system.free])
        return QuasiStaticStepper(system, reactions(system, None), columns)


@dataclass(frozen=True)
class QuasiStaticStepper(InertialStepper):
    """`columns` (N, k + l): displacements of a unit of every input."""

    columns: Floats

    def step(self, state: State, drives: Floats) -> State:
        """The static state under the inputs `drives`: drives in m, then loads in N."""
        u = self.columns @ drives
        still = np.zeros_like(u)
        numbers = self.reactions.numbers(u, still, still, drives[self._drives :])
        return self._state(drives, state.k + 1, u=u, v=still, a=still, numbers=numbers)
