"""Modal superposition with static correction for truncated modes.

Every mode is q'' + c q' + w^2 q = f, stepped on its own: exactly for a force that is linear or
constant within the step, or by the rules of `newmark_rule` (all modes then equal Newmark itself).
Static correction: u += (K^-1 - sum phi phi^T / w^2) f, the modes left out answering at once.
Sources: Clough & Penzien (1993) for the method; paper 001, eqs 7-10, for the system.

Departures: a cut-off cluster of equal frequencies is taken whole, so there may be more modes than
asked for. The static correction has no rates: it gives no share of damping and inertia forces.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.critical import Modes
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.dynamic.linear import (
    Excitation,
    InertialStepper,
    Inputs,
    StartName,
    excitation,
    reactions,
)
from validate.solve.dynamic.newmark_rule import Rule, RuleName, per_mode, require_start
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled
from validate.solve.study_entries import Rates, Rival, Stepping, StudyBody, SwingingBody
from validate.solve.types import Scheme, State, Stepper

# --- Steps of q'' + c q' + w^2 q = f for many modes at once: exact ones, and Newmark's rules.
#
# Exact: for a force that is linear within the step, or held at its end value, whatever the step.


@dataclass(frozen=True)
class Walk:
    """The step of all modes (r,): new q and q' from q, q', q'' and the forces at both ends.

    `q` and `rate` hold one factor (r,) each of q, q', q'', the old and the new force; without
    `rate` the rule gives q' and q''.
    """

    modes: Modes
    q: tuple[Floats, ...]
    rate: tuple[Floats, ...] | None
    rule: Rule | None

    def step(
        self, q: Floats, v: Floats, a: Floats, f_old: Floats, f_new: Floats
    ) -> tuple[Floats, Floats, Floats]:
        given = (q, v, a, f_old, f_new)
        new = _sum(self.q, given)
        if self.rate is None:
            assert self.rule is not None
            return new, *self.rule.rates(new, q, v, a)
        rate = _sum(self.rate, given)
        return new, rate, f_new - self.modes.damping * rate - self.modes.omega**2 * new


def _sum(factors: tuple[Floats, ...], given: tuple[Floats, ...]) -> Floats:
    total = factors[0] * given[0]
    for factor, value in zip(factors[1:], given[1:], strict=True):
        total += factor * value
    return total


def walk_by_rule(modes: Modes, rule: Rule) -> Walk:
    q, v, a, f = per_mode(rule, modes.damping, modes.omega**2)
    # The excitation has weighted the forces of both ends already: one force a step.
    return Walk(modes, (q, v, a, 0 * f, f), None, rule)


def exact_walk(modes: Modes, h: float, force: str) -> Walk:
    """q = p + homogeneous solution from (q - p, q' - p'), p the particular one of f0 + f' t."""
    c, w2 = modes.damping, modes.omega**2
    qq, qv, vq, vv = _homogeneous(c, w2, h)
    still, none = 1 / w2, np.zeros_like(w2)
    if force == "constant":
        return Walk(
            modes, (qq, qv, none, none, still * (1 - qq)), (vq, vv, none, none, -still * vq), None
        )
    lag, rise = c / w2**2 / h, 1 / w2 / h
    # p(0) = f_old/w^2 - lag (f_new - f_old), p(h) = f_new/w^2 - the same, p' = rise (f_new - f_old)
    q_new = still - lag + qq * lag - qv * rise
    q_old = lag - qq * (still + lag) + qv * rise
    v_new = rise + vq * lag - vv * rise
    v_old = -rise - vq * (still + lag) + vv * rise
    return Walk(modes, (qq, qv, none, q_old, q_new), (vq, vv, none, v_old, v_new), None)


