"""Linear state-space model of few modes with unknown load.

x = (q, q', r, b): amplitudes and rates of the lowest modes, the rest r and a bias b in N of every
load, which walks at random. Every mode is exact for loads held at their end value over a step. What
a load does statically to the modes left out follows with its own time constant, c/k of its shape:
at once without damping, but with stiffness damping the stiffest modes creep as slowly as the rest.
Unlike paper 001's filter the rate is estimated too, and what the filter doubts is the load, so that
a correction moves every node as the load would.

Linear model of a filterpy filter, in the notation of filterpy.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import ComparisonError, SceneError
from validate.estimate.measurements import Measurements
from validate.fem.modes import Modes, modes_of
from validate.fem.system import System
from validate.solve.dynamic.modal import exact_walk, left_out


@dataclass(frozen=True)
class LinearModel:
    """x' = F x + B f + w, z = H x + r with covariances Q of w and R of r; first x0, P0.

    F, Q, P0 (n, n), B (n, l), H (m, n), R (m, m), x0 (n,); f (l,) are the inputs of the step's
    end in N. Letters are filterpy's: F is the transition here. Raises `ComparisonError` for shapes
    that do not fit each other, and for covariances that are not symmetric.
    """

    F: Floats
    B: Floats
    H: Floats
    Q: Floats
    R: Floats
    x0: Floats
    P0: Floats

    def __post_init__(self) -> None:
        n, m = len(self.F), len(self.H)
        shapes = {"F": (n, n), "B": (n, None), "H": (m, n), "Q": (n, n), "R": (m, m)}
        for name, shape in (shapes | {"x0": (n,), "P0": (n, n)}).items():
            value = checked(getattr(self, name), f"model {name}", shape, error=ComparisonError)
            object.__setattr__(self, name, value)
        for name in ("Q", "R", "P0"):
            require_symmetric(getattr(self, name), f"model {name}")

    @property
    def size(self) -> int:
        return len(self.F)


def require_symmetric(P: Floats, name: str) -> None:
    """Raise `ComparisonError` when P differs from its transpose by more than rounding."""
    off, scale = float(np.abs(P - P.T).max()), float(np.abs(P).max())
    if off > 1e-9 * scale:
        raise ComparisonError(f"{name}: differs from its transpose by {off:.1e} of {scale:.1e}")


@dataclass(frozen=True)
class LoadDoubt:
    """Uncertainty of the loads: `start` N (sd) at the first step, `walk` N per sqrt(s) from then.

    `jitter` N (sd) is force noise of each step on its own.
    """

    start: float
    walk: float
    jitter: float = 0.0

    def __post_init__(self) -> None:
        for name in ("start", "walk", "jitter"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise SceneError(
                    f"uncertainty of the load, {name} = {value:g}: expected a number >= 0"
                )


@dataclass(frozen=True)
class ReducedModel:
    """`model` of x (n,); the free unknowns are `lift` (m, n) x; the last `loads` states are biases
    in N."""

    model: LinearModel
    lift: Floats
    loads: int


def reduced_model(
    system: System, measurements: Measurements, dt: float, modes: int, doubt: LoadDoubt, R: Floats
) -> ReducedModel:
    """Return the model of the lowest `modes` modes in steps of dt s, R (m_z,) m^2.

    Raises `SceneError` for damping that couples the modes.
    """
    lowest = modes_of(system, min(modes, len(system.free)))
    rest = left_out(system, lowest, np.ascontiguousarray(system.loads[system.free]))
    # Share (l,) of the rests that stays over a step: exp(-dt k / c), 0 without damping
    K, C = (X[system.free][:, system.free] for X in (system.K, system.C))
    k, c = (np.einsum("ij,ij->j", rest, X @ rest) for X in (K, C))
    creeps = (c > 0) & (k > 0)
    kept = np.where(creeps, np.exp(-dt * k / np.where(creeps, c, 1.0)), 0.0)
    F, B = _transition(system, lowest, kept, dt)
    l = rest.shape[1]
    lift = np.hstack([lowest.shapes, np.zeros_like(lowest.shapes), rest, np.zeros_like(rest)])
    H, n = measurements.free(system.free) @ lift, lift.shape[1]
    P0 = np.zeros((n, n))
    P0[-l:, -l:] = doubt.start**2 * np.eye(l)
    Q = doubt.jitter**2 * (B @ B.T)
    Q[-l:, -l:] += doubt.walk**2 * dt * np.eye(l)
    return ReducedModel(LinearModel(F, B, H, Q, np.diag(R), np.zeros(n), P0), lift, l)


def _transition(system: System, modes: Modes, kept: Floats, dt: float) -> tuple[Floats, Floats]:
    """F (n, n) and B (n, l): modes exact for a force held in the step, rests, biases."""
    walk = exact_walk(modes, dt, "constant")
    assert walk.rate is not None
    (qq, qv, _, _, qf), (vq, vv, _, _, vf) = walk.q, walk.rate
    forces = modes.shapes.T @ system.loads[system.free]
    r, l = forces.shape
    B = np.vstack([qf[:, None] * forces, vf[:, None] * forces, np.diag(1 - kept), np.zeros((l, l))])
    F = np.zeros((len(B), len(B)))
    F[: 2 * r, : 2 * r] = np.block([[np.diag(qq), np.diag(qv)], [np.diag(vq), np.diag(vv)]])
    F[2 * r : 2 * r + l, 2 * r : 2 * r + l] = np.diag(kept)
    F[:, -l:] = B  # a bias is a load
    F[-l:, -l:] = np.eye(l)
    return F, B
