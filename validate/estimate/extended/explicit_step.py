"""Explicit step that the nonlinear filters predict with (paper 003, eqs 18-23).

Central difference on lumped masses: U_{t+dt} from U_t, U_{t-dt} and the forces at time t. Damping
is the mass-proportional share of Rayleigh's, which stays diagonal.

Departures: the paper drops the damping matrix (eq 19); here that is a scene without damping.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.estimate.extended import kernels as kernel
from validate.fem.critical import critical_step
from validate.fem.large_strain.explicit import ExplicitBody, Precision
from validate.fem.system import System
from validate.solve.explicit.central import lumped_damping

FAR = 10  # body lengths
MARGIN = 0.05  # of the critical step, which falls as a body deforms: as in `CentralDifference`


@dataclass(frozen=True)
class ExplicitStep:
    """U' = c2 U - c1 U_{t-h} + w (F - R(U)), all (N,); held unknowns have zeros in c2, c1 and w.

    `parts` steps of h s make one step of `march`. Loads reach the `loaded` unknowns by `columns`,
    drives the `driven` ones by `moves`.
    """

    system: System
    model: ExplicitBody
    h: float
    parts: int
    c2: Floats
    c1: Floats
    w: Floats
    loaded: Ints
    columns: Floats
    driven: Ints
    moves: Floats

    @cached_property
    def far(self) -> float:
        """A displacement m that no body of this size has: the run has diverged."""
        return FAR * float(np.ptp(self.system.scene.mesh.nodes, axis=0).max())

    def lost(self, largest: float) -> str:
        """Why a run ends whose largest displacement is that many m, or not a number."""
        found = f"{largest:.3g} m" if np.isfinite(largest) else "not finite"
        return (
            f"displacements of {found} in a body of {self.far / FAR:.3g} m at steps of {self.h:g} "
            "s: take smaller steps, or correct U_{t-dt} together with U_t"
        )

    def inputs(self, old: Floats, new: Floats, part: int) -> tuple[Floats, Floats]:
        """Return the loads N at the start and drives m at the end of a part of the way between two
        inputs."""
        k = self.system.moves.shape[1]
        if self.parts == 1:
            return old[k:], new[:k]
        start, end = part / self.parts, (part + 1) / self.parts
        return old[k:] + start * (new - old)[k:], old[:k] + end * (new - old)[:k]

    def following(
        self, u: Floats, before: Floats, R: Floats, loads: Floats, drives: Floats
    ) -> Floats:
        """U_{t+h} (N,) m; R (N,) N are the internal forces at t, with the loads then."""
        return kernel.follow(
            u, before, R, self.c2, self.c1, self.w,
            self.loaded, self.columns, loads, self.driven, self.moves, drives,
        )  # fmt: skip


def explicit_step(
    system: System, dt: float, parts: int, precision: Precision = "double"
) -> ExplicitStep:
    """Return the step of h = dt/parts; raises `SceneError` for damping that is not diagonal."""
    h, lags = dt / parts, system.scene.per_cell(lambda m: m.stiffness_damping)
    if lags.any():
        raise SceneError(
            f"stiffness damping {lags.max():g} s couples the nodes: the explicit filters know mass "
            "damping only; set it to 0"
        )
    half = h / 2 * lumped_damping(system) / system.masses
    free = np.zeros(len(system.moves))
    free[system.free] = 1 / (1 + half[system.free])
    loaded, driven = (np.flatnonzero(X.any(axis=1)) for X in (system.loads, system.moves))
    return ExplicitStep(
        system, ExplicitBody(system.scene, precision=precision), h, parts,
        2 * free, (1 - half) * free, free * h * h / system.masses,
        loaded, np.ascontiguousarray(system.loads[loaded]),
        driven, np.ascontiguousarray(system.moves[driven]),
    )  # fmt: skip


def beyond(system: System, h: float) -> str:
    """Why a step of h s is refused; empty where it keeps the margin below the critical one."""
    found = critical_step(system)
    if h <= (1 - MARGIN) * found.lanczos:
        return ""
    return (
        f"dt {h:g} s is {h / found.lanczos:.3g} times the critical step {found.lanczos:.3g} s; "
        f"{found.limited_by}; take at most {found.recommended:.3g} s or more substeps"
    )
