"""Linear dynamics: forces and starts of a motion, and what all linear steppers share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.linear_solvers.factor import factorise
from validate.fem.system import DampingTerms, MassName, System, damping_of, mass_of
from validate.scene.scene import Drive, Scene
from validate.solve.dynamic.newmark_rule import Rule
from validate.solve.types import State

StartName = Literal["equilibrium", "zero"]
DriveRates = Literal["difference", "rule", "given"]


@dataclass(frozen=True)
class Inputs:
    """At the end of a step: drives q (k,) m, their rates m/s and accelerations m/s^2, and loads
    (l,) N."""

    q: Floats
    rate: Floats
    acceleration: Floats
    loads: Floats


@dataclass(frozen=True)
class Excitation:
    """Effect of inputs on the free unknowns: columns of loads (m, l) and of drives (m, k).

    Prescribed unknowns are coupled by K, C and M. Their `rates`: "rule" by the rule's formulas
    (which average acceleration makes ring, growing, on a ramp), "difference" by backward
    differences: the rate of second order, the acceleration one step late; "given" are the drives'
    own `speeds`, whose jumps have no acceleration. `starts` (m, l) are the accelerations at rest
    per newton of load, None for a body that starts without them.
    """

    rule: Rule
    loads: Floats
    stiffness: Floats
    damping: Floats
    mass: Floats
    starts: Floats | None
    rates: DriveRates = "difference"
    given: tuple[Drive, ...] = ()

    @property
    def drives(self) -> int:
        return int(self.stiffness.shape[1])

    def rest(self) -> Inputs:
        zeros = np.zeros(self.drives)
        return Inputs(zeros, zeros, zeros, np.zeros(self.loads.shape[1]))

    def step(self, k: int, new: Floats, last: Inputs, a: Floats) -> tuple[Floats, Inputs, Floats]:
        """Forces (m,) N of step k = 1, 2, ... to the inputs `new` (k + l,): drives m, loads N.

        With them what the inputs are at its end, and the accelerations (m,) it begins with: those
        of the state, `a`, unless loads are switched on at t = 0.
        """
        moved = self.moved(k, new, last)
        if k == 1 and self.starts is not None:
            last, a = replace(last, loads=moved.loads), self.starts @ moved.loads
        return self.force(moved, last), moved, a

    def walk(self, inputs: Floats) -> tuple[Floats, Floats, Floats]:
        """Of a whole run from rest to inputs (nt, k + l): forces (nt, m) N of its steps, drives
        (nt, k) m, and the accelerations (m,) it begins with."""
        last, passed = self.rest(), []
        for k, new in enumerate(inputs, 1):
            passed.append(last := self.moved(k, new, last))
        first, begin = self.rest(), np.zeros(len(self.loads))
        if self.starts is not None and passed:
            first, begin = replace(first, loads=passed[0].loads), self.starts @ passed[0].loads
        new, old = _columns(passed), _columns([first, *passed[:-1]])
        return np.ascontiguousarray(self.force(new, old).T), new.q.T, begin

    def moved(self, k: int, new: Floats, last: Inputs) -> Inputs:
        """What the inputs are at the end of step k, which takes them to `new` (k + l,)."""
        h, q, loads = self.rule.h, new[: self.drives], new[self.drives :]
        if not self.drives:
            return Inputs(q, q, q, loads)
        if self.rates == "given":
            # The planned velocities m/s, at a jump those behind it; 1e-6 h is no difference.
            until = k * h + 1e-6 * h
            passed = [[v for start, v in d.speeds if start <= until] for d in self.given]
            speeds = np.array([given[-1] if given else 0.0 for given in passed])
            return Inputs(q, speeds, np.zeros_like(speeds), loads)
        if self.rates == "rule":
            return Inputs(q, *self.rule.rates(q, last.q, last.rate, last.acceleration), loads)
        mean, before = (q - last.q) / h, last.rate - h / 2 * last.acceleration
        acceleration = (mean - before) / h
        return Inputs(q, mean + h / 2 * acceleration, acceleration, loads)

    def force(self, new: Inputs, old: Inputs) -> Floats:
        """Forces (m,) N at the balance of a step between two inputs."""
        r, f = self.rule, self.loads @ self.rule.weighted(new.loads, old.loads)
        if not self.drives:
            return np.asarray(f)
        f = f - self.stiffness @ r.weighted(new.q, old.q)
        f -= self.damping @ r.weighted(new.rate, old.rate)
        f -= self.mass @ r.weighted_a(new.acceleration, old.acceleration)
        return np.asarray(f)


def _columns(of: Sequence[Inputs]) -> Inputs:
    """Many steps' inputs, a column each."""
    parts = ((i.q, i.rate, i.acceleration, i.loads) for i in of)
    return Inputs(*(np.array(part).T for part in zip(*parts, strict=True)))


