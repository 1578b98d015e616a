"""Coordinates of a displacement filter's state, and batch filtering in them.

Batch filtering of many recordings of one experiment with common gains.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from validate.arrays import Floats, Ints
from validate.estimate.kalman.covariance import Decoupled, Dense, GainSequence
from validate.estimate.kalman.formulas import Gain, log_likelihood
from validate.fem.critical import Modes
from validate.fem.system import System, once
from validate.solve.dynamic.linear import Excitation
from validate.solve.dynamic.newmark_rule import Propagation, Rule, per_mode


class Coordinates(Protocol):
    """In what the state (n,) is kept: nodal displacements or modal amplitudes."""

    def predict(self, x: Floats, v: Floats, a: Floats, f: Floats) -> Floats:
        """x' under forces f (n,) in these coordinates."""
        ...

    def forces(self, f: Floats) -> Floats:
        """Forces (m, k) N on the free unknowns, in these coordinates (n, k)."""
        ...

    def rates(self, new: Floats, x: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]: ...

    def free(self, x: Floats) -> Floats:
        """Values (m,) of the free unknowns."""
        ...

    def amplitudes(self, u: Floats) -> Floats:
        """Return the coordinates of u (m,) or (m, k)."""
        ...

    def variances(self, P: Floats) -> Floats:
        """Diagonal (m,) of the free unknowns' covariance."""
        ...


