"""Modal superposition: u = sum of mode shapes times coordinates, plus statics of what is cut off.

Every mode is q'' + c q' + w^2 q = f, stepped on its own: exactly for a force that is linear or
constant within the step, or by the rules of `newmark_rule` (all modes then equal Newmark itself).
Static correction: u += (K^-1 - sum phi phi^T / w^2) f, the modes left out answering at once.
Sources: Clough & Penzien (1993) for the method; paper 001, eqs 7-10, for the system.

Departures: a cut-off cluster of equal frequencies is taken whole, so there may be more modes than
asked for. The static correction has no rates: it gives no share of damping and inertia forces.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System
from validate.solve.dynamic import (
    InertialStepper,
    Reactions,
    StartName,
    reactions,
    require_linear,
    spread,
)
from validate.solve.newmark_rule import (
    Excitation,
    Motion,
    Rule,
    RuleName,
    excitation,
    per_mode,
    rule_of,
)
from validate.solve.types import State, Stepper

_CLUSTER = 1e-3  # relative distance of frequencies that are taken as one cluster
_COUPLED = 1e-8  # of the damping: rounding leaves 1e-12, other materials' damping far more
_DENSE = 1500  # free unknowns up to which all modes together are cheaper than some


@dataclass(frozen=True)
class Modes:
    """Shapes (m, r), M-orthonormal over the free unknowns, frequencies 1/s and dampings 1/s."""

    shapes: Floats
    omega: Floats
    damping: Floats


@dataclass(frozen=True)
class Modal:
    """The lowest `modes` modes (None: all) in steps of dt s.

    `propagate`: "linear" and "constant" are exact for forces linear within the step or held at
    its end value; the others are Newmark's rules per mode. `a0` as in `Newmark`: with
    "equilibrium" the loads of the first step already act at t = 0, with "zero" they rise there.
    """

    dt: float = 0.002
    modes: int | None = None
    propagate: Literal["linear", "constant"] | RuleName = "linear"
    static_correction: bool = True
    a0: StartName = "equilibrium"
    rho_inf: float = 0.8

    def __post_init__(self) -> None:
        rule_of("average", self.dt, self.rho_inf)
        if self.modes is not None and self.modes < 1:
            raise SceneError(f"{self.modes} modes: at least 1")

    def prepare(self, system: System) -> Stepper:
        """Raises `SceneError` for a law at large strain, cavities, or damping that couples modes."""
        require_linear(system)
        modes = modes_of(system, self.modes)
        exact = self.propagate in ("linear", "constant")
        name: RuleName = "average" if exact else self.propagate  # type: ignore[assignment]
        rule = rule_of(name, self.dt, self.rho_inf)
        excited = excitation(system, rule)
        walk = _exact(modes, self.dt, self.propagate) if exact else _by_rule(modes, rule)
        rest = _left_out(system, modes, excited) if self.static_correction else None
        rows = reactions(system)
        projected = _projected(system, rows, modes)
        return ModalStepper(
            system, rows, modes, excited, walk, rest, projected, self.a0 == "equilibrium"
        )


def modes_of(system: System, count: int | None = None) -> Modes:
    """The lowest modes, with the whole of the last cluster of equal frequencies.

    Raises `SceneError` for more modes than unknowns or a C that they do not make diagonal.
    """
    free = system.free
    m = len(free)
    wanted = m if count is None else count
    if wanted > m:
        raise SceneError(f"{wanted} modes of {m} unknowns: at most {m}")
    squares, shapes = _lowest(system, wanted)
    omega = np.sqrt(squares)
    end = wanted
    while end < len(omega) and omega[end] <= omega[wanted - 1] * (1 + _CLUSTER):
        end += 1
    shapes, omega = np.ascontiguousarray(shapes[:, :end]), omega[:end]
    C = shapes.T @ (system.C[free][:, free] @ shapes)
    damping = np.diag(C).copy()
    if np.abs(C - np.diag(damping)).max() > _COUPLED * max(float(np.abs(C).max()), 1e-300):
        raise SceneError(
            "the damping couples the modes (regions damped differently); use Newmark, or one "
            "mass_damping and stiffness_damping for all materials"
        )
    return Modes(shapes, omega, damping)


def _lowest(system: System, wanted: int) -> tuple[Floats, Floats]:
    """Squares of frequencies and shapes, rising: a few more than wanted, or all."""
    free = system.free
    K, M = (X[free][:, free].tocsc() for X in (system.K, system.M))
    spare = wanted + max(8, wanted // 10)
    if len(free) <= _DENSE or spare >= len(free) - 1:
        squares, shapes = eigh(K.toarray(), M.toarray())
    else:
        start = np.random.default_rng(0).standard_normal(len(free))
        squares, shapes = eigsh(K, k=spare, M=M, sigma=0.0, which="LM", v0=start)
    order = np.argsort(squares)
    return np.asarray(squares)[order], np.asarray(shapes)[:, order]


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


def _by_rule(modes: Modes, rule: Rule) -> Walk:
    q, v, a, f = per_mode(rule, modes.damping, modes.omega**2)
    # The excitation has weighted the forces of both ends already: one force a step.
    return Walk(modes, (q, v, a, 0 * f, f), None, rule)


def _exact(modes: Modes, h: float, force: str) -> Walk:
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


def _columns(excited: Excitation) -> Floats:
    """Forces (m, l + 3 k) of unit loads, drives, their rates and accelerations."""
    return np.hstack([excited.loads, -excited.stiffness, -excited.damping, -excited.mass])


def _left_out(system: System, modes: Modes, excited: Excitation) -> Floats:
    """Static displacements (m, l + 3 k) of the modes that are cut off, per unit of excitation."""
    forces = _columns(excited)
    if modes.shapes.shape[0] == modes.shapes.shape[1]:
        return np.zeros_like(forces)
    kept = modes.shapes @ ((modes.shapes.T @ forces) / modes.omega[:, None] ** 2)
    return np.asarray(system.factor().solve(forces) - kept)


def _projected(system: System, rows: Reactions, modes: Modes) -> tuple[Floats, Floats, Floats]:
    """Reaction rows of K, C and M on the mode shapes, (k, r) each."""
    free = system.free
    K, C, M = (np.asarray(R[:, free] @ modes.shapes) for R in (rows.K, rows.C, rows.M))
    return K, C, M


@dataclass(frozen=True)
class ModalState:
    """Modal coordinates, rates, accelerations (r,), the drives' motion, statics (l + 3 k,)."""

    q: Floats
    v: Floats
    a: Floats
    motion: Motion
    signal: Floats


