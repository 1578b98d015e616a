"""Implicit dynamics at large strain that starts from a static equilibrium under loads.

Inputs and displacements count from that equilibrium, as a recording's do that begins there: a body
that rests under its weight and is then pushed, or one that was held bent and is let go. A linear
law needs no such start: its motion about any equilibrium is the same (Clough & Penzien 1993, ch. 2)
and every linear scheme gives it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.linear_solvers.factor import factorise_indefinite
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.dynamic.implicit import ImplicitStepper, NewtonDynamics, RateRule
from validate.solve.excitation import StartName
from validate.solve.handles import LARGE_DYNAMICS, Handles, require_handled
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Ending, State


@dataclass(frozen=True)
class FromEquilibrium:
    """Settings of `NewtonDynamics` with the consistent mass, and of the start.

    `preload` are the inputs (k + l,) at which the body rests at 0 s; none: all zero. `a0` as in
    `Newmark`: with "equilibrium" the loads of the first step act from 0 s on, with "zero" they rise
    there.
    """

    handles: ClassVar[Handles] = replace(LARGE_DYNAMICS, viscous=False)

    dt: float = quantity(0.005, "s", "time step")
    rule: RateRule = quantity("average", "1", "how v and a are derived from u")
    tolerance: float = quantity(1e-7, "1", "residual relative to the acting forces")
    max_iterations: int = quantity(20, "1", "Newton iterations in a step")
    a0: StartName = quantity("equilibrium", "1", "acceleration at t = 0, as in `Newmark`")
    preload: tuple[float, ...] = quantity((), "1", "inputs at which the body rests at 0 s, SI")

    def prepare(self, system: System) -> "FromEquilibriumStepper":
        """Raise `SceneError` for a linear law, cavities, a missing density, or a preload of another
        number of inputs."""
        require_handled(system.scene, self)
        inputs = np.zeros(len(system.scene.inputs))
        if self.preload:
            if len(self.preload) != len(inputs):
                raise SceneError(
                    f"preload of {len(self.preload)} numbers, the scene has {len(inputs)} inputs: "
                    f"{', '.join(system.scene.inputs)}"
                )
            inputs = np.array(self.preload)
        moving = NewtonDynamics(
            self.dt, self.rule, "consistent", self.tolerance, self.max_iterations
        ).prepare(system)
        u, failure = _rest(system, inputs, self.tolerance)
        return FromEquilibriumStepper(moving, u, inputs, self.a0 == "equilibrium", failure)


def _rest(
    system: System, inputs: Floats, tolerance: float
) -> tuple[Floats, tuple[Ending, str] | None]:
    """Displacements (N,) m of the static equilibrium, or how looking for it ended."""
    if not inputs.any():
        return np.zeros(len(system.moves)), None
    static = StaticNewton("none", tolerance=tolerance).prepare(system)
    state = static.step(static.rest(), inputs)
    if state.failure:
        return np.zeros(len(system.moves)), (state.failure[0], f"at rest: {state.failure[1]}")
    return static.field(state).ravel().copy(), None


@dataclass(frozen=True)
class FromEquilibriumStepper:
    """`start` (N,) m is the equilibrium under `preload` (k + l,); fields and the drives' forces are
    those since then. `sudden`: the first step's loads act from 0 s on."""

    moving: ImplicitStepper
    start: Floats
    preload: Floats
    sudden: bool
    failure: tuple[Ending, str] | None

    @property
    def scene(self) -> Scene:
        return self.moving.scene

    @property
    def units(self) -> Mapping[str, str]:
        return self.moving.units

    def rest(self) -> State:
        at_rest = self.moving.rest()
        inner = replace(at_rest.inner, u=self.start, inputs=self.preload)
        return replace(at_rest, inner=inner)

    def step(self, state: State, inputs: Floats) -> State:
        """To the inputs (k + l,) at the end of the step, counted from the preload."""
        if self.failure:
            return replace(state, failure=self.failure)
        whole = inputs + self.preload
        if state.k == 0 and self.sudden:
            state = replace(state, inner=replace(state.inner, a=self._accelerated(whole)))
        new = self.moving.step(state, whole)
        if new.failure or not self._resting_forces:
            return new
        numbers = {n: y - self._resting_forces.get(n, 0.0) for n, y in new.numbers.items()}
        return replace(new, numbers=numbers)

    @property
    def _resting_forces(self) -> Mapping[str, float]:
        """N on the drives at rest."""
        scene, system = self.scene, self.moving.system
        if not (scene.drives and self.preload.any()):
            return {}
        f = system.loads @ self.preload[len(scene.drives) :]
        forces = scene.copies * ((self.moving.body.force(self.start) - f) @ system.moves)
        return {f"{d.name}.force": float(x) for d, x in zip(scene.drives, forces, strict=True)}

    def _accelerated(self, inputs: Floats) -> Floats:
        """Acceleration (N,) m/s^2 at 0 s under the inputs: M a = f - R(u)."""
        system = self.moving.system
        a, free = np.zeros(len(self.start)), system.free
        f = system.loads @ inputs[len(self.scene.drives) :] - self.moving.body.force(self.start)
        M = sparse.csr_array(self.moving.M)[free][:, free]
        a[free] = factorise_indefinite(M, self.moving.order).solve(f[free])
        return a

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes since the start."""
        u: Floats = state.inner.u - self.start
        return u.reshape(self.scene.mesh.nodes.shape)