def excitation(
    system: System,
    rule: Rule,
    mass: MassName = "consistent",
    rates: DriveRates = "difference",
    terms: DampingTerms = "full",
    a0: StartName = "zero",
) -> Excitation:
    """Columns of the system's loads and drives over its free unknowns.

    Raises `SceneError` for rates "given" of a drive without `speeds`.
    """
    given = system.scene.drives if rates == "given" else ()
    for drive in given:
        if not drive.speeds:
            raise SceneError(f"drive '{drive.name}' has no speeds; use drive_rates = difference")
    matrices = system.K, damping_of(system, mass, terms), mass_of(system, mass)
    K, C, M = (np.ascontiguousarray((X @ system.moves)[system.free]) for X in matrices)
    loads = np.ascontiguousarray(system.loads[system.free])
    starts = starting_accelerations(system, mass) if a0 == "equilibrium" else None
    return Excitation(rule, loads, K, C, M, starts, rates, given)


def starting_accelerations(system: System, mass: MassName = "consistent") -> Floats:
    """M^-1 f (m, l) m/s^2 that one unit of each load gives the body at rest."""
    free, mesh = system.free, system.scene.mesh
    loads = system.loads[free]
    if mass == "lumped":
        return np.asarray(loads / system.masses[free][:, None])
    return factorise(system.M[free][:, free], free // mesh.dimension, mesh.nodes).solve(loads)


@dataclass(frozen=True)
class Reactions:
    """Plate forces on the body along each drive: rows (k, N) of K, C and M, and of loads (k, l)."""

    names: tuple[str, ...]
    copies: int
    K: Floats
    C: Floats
    M: Floats
    loads: Floats

    def numbers(self, u: Floats, v: Floats, a: Floats, loads: Floats) -> Mapping[str, float]:
        """`<drive>.force` N, compression positive, with damping and inertia; u, v, a (N,)."""
        if not self.names:
            return {}
        return self.named(self.K @ u + self.C @ v + self.M @ a - self.loads @ loads)

    def named(self, forces: Floats) -> Mapping[str, float]:
        """Return the forces (k,) N of the mesh as those on the whole body, by trace name."""
        return {
            f"{name}.force": self.copies * float(force)
            for name, force in zip(self.names, forces, strict=True)
        }


def reactions(
    system: System, mass: MassName | None = "consistent", terms: DampingTerms = "full"
) -> Reactions:
    """Rows of the drives' forces; `mass` None for a scheme without rates: no M, no C is made."""
    rows, names = system.moves.T, tuple(d.name for d in system.scene.drives)
    still = np.zeros_like(rows)
    C = still if mass is None else rows @ damping_of(system, mass, terms)
    M = still if mass is None else rows @ mass_of(system, mass)
    return Reactions(names, system.scene.copies, rows @ system.K, C, M, rows @ system.loads)


@dataclass(frozen=True)
class Moving:
    """Displacements, velocities, accelerations (m,) of the free unknowns, and the inputs."""

    u: Floats
    v: Floats
    a: Floats
    inputs: Inputs


@dataclass(frozen=True)
class InertialStepper:
    """Base of steppers whose states tell the drives' forces."""

    system: System
    reactions: Reactions

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """`<drive>.force` N, compression positive."""
        return {f"{name}.force": "N" for name in self.reactions.names}

    def forces(self, u: Floats, v: Floats, a: Floats, inputs: Inputs) -> Mapping[str, float]:
        """Return the drives' forces at u, v, a (m,) of the free unknowns."""
        if not self.reactions.names:
            return {}
        driven = inputs.q, inputs.rate, inputs.acceleration
        u, v, a = (spread(self.system, x, q) for x, q in zip((u, v, a), driven, strict=True))
        return self.reactions.numbers(u, v, a, inputs.loads)

    def nodal(self, free: Floats, driven: Floats) -> Floats:
        """(n, d) of all nodes, from the free unknowns (m,) and the drives (k,)."""
        return spread(self.system, free, driven).reshape(self.scene.mesh.nodes.shape)


@dataclass(frozen=True)
class MovingStepper(InertialStepper):
    """Base of those that carry the motion of the free unknowns themselves."""

    excitation: Excitation

    def rest(self) -> State:
        zeros = np.zeros(len(self.system.free))
        return State(0, Moving(zeros, zeros, zeros, self.excitation.rest()))

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        return self.nodal(state.inner.u, state.inner.inputs.q)


def spread(system: System, free: Floats, driven: Floats) -> Floats:
    """All unknowns (N,) from the free ones (m,) and the drives' (k,)."""
    full = system.moves @ driven if len(driven) else np.zeros(len(system.moves))
    full[system.free] = free
    return full