def _homogeneous(c: Floats, w2: Floats, h: float) -> tuple[Floats, Floats, Floats, Floats]:
    """q, q' after h from q = 1 and from q' = 1 of q'' + c q' + w2 q = 0, overdamped or not.

    The smaller root is w2 over the larger one: their difference would lose its digits.
    """
    half = np.sqrt((c / 2).astype(complex) ** 2 - w2)
    fast = -c / 2 - half
    slow = w2 / fast
    e_slow, e_fast = np.exp(slow * h), np.exp(fast * h)
    gap = slow - fast
    close = np.abs(gap * h) < 1e-4
    series = h * np.exp(-c * h / 2) * (1 + (gap * h) ** 2 / 24)
    phi = np.where(close, series, (e_slow - e_fast) / np.where(close, 1.0, gap))
    rows = e_fast - fast * phi, phi, -w2 * phi, e_fast + slow * phi
    qq, qv, vq, vv = (np.ascontiguousarray(x.real) for x in rows)
    return qq, qv, vq, vv


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Modal:
    """Settings of the lowest modes, each stepped on its own.

    `propagate`: "linear" and "constant" are exact for forces linear within the step or held at
    its end value; the others are Newmark's rules per mode. `a0` as in `Newmark`: with
    "equilibrium" the loads of the first step already act at t = 0, with "zero" they rise there.
    """

    handles: ClassVar[Handles] = LINEAR_DYNAMICS

    dt: float = quantity(0.002, "s", "time step")
    modes: int | None = quantity(None, "1", "lowest modes kept; none: all")
    propagate: Literal["linear", "constant", RuleName] = quantity(
        "linear", "1", "exact for a force linear or constant in a step, or a rule"
    )
    static_correction: bool = quantity(True, "1", "omitted modes respond statically")
    a0: StartName = quantity("equilibrium", "1", "acceleration at t = 0, as in `Newmark`")
    rho_inf: float = quantity(0.8, "1", "spectral radius at infinity; generalised alpha alone")

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        """Every mode by its own solution: there is no error in the step."""
        return (Stepping("modal", "all modes, each exactly", "consistent", _exact, order=0.0),)

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not isinstance(asked, SwingingBody):
            return ()
        return tuple(
            Rival(f"{count} modes", "modal", _of_modes(count), stepped=False) for count in (10, 40)
        )

    def __post_init__(self) -> None:
        Rule.of("average", self.dt, self.rho_inf)
        if self.modes is not None and self.modes < 1:
            raise SceneError(f"{self.modes} modes: expected at least 1")

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for laws at large strain, cavities, damping that couples modes."""
        require_handled(system.scene, self)
        modes = Modes.of(system, self.modes)
        exact = self.propagate in ("linear", "constant")
        name: RuleName = "average" if exact else self.propagate  # type: ignore[assignment]
        rule = Rule.of(name, self.dt, self.rho_inf)
        if not exact and self.a0 == "equilibrium" and system.scene.loads:
            require_start(system, rule, "consistent")
        excited = excitation(system, rule)
        walk = exact_walk(modes, self.dt, self.propagate) if exact else walk_by_rule(modes, rule)
        # Forces (m, l + 3 k) of unit loads, drives, their rates and accelerations
        columns = np.hstack([excited.loads, -excited.stiffness, -excited.damping, -excited.mass])
        rest = left_out(system, modes, columns) if self.static_correction else None
        rows, at_once = reactions(system), self.a0 == "equilibrium"
        forces = np.ascontiguousarray(modes.shapes.T @ columns)
        # Reaction rows of K, C and M on the mode shapes, (k, r) each
        free = system.free
        K, C, M = (np.asarray(R[:, free] @ modes.shapes) for R in (rows.K, rows.C, rows.M))
        projected = K, C, M
        return ModalStepper(system, rows, modes, excited, walk, forces, rest, projected, at_once)


def left_out(system: System, modes: Modes, forces: Floats) -> Floats:
    """Static displacements (m, c) of the modes that are cut off, under forces (m, c) N."""
    if modes.shapes.shape[0] == modes.shapes.shape[1]:
        return np.zeros_like(forces)
    kept = modes.shapes @ ((modes.shapes.T @ forces) / modes.omega[:, None] ** 2)
    return np.asarray(system.factor().solve(forces) - kept)


@dataclass(frozen=True)
class ModalState:
    """Modal coordinates, rates, accelerations (r,); inputs, also as one `signal` (l + 3 k,)."""

    q: Floats
    v: Floats
    a: Floats
    inputs: Inputs
    signal: Floats


@dataclass(frozen=True)
class ModalStepper(InertialStepper):
    """States keep modal coordinates; the field is formed when it is asked for.

    `forces_on` (r, l + 3 k) are those on the modes, `left_out` (m, l + 3 k) the displacements of
    the modes cut off, `projected` (k, r) the drives' rows of K, C, M on the shapes.
    """

    modes: Modes
    excitation: Excitation
    walk: Walk
    forces_on: Floats
    left_out: Floats | None
    projected: tuple[Floats, Floats, Floats]
    equilibrium: bool

    def rest(self) -> State:
        zeros, signal = np.zeros(len(self.modes.omega)), np.zeros(self.forces_on.shape[1])
        return State(0, ModalState(zeros, zeros, zeros, self.excitation.rest(), signal))

    def step(self, state: State, inputs: Floats) -> State:
        """Return the state at the end of a step; `inputs` are those there, loads included."""
        last: ModalState = state.inner
        k, a, old = state.k + 1, last.a, last.signal
        moved = self.excitation.moved(k, inputs, last.inputs)
        new = np.concatenate([moved.loads, moved.q, moved.rate, moved.acceleration])
        if k == 1 and self.equilibrium:
            old = old.copy()
            old[: len(moved.loads)] = moved.loads
            a = self.forces_on @ old
        q, v, a = self.walk.step(last.q, last.v, a, *self._ends(old, new))
        inner = ModalState(q, v, a, moved, new)
        rows, (K, C, M) = self.reactions, self.projected
        if not rows.names:
            return State(k, inner, numbers={})
        moves = self.system.moves
        driven = rows.numbers(moves @ moved.q, moves @ moved.rate, moves @ moved.acceleration,
                              moved.loads)  # fmt: skip
        forces = K @ q + C @ v + M @ a
        if self.left_out is not None:
            forces = forces + rows.K[:, self.system.free] @ (self.left_out @ new)
        shares = rows.named(forces)
        return State(k, inner, numbers={name: driven[name] + shares[name] for name in driven})

    def _ends(self, old: Floats, new: Floats) -> tuple[Floats, Floats]:
        """Modal forces at both ends; for a rule the one force of its balance, given as new."""
        rule = self.walk.rule
        if rule is None:
            return self.forces_on @ old, self.forces_on @ new
        mixed = rule.weighted(new, old)
        if self.reactions.names and rule.am != 0:
            k = len(self.reactions.names)
            mixed[-k:] = rule.weighted_a(new, old)[-k:]
        f = self.forces_on @ mixed
        return f, f

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        modal: ModalState = state.inner
        u = self.modes.shapes @ modal.q
        u = u if self.left_out is None else u + self.left_out @ modal.signal
        return self.nodal(u, modal.inputs.q)


def _of_modes(count: int) -> Callable[[float], Scheme]:
    return lambda dt: Modal(dt, modes=count, propagate="constant")


def _exact(r: Rates) -> Floats:
    """Larger |e^(lambda h)| of every mode (r, 1, 1), its real root without cancellation."""
    c, k = r.c("full"), r.x**2
    root = np.sqrt(np.maximum(c * c - 4 * k, 0.0))
    real = np.where(root > 0, -2 * k / (c + root + (root == 0)), -c / 2)
    return np.asarray(np.exp(real))[:, None, None]
