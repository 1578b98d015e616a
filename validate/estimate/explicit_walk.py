"""The plain explicit step that the nonlinear filters predict with (paper 003, eqs 18-23).

Central difference on lumped masses: U_{t+dt} from U_t, U_{t-dt} and the forces at time t. Damping
is the mass-proportional share of Rayleigh's, which stays diagonal.

Departures: the paper drops the damping matrix (eq 19); here that is a scene without damping.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.critical import critical_step
from validate.fem.system import System

FAR = 10  # body lengths


class ExplicitModel(Protocol):
    """A body's internal forces (N,) N at displacements u (N,) m, and the tangent's diagonal."""

    def force(self, u: Floats) -> Floats: ...

    def force_and_diagonal(self, u: Floats) -> tuple[Floats, Floats]:
        """Forces (N,) N and K_ii (N,) N/m of the tangent at u."""
        ...

    def tangent_blocks(self, u: Floats) -> Floats:
        """K_nn (6, n) N/m of every node: xx, yy, zz, xy, xz, yz."""
        ...


@dataclass(frozen=True)
class Walk:
    """U' = c2 U - c1 U_{t-h} + w (F - R(U)) + moves q, all (N,); held unknowns have zeros in c2,
    c1 and w. `parts` steps of h s make one step of `march`."""

    system: System
    model: ExplicitModel
    h: float
    parts: int
    c2: Floats
    c1: Floats
    w: Floats

    @cached_property
    def far(self) -> float:
        """A displacement m that no body of this size has: the run has diverged."""
        return FAR * float(np.ptp(self.system.scene.mesh.nodes, axis=0).max())

    def lost(self, largest: float) -> str:
        """Why a run ends whose largest displacement is that many m, or not a number."""
        found = f"{largest:.3g} m" if np.isfinite(largest) else "beyond all numbers"
        return (
            f"displacements of {found} in a body of {self.far / FAR:.3g} m at steps of {self.h:g} "
            "s: take smaller steps, or correct U_{t-dt} together with U_t"
        )

    def inputs(self, old: Floats, new: Floats, part: float) -> Floats:
        """Inputs at a fraction of the way from one march step to the next."""
        return old + (part / self.parts) * (new - old)

    def following(self, u: Floats, before: Floats, R: Floats, start: Floats, end: Floats) -> Floats:
        """U_{t+h} (N,) m from inputs at t and t + h; R (N,) N are the internal forces at t."""
        drives = self.system.moves.shape[1]
        f = self.system.loads @ start[drives:] - R
        u_new = self.c2 * u
        u_new -= self.c1 * before
        f *= self.w
        u_new += f
        return u_new + self.system.moves @ end[:drives] if drives else u_new


def explicit_model(system: System) -> ExplicitModel:
    """The compiled body of a scene."""
    raise NotImplementedError


def walk(system: System, model: ExplicitModel, dt: float, parts: int) -> Walk:
    """The step of h = dt/parts; raises `SceneError` for damping that is not diagonal."""
    material, h = system.scene.material, dt / parts
    if material.stiffness_damping:
        raise SceneError(
            f"stiffness damping {material.stiffness_damping:g} s couples the nodes: the explicit "
            "filters know mass damping only; set it to 0"
        )
    half = material.mass_damping * h / 2
    free = np.zeros(len(system.moves))
    free[system.free] = 1 / (1 + half)
    return Walk(
        system, model, h, parts, 2 * free, (1 - half) * free, free * h * h / system.masses
    )


def beyond(system: System, h: float) -> str:
    """Why a step of h s is refused; empty where it is below the recommended one."""
    found = critical_step(system)
    if h <= found.lanczos:
        return ""
    return (
        f"dt {h:g} s is {h / found.lanczos:.3g} times the critical step {found.lanczos:.3g} s; "
        f"{found.limited_by}; take at most {found.recommended:.3g} s or more substeps"
    )
