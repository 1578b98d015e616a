"""Static Newton at large strain: equilibrium, load steps with cut-back, fluid cavities.

The pressures of the volumetric law are unknowns of the iteration (`Body.extrapolated`). A
correction of size d changes volumes by d^2, which near nu = .5 raises the residual of the
displacements a thousandfold and says nothing: it is taken whole, halved only while it inverts
cells; what does not converge is cut.

Departures from a textbook Newton: a factorisation is kept, across steps too, while every iteration
shrinks the error by `contraction` or better (Shamanskii 1967); the last one is remembered together
with the state it led to, so that stepping on from there needs no new one. Results depend on that
memory within the tolerance only.

Static equilibrium of a hyperelastic body with fluid cavities under drives and dead loads. Unknowns
are the free displacements and the cavity pressures:

    f_int(u) - sum_i P_i dV_i/dx = f,    V_i(x) = volume ratio x V_i0

Newton's bordered system [A, -G; G^T, 0], A = K_t - sum_i P_i d2V_i/dx2 and G = dV/dx, is solved by
block elimination with one factorisation of A. It has as many negative eigenvalues as A has plus the
positive ones of S = G^T A^-1 G, so the Hessian on the constraints G^T du = 0, whose signs decide
stability, has (negative of A) - (negative of S): A may be indefinite while the fluid holds the body
(Gould 1985).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.cavity import volume_hessian
from validate.fem.large_strain.hyperelastic import BEYOND_LAW, Body
from validate.fem.linear_solvers.factor import Factor, elimination_order, factorise_indefinite
from validate.fem.system import System, require_held
from validate.parameters import quantity
from validate.scene.scene import Load, Pressure, Scene, Weight
from validate.solve.handles import LARGE_STATICS, Handles, require_handled
from validate.solve.study_entries import Rival, StillBody, StudyBody
from validate.solve.types import Ending, State, Stepper


@dataclass(frozen=True)
class Balance:
    """Forces at u (N,) m and P (c,) Pa under `inputs` (k + l,), drives in m and then loads.

    `residual` (N,) N holds the reactions, `loads` (c, N) m^2 are dV/dx. `stresses` (e, q) Pa are
    the volumetric law's slopes that the next tangent takes: those of u, but on the way of an
    iteration the ones that it has foreseen (`Body.extrapolated`).

    `unbalanced` N is the residual's norm over the free unknowns, zero where it is the stress's own
    rounding; `acting` N the norm of the forces that act; `gap` the largest error of V/V0, of
    cavities and of cells with nu = 0.5, whose `multipliers` (e, q) Pa keep it
    (`fem.large_strain.hyperelastic`).
    """

    u: Floats
    pressures: Floats
    inputs: Floats
    residual: Floats
    loads: Floats
    ratios: Floats
    gap: float
    unbalanced: float
    acting: float
    stresses: Floats | None = None
    multipliers: Floats | None = None

    def merit(self, force: float) -> float:
        """What a line search lowers: the residual in units of `force` N and the volume error."""
        return float(np.hypot(self.unbalanced / force, self.gap))


@dataclass(frozen=True)
class Tangent:
    """A factorised at u (N,) m: what unit inputs (N, k + l) and unit pressures (N, c) move.

    `negative` counts the negative eigenvalues of the Hessian under constant volume.
    """

    factor: Factor
    inputs: Floats
    pressures: Floats
    negative: int
    u: Floats


@dataclass(frozen=True)
class Equilibrium:
    """The parts of the balance that stay: body, system, rest volumes (c,) m^3, elimination order.

    With `constrained` False the cavities are empty: no pressures, no constraint.
    """

    body: Body
    system: System
    constrained: bool
    rest_volumes: Floats
    order: Ints

    def balance(
        self,
        u: Floats,
        pressures: Floats,
        inputs: Floats,
        target: Floats,
        stresses: Floats | None = None,
        multipliers: Floats | None = None,
    ) -> Balance:
        """Return the forces at u, P and the inputs, with volumes asked for as ratios `target`
        (c,)."""
        cavities = self.system.cavities
        x = self._places(u)
        ratios = np.array([c.volume(x) for c in cavities]) / self.rest_volumes
        loads = np.array([c.pressure_load(x).ravel() for c in cavities]).reshape(-1, len(u))
        multipliers = self.body.multipliers if multipliers is None else multipliers
        inner = self.body.holding(multipliers).force(u)
        f = self.system.loads @ inputs[len(self.system.scene.drives) :]
        residual = inner - pressures @ loads - f
        rounding = 4 * np.finfo(float).eps * self.body.unit_force
        free = float(np.linalg.norm(residual[self.system.free]))
        pushing = float(np.abs(pressures) @ np.linalg.norm(loads, axis=1))
        acting = max(*(float(np.linalg.norm(x)) for x in (inner, f)), pushing, rounding)
        gap = float(np.abs(ratios - target).max(initial=0.0)) if self.constrained else 0.0
        gap = max(gap, self.body.volume_error(u))
        unbalanced = free if free > rounding else 0.0
        return Balance(
            u, pressures, inputs, residual, loads, ratios, gap, unbalanced, acting, stresses,
            multipliers,
        )  # fmt: skip

    def tangent(self, at: Balance) -> Tangent:
        """Factorise A at a balance; `SceneError` where a pivot vanishes."""
        free, moves = self.system.free, self.system.moves
        A = self.body.holding(at.multipliers).tangent(at.u, at.stresses)
        x = self._places(at.u)
        for P, cavity in zip(at.pressures, self.system.cavities, strict=True):
            if P:
                A = sparse.csr_array(A - P * volume_hessian(cavity, x))
        factor = factorise_indefinite(A[free][:, free], self.order)
        driven = self._solved(factor, -(A @ moves).T).T + moves
        loaded = self._solved(factor, self.system.loads.T).T
        pressed = self._solved(factor, at.loads).T
        negative = factor.negative_pivots
        if self.constrained:
            S = at.loads @ pressed
            negative -= int((np.linalg.eigvalsh((S + S.T) / 2) < 0).sum())
        return Tangent(factor, np.hstack([driven, loaded]), pressed, negative, at.u)

    def _places(self, u: Floats) -> Floats:
        """Nodes (n, d) m of the deformed mesh."""
        nodes = self.system.scene.mesh.nodes
        return np.asarray(nodes + u.reshape(nodes.shape))

    def _solved(self, factor: Factor, rows: Floats) -> Floats:
        """Fields (k, N) of the right-hand sides (k, N), zero where held."""
        out = np.zeros_like(rows)
        if len(rows):
            out[:, self.system.free] = factor.solve(rows[:, self.system.free].T.copy()).T
        return out

    def predicted(self, at: Balance, tangent: Tangent, move: Floats, target: Floats) -> Balance:
        """Return the linear response to a change `move` (k + l,) of the inputs, forces not yet
        known."""
        return self._moved(at, tangent, tangent.inputs @ move, target)

    def correction(self, at: Balance, tangent: Tangent, target: Floats) -> Balance:
        """Return the Newton correction of an imbalance, forces not yet known."""
        field = -self._solved(tangent.factor, at.residual[None])[0]
        return self._moved(at, tangent, field, target)

    def _moved(self, at: Balance, tangent: Tangent, field: Floats, target: Floats) -> Balance:
        """`at` moved by `field` and by the pressures that close the volumes to first order."""
        if not self.constrained:
            return replace(at, u=at.u + field)
        error = (at.ratios - target) * self.rest_volumes + at.loads @ field
        dP = np.linalg.solve(at.loads @ tangent.pressures, -error)
        return replace(at, u=at.u + field + tangent.pressures @ dP, pressures=at.pressures + dP)

    def forces(self, at: Balance) -> Floats:
        """Forces (k,) N of the plates on the whole body, compression positive."""
        return np.asarray(self.system.scene.copies * (at.residual @ self.system.moves))


def equilibrium(system: System, constrained: bool) -> Equilibrium:
    """Prepare the body and the elimination order, which holds for every tangent."""
    mesh, free = system.scene.mesh, system.free
    require_held(system.scene, system.held)
    body = Body(system.scene)
    K = system.K[free][:, free]
    order = elimination_order(sparse.csr_array(K), free // mesh.dimension, mesh.nodes)
    volumes = np.array([c.volume(mesh.nodes) for c in system.cavities])
    return Equilibrium(body, system, constrained, volumes, order)


_VOLUME = 1e-11  # relative error of a fluid's volume that counts as kept
_NEGATIVE, _MADE = "tangent.negative_pivots", "newton.factorisations"
_UNITS = {Load: "N", Weight: "m/s^2", Pressure: "Pa"}
_FEW = 6  # iterations after which the next load step is twice as large
_HALVINGS = 6  # of a Newton correction that inverts cells


@dataclass(frozen=True)
class StaticNewton:
    """Settings. `fluid` "exact" keeps every cavity at volume_ratio V0, "none" leaves it empty.

    `contraction` 0 makes a new factorisation at every iteration. `watch`: negative pivots of the
    tangent are counted anew when the body has moved so far, and in every load step under loads,
    where an unstable equilibrium is none.
    """

    handles: ClassVar[Handles] = LARGE_STATICS

    fluid: Literal["exact", "none"] = quantity(
        "exact", "1", "fluid of constant volume, or no fluid"
    )
    volume_ratio: float = quantity(1.0, "1", "volume of the fluid over that of the cavity at rest")
    tolerance: float = quantity(1e-9, "1", "residual relative to the acting forces")
    max_iterations: int = quantity(25, "1", "Newton iterations in a load step")
    max_cuts: int = quantity(6, "1", "number of halvings of a load step without equilibrium")
    contraction: float = quantity(
        0.2, "1", "ratio of successive errors up to which a factorisation is kept"
    )
    watch: float = quantity(
        0.01, "1", "motion between checks of the inertia, relative to the body's size"
    )

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not isinstance(asked, StillBody):
            return ()
        return (
            Rival("large strain, Newton every step", "large strain", lambda dt: StaticNewton(),
                   law=asked.law, finest=asked.coarse, shortest=asked.increment),
        )  # fmt: skip

    def __post_init__(self) -> None:
        if not self.volume_ratio > 0:
            raise SceneError(
                f"volume ratio {self.volume_ratio:g}: expected a positive fluid volume"
            )
        if not (self.tolerance > 0 and self.max_iterations >= 1 and self.max_cuts >= 0):
            raise SceneError(
                f"Newton with tolerance {self.tolerance:g}, {self.max_iterations} iterations, "
                f"{self.max_cuts} cuts: tolerance and iterations must be positive"
            )

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for a linear law or a body that can move rigidly."""
        scene = system.scene
        require_handled(scene, self)
        if not (scene.cavities or scene.inputs):
            raise SceneError("scene without drive, load and cavity: nothing moves; add one")
        problem = equilibrium(system, self.fluid == "exact" and bool(system.cavities))
        # The body at rest; `balance` refuses one that can move rigidly
        volumes, u = len(problem.rest_volumes), np.zeros(len(system.moves))
        balance = problem.balance(
            u, np.zeros(volumes), np.zeros(len(scene.inputs)), np.ones(volumes)
        )
        tangent = problem.tangent(balance)
        if tangent.factor.negative_pivots:
            raise SceneError(
                f"stiffness at rest has {tangent.factor.negative_pivots} negative pivots: an "
                "element is inverted; refine the mesh"
            )
        rest = Found(balance, tangent, factorisations=1)
        return NewtonStepper(self, problem, replace(rest, factorisations=0), _Memory(rest))


