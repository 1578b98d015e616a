"""Coordinates of a displacement filter's state: nodal displacements or modal amplitudes."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from validate.arrays import Floats
from validate.fem.modes import modes_of
from validate.fem.system import System, once
from validate.solve.dynamic.newmark_rule import Propagation, Rule, per_mode
from validate.solve.excitation import Excitation


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
    modes = modes_of(system)
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
