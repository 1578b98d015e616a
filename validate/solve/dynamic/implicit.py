"""Implicit dynamics at large strain by Newton's method, from rest or an equilibrium.

R(u) + C v + M a = f at the end of every step, with the rates of the rule: the trapezoidal one
("average", Newmark 1959) or backward Euler. The tangent and its factorisation are made anew at
every iteration: this is the reference of the explicit schemes, and what paper 003's rates for the
plain finite elements correspond to.

A viscoelastic body (`fem.laws.viscoelasticity`) remembers the stress of the last step. Its strain
energy is that of the relaxed law: what branches hold and take is not in it.

Departures: stiffness damping is that of the body at rest, not of K(U).

Implicit dynamics at large strain that starts from a static equilibrium under loads. Inputs and
displacements count from that equilibrium, as a recording's do that begins there: a body that rests
under its weight and is then pushed, or one that was held bent and is let go. A linear law needs no
such start: its motion about any equilibrium is the same (Clough & Penzien 1993, ch. 2) and every
linear scheme gives it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import stiffness_damping
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.laws.viscoelasticity import Branches, Remembered, cell_branches, relaxed
from validate.fem.linear_solvers.factor import elimination_order, factorise_indefinite
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.dynamic.linear import StartName
from validate.solve.explicit.central import lumped_damping
from validate.solve.handles import LARGE_DYNAMICS, Handles, require_handled
from validate.solve.static.newton import StaticNewton
from validate.solve.study_entries import (
    LOOSE,
    TETS,
    Rival,
    Stepping,
    StudyBody,
    SwingingBody,
    implicit_maps,
)
from validate.solve.types import Ending, State

RateRule = Literal["average", "backward_euler"]
_HALVINGS = 6  # of a Newton correction that inverts cells
_ROUNDING = 1e-15  # of the body's unit force: below it a residual is nothing but rounding


@dataclass(frozen=True)
class NewtonDynamics:
    """Settings. `mass` "lumped" is what the explicit schemes use."""

    handles: ClassVar[Handles] = LARGE_DYNAMICS

    dt: float = quantity(0.01, "s", "time step")
    rule: RateRule = quantity("average", "1", "how v and a are derived from u")
    mass: Literal["lumped", "consistent"] = quantity("lumped", "1", "mass matrix")
    tolerance: float = quantity(1e-9, "1", "residual relative to the acting forces")
    max_iterations: int = quantity(20, "1", "Newton iterations in a step")

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        words = "Newton's average acceleration at rest, lumped mass"
        maps = implicit_maps("average")
        return (
            Stepping("newton_dynamics", words, "lumped", maps, None, TETS, LOOSE, conserves=True),
        )

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not isinstance(asked, SwingingBody):
            return ()
        return (
            Rival("large strain, implicit", "large strain",
                   lambda dt: NewtonDynamics(dt, mass="consistent"), elements=("P1", "P2"),
                   finest=asked.medium, shortest=asked.steps[0], law=asked.law),
        )  # fmt: skip

    def __post_init__(self) -> None:
        if not (self.dt > 0 and self.tolerance > 0 and self.max_iterations >= 1):
            raise SceneError(
                f"dt {self.dt:g} s, tolerance {self.tolerance:g}, {self.max_iterations} "
                "iterations: all must be positive"
            )

    def prepare(self, system: System) -> "ImplicitStepper":
        """Raise `SceneError` for a linear law, cavities, or a missing density."""
        scene = system.scene
        require_handled(scene, self)
        N = len(system.moves)
        if self.mass == "lumped":
            M = sparse.csr_array(sparse.diags_array(system.masses))
            C = sparse.csr_array(sparse.diags_array(lumped_damping(system)))
            C = sparse.csr_array(C + stiffness_damping(scene))
        else:
            M, C = system.M, system.C
        body, free = Body(relaxed(scene)), system.free
        K = body.tangent(np.zeros(N))[free][:, free]
        order = elimination_order(K, free // scene.mesh.dimension, scene.mesh.nodes)
        return ImplicitStepper(self, system, body, M, C, order, cell_branches(scene))


@dataclass(frozen=True)
class _Rates:
    """v = p (u - u_n) + v_0, a = q (u - u_n) + a_0."""

    p: float
    q: float
    v: Floats
    a: Floats


@dataclass(frozen=True)
class Settled:
    """Displacements, velocities, accelerations (N,) in balance under the inputs (k + l,)."""

    u: Floats
    v: Floats
    a: Floats
    inputs: Floats
    memory: Remembered | None = None


@dataclass(frozen=True)
class ImplicitStepper:
    """`M` kg and `C` N s/m are (N, N); `order` (free,) is that of elimination; `branches` are those
    of a viscoelastic body. `held` (k + l,) are inputs whose loads act from 0 s on, when a body is
    let go; None: they come with the first step."""

    settings: NewtonDynamics
    system: System
    body: Body
    M: sparse.csr_array
    C: sparse.csr_array
    order: Ints
    branches: Branches | None = None
    held: Floats | None = None

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        forces = {f"{d.name}.force": "N" for d in self.scene.drives}
        return forces | {"energy.strain": "J", "energy.kinetic": "J"}

    def rest(self) -> State:
        u, inputs = np.zeros(len(self.system.moves)), np.zeros(len(self.scene.inputs))
        memory = self.branches.at_rest(self.body.weights.shape) if self.branches else None
        a = np.zeros(len(u))
        if self.held is not None:  # of the undeformed body at 0 s: M a = f
            free = self.system.free
            f = self.system.loads @ self.held[len(self.scene.drives) :]
            factor = factorise_indefinite(sparse.csr_array(self.M)[free][:, free], self.order)
            a[free] = factor.solve(f[free])
        return State(0, Settled(u, u, a, inputs, memory), numbers=self._numbers(u, u, u, inputs))

    def step(self, state: State, inputs: Floats) -> State:
        """To the inputs (k + l,) at the end of the step: drives in m, then loads in N."""
        memory: Remembered | None = state.inner.memory
        if self.branches and memory:
            # A step of the body as its branches will leave it, and what they remember then
            dt, before = self.settings.dt, replace(state.inner, memory=None)
            body = self.body.after(self.branches, memory, dt)
            new = replace(self, body=body).step(replace(state, inner=before), inputs)
            if new.failure:
                return replace(state, failure=new.failure)
            after = self.branches.advanced(memory, body.isochoric(new.inner.u), dt)
            return replace(new, inner=replace(new.inner, memory=after))
        new = self._solved(state, inputs)
        if new.failure is None:
            return replace(new, k=state.k + 1)
        ending, why = new.failure
        return replace(state, failure=(ending, f"step {state.k + 1}: {why}; take a smaller dt"))

    def _solved(self, state: State, inputs: Floats) -> State:
        """A step by Newton from the state's displacements, every correction taken whole
        unless it inverts cells: the pressures are unknowns of the iteration (`Body.extrapolated`),
        whose residual in displacements alone rises a thousandfold on the way near nu = .5."""
        last: Settled = state.inner
        rates, drives = self._rates(last), len(self.scene.drives)
        f, free = self.system.loads @ inputs[drives:], self.system.free
        move = self.system.moves @ (inputs - last.inputs)[:drives]
        u, pressures, negative = last.u, None, 0
        residual, acting = self._residual(u, last, rates, f)
        for iteration in range(self.settings.max_iterations + 1):
            small = self.settings.tolerance * acting + _ROUNDING * self.body.unit_force
            if np.linalg.norm(residual[free]) <= small and not move.any():
                if negative:
                    words = f"tangent not positive definite ({negative} negative pivots)"
                    return replace(state, failure=("not_converged", words))
                return self._found(state, u, rates, inputs, iteration)
            if iteration == self.settings.max_iterations or not np.isfinite(acting):
                break
            try:
                correction, negative = self._correction(u, pressures, residual, rates, move)
            except SceneError as vanished:
                return replace(state, failure=("not_converged", str(vanished)))
            # All of the prescribed motion, the rest halved while it inverts cells
            for share in 0.5 ** np.arange(_HALVINGS + 1):
                taken = move + share * (correction - move)
                if not self.body.inverted(u + taken):
                    break
            else:
                words = f"a Newton correction inverts cells even at 1/{2**_HALVINGS} of its size"
                return replace(state, failure=("not_converged", words))
            pressures = self.body.extrapolated(u, taken)
            u = u + taken
            residual, acting = self._residual(u, last, rates, f)
            move = np.zeros_like(move)
        size = float(np.linalg.norm(residual[free])) / acting if acting else np.inf
        words = f"residual {size:.1e} after {iteration} iterations"
        return replace(state, failure=("not_converged", words))

    def _residual(self, u: Floats, last: Settled, rates: _Rates, f: Floats) -> tuple[Floats, float]:
        """R + C v + M a - f (N,) N, and the size of what acts."""
        d = u - last.u
        R, inertia = self.body.force(u), self.M @ (rates.q * d + rates.a)
        acting = max(float(np.linalg.norm(x)) for x in (R, inertia, f))
        return R + inertia + self.C @ (rates.p * d + rates.v) - f, acting

    def _rates(self, last: Settled) -> _Rates:
        dt, zero = self.settings.dt, np.zeros(len(self.system.moves))
        if self.settings.rule == "average":
            return _Rates(2 / dt, 4 / dt**2, -last.v, -4 / dt * last.v - last.a)
        return _Rates(1 / dt, 1 / dt**2, zero, -last.v / dt)

    def _correction(
        self, u: Floats, pressures: Floats | None, residual: Floats, rates: _Rates, move: Floats
    ) -> tuple[Floats, int]:
        """The Newton correction (N,), prescribed motion and all, and negative pivots."""
        J = self.body.tangent(u, pressures) + rates.p * self.C + rates.q * self.M
        free = self.system.free
        factor = factorise_indefinite(sparse.csr_array(J)[free][:, free], self.order)
        correction = move.copy()
        correction[free] = -factor.solve((residual + J @ move)[free])
        return correction, factor.negative_pivots

    def _found(
        self, state: State, u: Floats, rates: _Rates, inputs: Floats, iterations: int
    ) -> State:
        d = u - state.inner.u
        v, a = rates.p * d + rates.v, rates.q * d + rates.a
        bad = self.body.inverted(u)
        if bad:
            words = f"{bad.count} of {bad.points} elements inverted (det F <= 0)"
            return replace(state, failure=("invalid", words))
        beyond = self.body.beyond_the_law(u) if self.body.most_stretch < np.inf else ""
        if beyond:
            return replace(state, failure=("invalid", beyond))
        numbers = self._numbers(u, v, a, inputs)
        return State(state.k, Settled(u, v, a, inputs), None, iterations, numbers)

    def _numbers(self, u: Floats, v: Floats, a: Floats, inputs: Floats) -> Mapping[str, float]:
        """Plate forces N on the whole body, compression positive, with inertia; energies J."""
        scene = self.scene
        f = self.system.loads @ inputs[len(scene.drives) :]
        acting = self.body.force(u) + self.C @ v + self.M @ a - f
        forces = scene.copies * (acting @ self.system.moves)
        numbers = {f"{d.name}.force": float(x) for d, x in zip(scene.drives, forces, strict=True)}
        numbers["energy.strain"] = self.body.energy(u)
        return numbers | {"energy.kinetic": float(v @ (self.M @ v)) / 2}

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        u: Floats = state.inner.u
        return u.reshape(self.scene.mesh.nodes.shape)


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
        u, failure = np.zeros(len(system.moves)), None
        if inputs.any():
            static = StaticNewton("none", tolerance=self.tolerance).prepare(system)
            state = static.step(static.rest(), inputs)
            if state.failure:
                failure = state.failure[0], f"at rest: {state.failure[1]}"
            else:
                u = static.field(state).ravel().copy()
        return FromEquilibriumStepper(moving, u, inputs, self.a0 == "equilibrium", failure)


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
            # Acceleration (N,) m/s^2 at 0 s under the inputs: M a = f - R(u)
            system = self.moving.system
            a, free = np.zeros(len(self.start)), system.free
            f = system.loads @ whole[len(self.scene.drives) :] - self.moving.body.force(self.start)
            M = sparse.csr_array(self.moving.M)[free][:, free]
            a[free] = factorise_indefinite(M, self.moving.order).solve(f[free])
            state = replace(state, inner=replace(state.inner, a=a))
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

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes since the start."""
        u: Floats = state.inner.u - self.start
        return u.reshape(self.scene.mesh.nodes.shape)
