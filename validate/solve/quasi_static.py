"""Statics at every step, K u = f: what a slow enough motion tends to. No mass is assembled."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.fem.incompressible import keep_volumes
from validate.fem.system import System
from validate.solve.candidates import Asked, Rival, StillBody
from validate.solve.dynamic import InertialStepper, reactions
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled
from validate.solve.stepping import Rates, Stepping
from validate.solve.types import State, Stepper


@dataclass(frozen=True)
class QuasiStatic:
    """Linear statics of drives and loads, by superposition of one solved column per input."""

    handles: ClassVar[Handles] = replace(LINEAR_DYNAMICS, inertia=False, incompressible=True)

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        """One map that remembers nothing."""
        words = "statics: independent of the last step"
        return (Stepping("quasi_static", words, "consistent", _still, order=0.0),)

    @staticmethod
    def candidates(asked: Asked) -> tuple[Rival, ...]:
        if isinstance(asked, StillBody) and asked.cavities:
            return ()
        name = "superposition" if isinstance(asked, StillBody) else "quasi-static"
        return (Rival(name, "static superposition", lambda dt: QuasiStatic(), stepped=False),)

    def prepare(self, system: System) -> Stepper:
        """Raises `SceneError` for a law at large strain, cavities, or a body that can move."""
        require_handled(system.scene, self)
        columns = np.hstack([system.moves, np.zeros_like(system.loads)])
        forces = np.hstack([-(system.K @ system.moves), system.loads])
        factor = system.factor()
        columns[system.free] = factor.solve(forces[system.free])
        pressed = np.zeros((len(system.scene.drives), columns.shape[1]))
        if any(m.incompressible for m in system.scene.materials):
            columns, held = keep_volumes(system, factor, columns, system.loads)
            pressed = system.moves.T @ held
        return QuasiStaticStepper(system, reactions(system, None), columns, pressed)


@dataclass(frozen=True)
class QuasiStaticStepper(InertialStepper):
    """States carry displacements (N,) m; `columns` (N, k + l) are those of a unit input each,
    `pressed` (k, k + l) N the drives' forces of multipliers at nu = 0.5."""

    columns: Floats
    pressed: Floats

    def rest(self) -> State:
        return State(0, np.zeros(len(self.columns)))

    def step(self, state: State, inputs: Floats) -> State:
        """The static state under the inputs: drives in m, then loads in N."""
        u = self.columns @ inputs
        r, loads = self.reactions, inputs[len(self.scene.drives) :]
        numbers = r.named(r.K @ u - r.loads @ loads + self.pressed @ inputs)
        return State(state.k + 1, u, numbers=numbers)

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        return np.reshape(state.inner, self.scene.mesh.nodes.shape)


def _still(r: Rates) -> Floats:
    return np.zeros((len(r.x), 1, 1))