@dataclass(frozen=True)
class Found:
    """An equilibrium, the tangent near it, and what it took."""

    balance: Balance
    tangent: Tangent
    iterations: int = 0
    factorisations: int = 0


@dataclass(frozen=True)
class Failed:
    """Why a load step found none; `negative` is the most that a tangent on the way had."""

    ending: Ending
    why: str
    negative: int = 0


class _Memory:
    """The last equilibrium that was found: a step from it needs no new tangent. Only one is kept,
    because a factorisation of a large body takes gigabytes."""

    def __init__(self, last: Found) -> None:
        self.last = last


@dataclass(frozen=True)
class Loaded:
    """Displacements u (N,) m and pressures (c,) Pa in equilibrium under inputs (k + l,): drives in
    m, then loads in N and weights in m/s^2; at nu = 0.5 the multipliers (e, q) Pa of the cells."""

    u: Floats
    pressures: Floats
    inputs: Floats
    multipliers: Floats | None = None


@dataclass(frozen=True)
class NewtonStepper:
    settings: StaticNewton
    problem: Equilibrium
    start: Found
    memory: _Memory

    @property
    def scene(self) -> Scene:
        return self.problem.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """Plate forces, pressures, volumes, and what Newton did."""
        cavities = [c.name for c in self.scene.cavities]
        return (
            {f"{d.name}.force": "N" for d in self.scene.drives}
            | {f"{name}.pressure": "Pa" for name in cavities}
            | {f"{name}.volume_ratio": "1" for name in cavities}
            | {_NEGATIVE: "1", _MADE: "1"}
        )

    def rest(self) -> State:
        return self._state(0, self.start)

    def step(self, state: State, inputs: Floats) -> State:
        """From the state's load to the inputs (k + l,), at once or in parts of the way.

        A failure keeps the last load that was reached and says what stopped the body there.
        """
        target = np.full(len(state.inner.pressures), self.settings.volume_ratio)
        at: Loaded = state.inner
        if self.memory.last.balance.u is at.u:
            good = replace(self.memory.last, iterations=0, factorisations=0)
        else:
            balance = self.problem.balance(
                at.u, at.pressures, at.inputs, target, None, at.multipliers
            )
            good = Found(balance, self.problem.tangent(balance), factorisations=1)
        kept = not self.problem.constrained or np.abs(good.balance.ratios - target).max() <= _VOLUME
        if kept and (inputs == state.inner.inputs).all():
            numbers = MappingProxyType({**state.numbers, _MADE: 0.0})
            return replace(state, k=state.k + 1, updates=0, numbers=numbers)
        return self._walked(state.k, good, np.array(inputs, dtype=np.float64), target)

    def _walked(self, k: int, good: Found, inputs: Floats, target: Floats) -> State:
        """Load steps to `inputs`; each failure halves them, to 2^-max_cuts of the way at least,
        and each that takes few iterations doubles them again."""
        begin, ratios = good.balance.inputs, good.balance.ratios
        done, size = 0.0, 1.0
        while done < 1:
            share = min(done + size, 1.0)
            load = inputs if share == 1 else begin + share * (inputs - begin)
            found = self._load_step(good, load, ratios + share * (target - ratios))
            if isinstance(found, Found):
                work = good.iterations + found.iterations
                made = good.factorisations + found.factorisations
                good, done = replace(found, iterations=work, factorisations=made), share
                size *= 2 if found.iterations <= _FEW else 1
            elif size > 2.0**-self.settings.max_cuts:
                size /= 2
            else:
                scene = self.scene
                drives = [f"{1e3 * d:.4g} mm" for d in good.balance.inputs[: len(scene.drives)]]
                units = [_UNITS[type(x)] for x in scene.loads]
                loads = zip(good.balance.inputs[len(scene.drives) :], units, strict=True)
                load_words = ", ".join(drives + [f"{x:.4g} {unit}" for x, unit in loads])
                why = _stopped(found, load_words, done)
                return self._state(k, good, why)
        self.memory.last = good
        return self._state(k + 1, good)

    def _load_step(self, good: Found, inputs: Floats, target: Floats) -> Found | Failed:
        """One load step: linear prediction, corrections, and what the result must satisfy."""
        move = inputs - good.balance.inputs
        guess = self.problem.predicted(good.balance, good.tangent, move, target)
        at = self._forces(good.balance, replace(guess, inputs=inputs), target)
        if isinstance(at, Failed):
            return replace(at, negative=good.tangent.negative)
        try:
            found = self._corrected(replace(good, balance=at), target)
            return found if isinstance(found, Failed) else self._checked(found)
        except SceneError as vanished:
            return Failed("not_converged", str(vanished), negative=1)

    def _corrected(self, start: Found, target: Floats) -> Found | Failed:
        """Newton: a new tangent only where the old one no longer contracts."""
        at, tangent, made, negative = start.balance, start.tangent, 0, 0
        force, own, renew = at.acting, False, self.settings.contraction == 0
        for iteration in range(self.settings.max_iterations):
            if self._settled(at):
                return Found(at, tangent, iteration, made)
            if renew:
                tangent, made, own = self.problem.tangent(at), made + 1, True
                negative = max(negative, tangent.negative)
            new = self._taken(at, tangent, target)
            if isinstance(new, Failed) and own:
                return replace(new, negative=negative)
            shrinks = not isinstance(new, Failed) and new.merit(force) < at.merit(force)
            if isinstance(new, Balance) and (own or shrinks):
                renew = new.merit(force) > self.settings.contraction * at.merit(force)
                at, own = new, False
            else:
                renew = True
        if self._settled(at):
            return Found(at, tangent, self.settings.max_iterations, made)
        why = (
            f"residual {at.unbalanced / at.acting:.1e} after {self.settings.max_iterations} "
            f"iterations, tolerance {self.settings.tolerance:.1e}"
        )
        return Failed("not_converged", why, negative)

    def _taken(self, at: Balance, tangent: Tangent, target: Floats) -> Balance | Failed:
        """The correction, halved while it inverts cells."""
        full = self.problem.correction(at, tangent, target)
        for share in 0.5 ** np.arange(_HALVINGS + 1):
            u = at.u + share * (full.u - at.u)
            pressures = at.pressures + share * (full.pressures - at.pressures)
            new = self._forces(at, replace(full, u=u, pressures=pressures), target)
            if isinstance(new, Balance):
                break
        return new

    def _forces(self, last: Balance, at: Balance, target: Floats) -> Balance | Failed:
        """The balance at the unknowns of `at`, reached from `last`, unless cells are inverted."""
        body = self.problem.body
        bad = body.inverted(at.u)
        if bad:
            words = f"{bad.count} of {bad.points} quadrature points inverted (det F <= 0)"
            return Failed("invalid", f"{words}, first in element {bad.first}")
        stresses = body.holding(last.multipliers).extrapolated(last.u, at.u - last.u)
        multipliers = body.kept_pressures(stresses)
        return self.problem.balance(at.u, at.pressures, at.inputs, target, stresses, multipliers)

    def _settled(self, at: Balance) -> bool:
        return at.unbalanced <= self.settings.tolerance * at.acting and at.gap <= _VOLUME

    def _checked(self, found: Found) -> Found | Failed:
        """The law must hold there; the tangent is renewed where the body has moved on."""
        beyond = self.problem.body.beyond_the_law(found.balance.u)
        if beyond:
            return Failed("invalid", beyond)
        size = float(np.ptp(self.scene.mesh.nodes, axis=0).max())
        # Under dead loads a body may stand where it would not stay: looked at in every load step.
        watch = 0.0 if self.scene.loads else self.settings.watch * size
        if np.abs(found.balance.u - found.tangent.u).max() > watch:
            tangent = self.problem.tangent(replace(found.balance, stresses=None))
            found = replace(found, tangent=tangent, factorisations=found.factorisations + 1)
        if found.tangent.negative and self.scene.loads:
            return Failed("not_converged", "the equilibrium is unstable", found.tangent.negative)
        return found

    def _state(self, k: int, found: Found, failure: tuple[Ending, str] | None = None) -> State:
        at = found.balance
        at.u.setflags(write=False)
        numbers = (
            *self.problem.forces(at).tolist(),
            *at.pressures.tolist(),
            *at.ratios.tolist(),
            float(found.tangent.negative),
            float(found.factorisations),
        )
        named = MappingProxyType(dict(zip(self.units, numbers, strict=True)))
        reached = Loaded(at.u, at.pressures, at.inputs, at.multipliers)
        return State(k, reached, failure, found.iterations, named)

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        u: Floats = state.inner.u
        return u.reshape(self.scene.mesh.nodes.shape)


def _stopped(failed: Failed, load: str, done: float) -> tuple[Ending, str]:
    """The outcome of a step whose smallest load step failed, with the last good load."""
    reached = f"{load} ({100 * done:.3g} % of the step)"
    if BEYOND_LAW in failed.why:
        return failed.ending, (
            f"{failed.why}; last good load {reached}; use a law that is valid for such strains"
        )
    if failed.negative:
        words = f"tangent not positive definite ({failed.negative} negative pivots)"
        why = f"no static solution was found beyond {reached}: {words}; {failed.why}"
        return "not_converged", f"{why}; if the body snaps through there, use NewtonDynamics"
    helps = "more cuts or smaller steps"
    if failed.ending == "invalid":
        helps += ", or a finer mesh there"
    return failed.ending, f"{failed.why}; last good load {reached}; take {helps}"