@dataclass(frozen=True)
class Nodal:
    """The free unknowns themselves."""

    propagation: Propagation

    def predict(self, x: Floats, v: Floats, a: Floats, f: Floats) -> Floats:
        return self.propagation.predict(x, v, a, f)

    def forces(self, f: Floats) -> Floats:
        return f

    def rates(self, new: Floats, x: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        return self.propagation.rates(new, x, v, a)

    def free(self, x: Floats) -> Floats:
        return x

    def amplitudes(self, u: Floats) -> Floats:
        return u

    def variances(self, P: Floats) -> Floats:
        return np.diag(P)


@dataclass(frozen=True)
class InModes:
    """Amplitudes of all modes: `shapes` (m, r), M-orthonormal, `dual` = M shapes.

    `factors` (r,) each of q, v, a and the modal force make the step.
    """

    shapes: Floats
    dual: Floats
    factors: tuple[Floats, Floats, Floats, Floats]
    rule: Rule

    @cached_property
    def white(self) -> Floats:
        """What equal variance of every unknown is in amplitudes (r, r)."""
        return np.asarray(self.dual.T @ self.dual)

    def predict(self, x: Floats, v: Floats, a: Floats, f: Floats) -> Floats:
        fq, fv, fa, ff = self.factors
        return fq * x + fv * v + fa * a + ff * f

    def forces(self, f: Floats) -> Floats:
        return np.ascontiguousarray(self.shapes.T @ f)

    def rates(self, new: Floats, x: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        return self.rule.rates(new, x, v, a)

    def free(self, x: Floats) -> Floats:
        return self.shapes @ x

    def amplitudes(self, u: Floats) -> Floats:
        return self.dual.T @ u

    def variances(self, P: Floats) -> Floats:
        return np.asarray(np.einsum("ij,ij->i", self.shapes @ P, self.shapes))


def in_modes(system: System, rule: Rule) -> InModes:
    """All modes, kept with the system; raises `SceneError` where damping couples them."""
    return once(system, ("in modes", rule), lambda: _in_modes(system, rule))


def _in_modes(system: System, rule: Rule) -> InModes:
    modes = Modes.of(system)
    M = system.M[system.free][:, system.free]
    factors = per_mode(rule, modes.damping, modes.omega**2)
    return InModes(modes.shapes, np.asarray(M @ modes.shapes), factors, rule)


def excitation_in(coordinates: Coordinates, nodal: Excitation) -> Excitation:
    """Return the effect of inputs in the coordinates: forces are linear in its columns."""
    of = coordinates.forces
    return replace(
        nodal,
        loads=of(nodal.loads),
        stiffness=of(nodal.stiffness),
        damping=of(nodal.damping),
        mass=of(nodal.mass),
        starts=None if nodal.starts is None else coordinates.amplitudes(nodal.starts),
    )


@dataclass(frozen=True)
class Batch:
    """Estimates `values` (seeds, nt, p) m, innovations y (seeds, nt, m) m, `nis` (seeds, nt) with
    degrees of freedom `dof` (nt,) and `log_likelihood` (seeds, nt).

    `frozen` is the step from which the gains repeat; None where they never do.
    """

    values: Floats
    y: Floats
    nis: Floats
    dof: Floats
    log_likelihood: Floats
    frozen: int | None


class OneAtATime:
    """A filter whose gains depend on what is measured: recordings are filtered one by one."""

    def batch(self, inputs: Floats, z: Floats, rows: Floats) -> Batch | None:
        """None."""
        return None


def batch_of(
    gains: GainSequence, values: Floats, y: Floats, stacked: "StackedGains", dof: Floats
) -> Batch:
    """Return the statistics of innovations y (seeds, nt, m) m that these gains left."""
    nis, log_det = stacked.statistics(y)
    density = np.asarray(log_likelihood(nis, dof, log_det))
    return Batch(values, y, nis, dof, density, gains.frozen)


@dataclass(frozen=True)
class StackedGains:
    """Gain number `which` (nt,) of every step, -1 for none; all gains `G` (k, m, n), zero for what
    they do not see, and `S_yy` (k, m, m) m^2, the unit matrix there."""

    which: Ints
    G: Floats
    S_yy: Floats

    def statistics(self, y: Floats) -> tuple[Floats, Floats]:
        """NIS (seeds, nt) of innovations y (seeds, nt, m) m and ln det S_yy (nt,), zero where
        nothing was measured."""
        nis, log_det, seen = np.zeros(y.shape[:2]), np.zeros(y.shape[1]), self.which >= 0
        if seen.any():
            S = self.S_yy[self.which[seen]]
            scaled = np.linalg.solve(S, np.moveaxis(y[:, seen], 0, 2))
            nis[:, seen] = np.einsum("stm,tms->st", y[:, seen], scaled)
            log_det[seen] = np.linalg.slogdet(self.S_yy)[1][self.which[seen]]
        return nis, log_det


def stacked_gains(gains: GainSequence, nt: int, m: int, n: int) -> StackedGains:
    """Return the gains of nt steps in arrays: m components measured, n numbers in the state."""
    places: dict[int, int] = {}
    which = np.full(nt, -1)
    distinct: list[Gain] = []
    for step, gain in gains.gains.items():
        if step <= nt:
            which[step - 1] = places.setdefault(id(gain), len(distinct))
            if which[step - 1] == len(distinct):
                distinct.append(gain)
    stack, S_yy = np.zeros((len(distinct), n, m)), np.zeros((len(distinct), m, m))
    for G, S, gain in zip(stack, S_yy, distinct, strict=True):
        if all(gain.seen):
            G[:], S[:] = gain.G, gain.S_yy
        else:
            seen = np.array(gain.seen)
            G[:, seen], S[:] = gain.G, np.where(np.outer(seen, seen), gain.S_yy, np.eye(m))
    return StackedGains(which, np.ascontiguousarray(stack.swapaxes(1, 2)), S_yy)


def in_amplitudes(nodal: Dense, modes: InModes) -> Decoupled:
    """Return the recursion of nodal displacements in amplitudes of all modes: its transition is
    diagonal."""
    Q = _white(nodal.Q, modes)
    if Q is None:
        Q = modes.amplitudes(modes.amplitudes(nodal.Q).T)
    P0 = _scaled(nodal.P0, nodal.Q, Q)
    if P0 is None:
        P0 = modes.amplitudes(modes.amplitudes(nodal.P0).T)
    H = np.ascontiguousarray(nodal.H @ modes.shapes)
    return Decoupled(modes.factors[0], Q, H, nodal.R, P0)


def _scaled(one: Floats, other: Floats, turned: Floats) -> Floats | None:
    """`one` turned, where it is a multiple of `other`; saves two products of full matrices."""
    largest = float(np.abs(other).max())
    factor = float(np.abs(one).max()) / largest if largest else 0.0
    return factor * turned if np.array_equal(one, factor * other) else None


def _white(Q: Floats, modes: InModes) -> Floats | None:
    """`Q` turned, where every unknown has the same variance and shares none with another."""
    q = float(Q[0, 0])
    return q * modes.white if np.array_equal(Q, q * np.eye(len(Q))) else None
