"""Linear dynamics by Newmark's family: M a + C v + K u = f, one solve a step (paper 001).

u' = J^-1 (A u + L v + M a + f'), then v' and a' by the rule (paper 001, eqs 8-14); J is factorised
once. The paper solves anew at every step by Gaussian elimination: that is a named solver here.

Departures: average acceleration is not L-stable: with a0 = M^-1 f velocities and accelerations
ring for ever. Show none of them; take backward Euler or generalised alpha, or ramp the load.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.fem.factor import factorise
from validate.fem.system import System
from validate.solve.dynamic import (
    InertialStepper,
    StartName,
    reactions,
    require_linear,
    spread,
)
from validate.solve.linear_solvers import SolverName
from validate.solve.newmark_rule import (
    Excitation,
    MassName,
    Motion,
    Propagation,
    RuleName,
    excitation,
    propagation,
    require_start,
    rule_of,
)
from validate.solve.types import State, Stepper

DriveRates = Literal["difference", "rule"]


@dataclass(frozen=True)
class Newmark:
    """Steps of dt s by one of three rules; rho_inf is for generalised alpha alone.

    `a0`: "equilibrium" starts from M a0 = f with the first step's loads, as for a load that is
    switched on at t = 0; "zero" starts without them (where damping rules, the first step of average
    acceleration is then half as long; paper 001 leaves it open). `drive_rates`: velocities and
    accelerations of prescribed unknowns by backward differences of the drives, or by the rule,
    which makes average acceleration ring with growing amplitude on a ramp.
    """

    dt: float = 0.002
    rule: RuleName = "average"
    a0: StartName = "equilibrium"
    solver: SolverName = "prefactored"
    mass: MassName = "consistent"
    rho_inf: float = 0.8
    drive_rates: DriveRates = "difference"

    def __post_init__(self) -> None:
        rule_of(self.rule, self.dt, self.rho_inf)

    def prepare(self, system: System) -> Stepper:
        """Raises `SceneError` for a law at large strain, cavities, or missing densities."""
        require_linear(system)
        rule = rule_of(self.rule, self.dt, self.rho_inf)
        by_rule = self.drive_rates == "rule"
        if self.a0 == "equilibrium" and system.scene.loads:
            require_start(system, rule, self.mass)
        return NewmarkStepper(
            system,
            reactions(system, self.mass),
            propagation(system, rule, self.mass, self.solver),
            excitation(system, rule, self.mass, by_rule=by_rule),
            self._starts(system),
        )

    def _starts(self, system: System) -> Floats | None:
        """Accelerations (m, l) m/s^2 that one newton of each load gives the body at rest."""
        if self.a0 == "zero":
            return None
        loads = system.loads[system.free]
        if self.mass == "lumped":
            return np.asarray(loads / system.masses[system.free][:, None])
        mesh = system.scene.mesh
        M = system.M[system.free][:, system.free]
        return factorise(M, system.free // mesh.dimension, mesh.nodes).solve(loads)


@dataclass(frozen=True)
class NewmarkStepper(InertialStepper):
    """`starts` (m, l): accelerations of the body at rest per newton of load, None for a0 = 0."""

    propagation: Propagation
    excitation: Excitation
    starts: Floats | None

    def step(self, state: State, drives: Floats) -> State:
        """The state at the end of a step; `drives` are the inputs there, loads included."""
        assert state.u is not None
        assert state.v is not None
        assert state.a is not None
        k, free = self._drives, self.propagation.free
        new, old = drives[k:], state.drives[k:]
        u, v, a = state.u[free], state.v[free], state.a[free]
        if state.k == 0 and self.starts is not None:
            old, a = new, self.starts @ new
        motion = state.extra if isinstance(state.extra, Motion) else self.excitation.rest()
        moved = self.excitation.moved(motion, drives[:k])
        f = self.excitation.force(new, old, moved, motion)
        u_new = self.propagation.predict(u, v, a, f)
        rates = self.propagation.rates(u_new, u, v, a)
        return self._done(state, drives, moved, u_new, *rates)

    def _done(
        self, state: State, inputs: Floats, moved: Motion, u: Floats, v: Floats, a: Floats
    ) -> State:
        full_u = spread(self.system, u, moved.q)
        full_v = spread(self.system, v, moved.rate)
        full_a = spread(self.system, a, moved.acceleration)
        numbers = self.reactions.numbers(full_u, full_v, full_a, inputs[self._drives :])
        failure = None
        if not np.isfinite(full_a.sum()):
            failure = ("diverged", f"accelerations are not finite at step {state.k + 1}")
        return self._state(
            inputs,
            state.k + 1,
            u=full_u,
            v=full_v,
            a=full_a,
            numbers=numbers,
            extra=moved,
            failure=failure,
        )
