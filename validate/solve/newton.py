"""Static Newton for large strain: load steps with cut-back, line search, reused factorisations.

Departures from a textbook Newton: a factorisation is kept, across steps too, while every iteration
shrinks the error by `contraction` or better (Shamanskii 1967); the last one is remembered together
with the state it led to, so that stepping on from there needs no new one. Results depend on that
memory within the tolerance only.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.equilibrium import Balance, Equilibrium, Tangent, equilibrium
from validate.solve.handles import LARGE_STATICS, Handles, require_handled
from validate.solve.types import Ending, State, Stepper

_VOLUME = 1e-11  # relative error of a fluid's volume that counts as kept
_NEGATIVE, _MADE = "tangent.negative_pivots", "newton.factorisations"
_HALVINGS = 8  # of a Newton correction in the line search


@dataclass(frozen=True)
class StaticNewton:
    """Settings. `fluid` "exact" keeps every cavity at volume_ratio V0, "none" leaves it empty.

    `contraction` 0 makes a new factorisation at every iteration. `watch`: negative pivots of the
    tangent are counted anew when drives have moved so far.
    """

    handles: ClassVar[Handles] = LARGE_STATICS

    fluid: Literal["exact", "none"] = quantity("exact", "1", "keeps its volume, or is not there")
    volume_ratio: float = quantity(1.0, "1", "volume of the fluid over that of the cavity at rest")
    tolerance: float = quantity(1e-9, "1", "residual, of the forces that act")
    max_iterations: int = quantity(25, "1", "of Newton in a load step")
    max_cuts: int = quantity(6, "1", "times that a load step without equilibrium is halved")
    contraction: float = quantity(0.2, "1", "of the error, that keeps a factorisation")
    watch: float = quantity(0.01, "1", "motion between looks at the inertia, of the body's size")

    def __post_init__(self) -> None:
        if not self.volume_ratio > 0:
            raise SceneError(f"volume ratio {self.volume_ratio:g}: a fluid volume must be positive")
        if not (self.tolerance > 0 and self.max_iterations >= 1 and self.max_cuts >= 0):
            raise SceneError(
                f"Newton with tolerance {self.tolerance:g}, {self.max_iterations} iterations, "
                f"{self.max_cuts} cuts: tolerance and iterations must be positive"
            )

    def prepare(self, system: System) -> Stepper:
        """Raises `SceneError` for a linear law or a body that can move rigidly."""
        scene = system.scene
        require_handled(scene, self)
        if not (scene.cavities or scene.drives):
            raise SceneError("scene without drive and cavity: nothing moves")
        problem = equilibrium(system, self.fluid == "exact" and bool(system.cavities))
        rest = _rest(problem)
        return NewtonStepper(self, problem, replace(rest, factorisations=0), _Memory(rest))


@dataclass(frozen=True)
class Found:
    """An equilibrium, the tangent near it, and what it took."""

    balance: Balance
    tangent: Tangent
    drives: Floats
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


def _rest(problem: Equilibrium) -> Found:
    """The body at rest; `SceneError` where it can move rigidly."""
    cavities, k = len(problem.rest_volumes), len(problem.system.scene.drives)
    u, ones = np.zeros(len(problem.system.moves)), np.ones(cavities)
    balance = problem.balance(u, np.zeros(cavities), ones)
    tangent = problem.tangent(balance, np.zeros(k))
    if tangent.factor.negative_pivots:
        raise SceneError(
            f"stiffness at rest has {tangent.factor.negative_pivots} negative pivots: an element "
            "is inverted; refine the mesh"
        )
    return Found(balance, tangent, np.zeros(k), factorisations=1)


@dataclass(frozen=True)
class Loaded:
    """Displacements u (N,) m and pressures (c,) Pa in equilibrium under drives (k,) m."""

    u: Floats
    pressures: Floats
    drives: Floats


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
        """From the state's load to drives (k,) m, at once or in halves of the way.

        A failure keeps the last load that was reached and says what stopped the body there.
        """
        target = np.full(len(state.inner.pressures), self.settings.volume_ratio)
        good = self._known(state.inner, target)
        kept = not self.problem.constrained or np.abs(good.balance.ratios - target).max() <= _VOLUME
        if kept and (inputs == state.inner.drives).all():
            numbers = MappingProxyType({**state.numbers, _MADE: 0.0})
            return replace(state, k=state.k + 1, updates=0, numbers=numbers)
        return self._walked(state.k, good, np.array(inputs, dtype=np.float64), target)

    def _known(self, at: Loaded, target: Floats) -> Found:
        """The equilibrium of a state: remembered, or its forces and tangent made again."""
        if self.memory.last.balance.u is at.u:
            return replace(self.memory.last, iterations=0, factorisations=0)
        balance = self.problem.balance(at.u, at.pressures, target)
        tangent = self.problem.tangent(balance, at.drives)
        return Found(balance, tangent, at.drives, factorisations=1)

    def _walked(self, k: int, good: Found, drives: Floats, target: Floats) -> State:
        """Load steps to `drives`; each failure halves them, to 2^-max_cuts of the way at least."""
        begin, ratios = good.drives, good.balance.ratios
        done, size = 0.0, 1.0
        while done < 1:
            share = min(done + size, 1.0)
            load = drives if share == 1 else begin + share * (drives - begin)
            found = self._load_step(good, load, ratios + share * (target - ratios))
            if isinstance(found, Found):
                good, done = _added(good, found), share
            elif size > 2.0**-self.settings.max_cuts:
                size /= 2
            else:
                return self._state(k, good, _stopped(found, good.drives))
        self.memory.last = good
        return self._state(k + 1, good)

    def _load_step(self, good: Found, drives: Floats, target: Floats) -> Found | Failed:
        """One load step: linear prediction, corrections, and what the result must satisfy."""
        move = drives - good.drives
        at = self._forces(self.problem.predicted(good.balance, good.tangent, move, target), target)
        if isinstance(at, Failed):
            return replace(at, negative=good.tangent.negative)
        try:
            found = self._corrected(replace(good, balance=at, drives=drives), target)
            return found if isinstance(found, Failed) else self._checked(found)
        except SceneError as vanished:
            return Failed("not_converged", str(vanished), negative=1)

    def _corrected(self, start: Found, target: Floats) -> Found | Failed:
        """Newton: a new tangent only where the old one no longer contracts."""
        at, tangent, made, negative = start.balance, start.tangent, 0, 0
        force, own, renew = at.acting, False, self.settings.contraction == 0
        for iteration in range(self.settings.max_iterations):
            if self._settled(at):
                return Found(at, tangent, start.drives, iteration, made)
            if renew:
                tangent, made, own = self.problem.tangent(at, start.drives), made + 1, True
                negative = max(negative, tangent.negative)
            new = self._searched(at, tangent, target, force, halvings=_HALVINGS if own else 0)
            if new is None and own:
                why = f"no step lowers the residual {at.unbalanced / at.acting:.1e}"
                return Failed("not_converged", why, negative)
            renew = new is None or new.merit(force) > self.settings.contraction * at.merit(force)
            at, own = new or at, False
        if self._settled(at):
            return Found(at, tangent, start.drives, self.settings.max_iterations, made)
        why = (
            f"residual {at.unbalanced / at.acting:.1e} after {self.settings.max_iterations} "
            f"iterations, tolerance {self.settings.tolerance:.1e}"
        )
        return Failed("not_converged", why, negative)

    def _searched(
        self, at: Balance, tangent: Tangent, target: Floats, force: float, halvings: int
    ) -> Balance | None:
        """The correction, halved until it lowers the merit and inverts nothing; None: it never."""
        full = self.problem.correction(at, tangent, target)
        for share in 0.5 ** np.arange(halvings + 1):
            u = at.u + share * (full.u - at.u)
            pressures = at.pressures + share * (full.pressures - at.pressures)
            new = self._forces(replace(full, u=u, pressures=pressures), target)
            if isinstance(new, Balance) and new.merit(force) < at.merit(force):
                return new
        return None

    def _forces(self, at: Balance, target: Floats) -> Balance | Failed:
        """The balance at the displacements and pressures of `at`, unless cells are inverted."""
        bad = self.problem.body.inverted(at.u)
        if bad:
            words = f"{bad.count} of {bad.points} quadrature points inverted (det F <= 0)"
            return Failed("invalid", f"{words}, first in element {bad.first}")
        return self.problem.balance(at.u, at.pressures, target)

    def _settled(self, at: Balance) -> bool:
        return at.unbalanced <= self.settings.tolerance * at.acting and at.gap <= _VOLUME

    def _checked(self, found: Found) -> Found | Failed:
        """The law must hold there; the tangent is renewed where the body has moved on."""
        beyond = self.problem.body.beyond_the_law(found.balance.u)
        if beyond:
            return Failed("invalid", beyond)
        size = float(np.ptp(self.scene.mesh.nodes, axis=0).max())
        moved = np.abs(found.drives - found.tangent.inputs).max(initial=0.0)
        if moved <= self.settings.watch * size:
            return found
        tangent = self.problem.tangent(found.balance, found.drives)
        return replace(found, tangent=tangent, factorisations=found.factorisations + 1)

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
        return State(k, Loaded(at.u, at.pressures, found.drives), failure, found.iterations, named)

    def field(self, state: State) -> Floats:
        """Displacements (n, 3) m of all nodes."""
        u: Floats = state.inner.u
        return u.reshape(-1, 3)


def _added(before: Found, found: Found) -> Found:
    """`found` with the work of the load steps before it."""
    return replace(
        found,
        iterations=before.iterations + found.iterations,
        factorisations=before.factorisations + found.factorisations,
    )


def _stopped(failed: Failed, drives: Floats) -> tuple[Ending, str]:
    """The outcome of a step whose smallest load step failed, with the last good load."""
    load = ", ".join(f"{1e3 * d:.4g}" for d in drives)
    if failed.negative and "validity" not in failed.why:
        words = f"tangent not positive definite ({failed.negative} negative pivots)"
        return "not_converged", f"no static solution beyond {load} mm: {words}; {failed.why}"
    return failed.ending, f"{failed.why}; last good load {load} mm"
