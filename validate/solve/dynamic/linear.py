"""Common parts of linear schemes with inertia: fields, traces and forces of drives."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.fem.system import DampingTerms, MassName, System, damping_of, mass_of
from validate.scene.scene import Scene
from validate.solve.excitation import Excitation, Inputs
from validate.solve.types import State


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


def elastic_forces(system: System, u: Floats) -> Floats:
    """Share K u of the drives' forces (nt, k) N in fields u (nt, n, d) m, compression positive.

    Where a drive's velocity jumps, damping makes its whole force jump; this share does not.
    """
    forces: Floats = u.reshape(len(u), -1) @ (system.K @ system.moves)
    return system.scene.copies * forces


def spread(system: System, free: Floats, driven: Floats) -> Floats:
    """All unknowns (N,) from the free ones (m,) and the drives' (k,)."""
    full = system.moves @ driven if len(driven) else np.zeros(len(system.moves))
    full[system.free] = free
    return full