@dataclass(frozen=True)
class ModalStepper(InertialStepper):
    """States keep modal coordinates; the field is formed when it is asked for."""

    modes: Modes
    excitation: Excitation
    walk: Walk
    left_out: Floats | None
    projected: tuple[Floats, Floats, Floats]
    equilibrium: bool

    def __post_init__(self) -> None:
        modal = np.ascontiguousarray(self.modes.shapes.T @ _columns(self.excitation))
        object.__setattr__(self, "_forces", modal)

    _forces: Floats = np.zeros((0, 0))

    def rest(self) -> State:
        r, motion = len(self.modes.omega), self.excitation.rest()
        zeros, inputs = np.zeros(r), np.zeros(len(self.scene.inputs))
        signal = np.zeros(self._forces.shape[1])
        start = ModalState(zeros, zeros, zeros, motion, signal)
        numbers = self.reactions.named(np.zeros(self._drives))
        return self._state(inputs, 0, numbers=numbers, extra=start)

    def step(self, state: State, drives: Floats) -> State:
        """The state at the end of a step; `drives` are the inputs there, loads included."""
        last: ModalState = state.extra
        k, a = self._drives, last.a
        moved = self.excitation.moved(last.motion, drives[:k])
        new, old = _signal(drives[k:], moved), last.signal
        if state.k == 0 and self.equilibrium:
            old = old.copy()
            old[: len(drives) - k] = drives[k:]
            a = self._forces @ old
        f_old, f_new = self._ends(old, new)
        q, v, a = self.walk.step(last.q, last.v, a, f_old, f_new)
        extra = ModalState(q, v, a, moved, new)
        numbers = self._forces_of_drives(extra, drives[k:]) if k else {}
        return self._state(drives, state.k + 1, numbers=numbers, extra=extra)

    def _ends(self, old: Floats, new: Floats) -> tuple[Floats, Floats]:
        """Modal forces at both ends; for a rule the one force of its balance, given as new."""
        rule = self.walk.rule
        if rule is None:
            return self._forces @ old, self._forces @ new
        mixed = rule.weighted(new, old)
        if self._drives and rule.am != 0:
            mixed[-self._drives :] = rule.weighted_a(new, old)[-self._drives :]
        f = self._forces @ mixed
        return f, f

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        u = spread(self.system, self._free(state.extra), state.extra.motion.q)
        return u.reshape(self.scene.mesh.nodes.shape)

    def _free(self, modal: ModalState) -> Floats:
        u = self.modes.shapes @ modal.q
        return u if self.left_out is None else u + self.left_out @ modal.signal

    def _forces_of_drives(self, modal: ModalState, loads: Floats) -> dict[str, float]:
        rows, (K, C, M), motion = self.reactions, self.projected, modal.motion
        moves = self.system.moves
        driven = rows.numbers(
            moves @ motion.q, moves @ motion.rate, moves @ motion.acceleration, loads
        )
        forces = K @ modal.q + C @ modal.v + M @ modal.a
        if self.left_out is not None:
            forces = forces + rows.K[:, self.system.free] @ (self.left_out @ modal.signal)
        shares = rows.named(forces)
        return {name: driven[name] + shares[name] for name in driven}


def _signal(loads: Floats, motion: Motion) -> Floats:
    return np.concatenate([loads, motion.q, motion.rate, motion.acceleration])
