"""Few shapes that carry a body's motion: its lowest modes, or those of a run of the model itself.

Phi (N, r) is orthonormal in the lumped masses and diagonalises K: Phi^T M Phi = I, Phi^T K Phi =
diag(omega^2), so one scalar equation a shape. Snapshots (POD) come from the model alone, never
from a measurement (Sirovich 1987); of them the Ritz vectors are taken.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from validate.arrays import Floats
from validate.errors import UsageError
from validate.estimate.explicit_step import ExplicitStep
from validate.fem.system import System

_DENSE = 400  # unknowns up to which all modes are found at once
_PERIODS = 2  # of the lowest mode: one to load, one to ring
_SNAPSHOTS = 60  # of each load's run


@dataclass(frozen=True)
class Basis:
    """Phi (N, r) 1/sqrt(kg), zero at held unknowns; squares (r,) are omega^2 1/s^2."""

    Phi: Floats
    squares: Floats


def modes(system: System, r: int) -> Basis:
    """The r lowest modes with lumped masses; raises `UsageError` for more than there are."""
    free = system.free
    masses, m = system.masses[free], len(free)
    if not 1 <= r <= m:
        raise UsageError(f"{r} modes of a body with {m} free unknowns: 1 to {m}")
    K = system.K[free][:, free]
    if m <= _DENSE or r > m // 2:
        scale = 1 / np.sqrt(masses)
        squares, V = eigh(scale[:, None] * K.toarray() * scale, subset_by_index=[0, r - 1])
        V = scale[:, None] * V
    else:
        solve = LinearOperator((m, m), matvec=system.factor().solve, dtype=np.float64)
        M = sparse.diags_array(masses).tocsc()
        v0 = np.random.default_rng(0).standard_normal(m)
        squares, V = eigsh(K.tocsc(), k=r, M=M, sigma=0.0, OPinv=solve, v0=v0)
    Phi = np.zeros((len(system.moves), r))
    Phi[free] = V
    return Basis(Phi, np.asarray(squares))


def pod(explicit: ExplicitStep, r: int, force: float) -> Basis:
    """The r strongest shapes of runs in which each load in turn ramps to `force` N and stays.

    Raises `UsageError` without loads, or for more shapes than snapshots.
    """
    system = explicit.system
    runs = [_snapshots(explicit, j, force) for j in range(system.loads.shape[1])]
    if not runs or not 1 <= r <= len(runs) * _SNAPSHOTS:
        raise UsageError(
            f"{r} shapes from the snapshots of {len(runs)} loads, {_SNAPSHOTS} each: a POD basis "
            "needs a load; take basis='modes'"
        )
    root = np.sqrt(system.masses)
    V = np.linalg.svd(root[:, None] * np.hstack(runs), full_matrices=False)[0][:, :r]
    V = V / root[:, None]
    squares, turn = eigh(V.T @ (system.K @ V))
    Phi = V @ turn
    Phi[system.held] = 0.0  # up to rounding they are
    return Basis(Phi, np.asarray(squares))


def _snapshots(explicit: ExplicitStep, load: int, force: float) -> Floats:
    """Displacements (N, `_SNAPSHOTS`) m of the model under one load."""
    lowest = float(np.sqrt(modes(explicit.system, 1).squares[0]))
    steps = max(_SNAPSHOTS, int(_PERIODS * 2 * np.pi / lowest / explicit.h))
    kept = frozenset(np.linspace(1, steps, _SNAPSHOTS).astype(int).tolist())
    loads, drives = np.zeros(explicit.columns.shape[1]), np.zeros(explicit.moves.shape[1])
    u = before = np.zeros(len(explicit.system.moves))
    shots = []
    for k in range(steps):
        loads[load] = force * min(_PERIODS * k / steps, 1.0)
        u, before = explicit.following(u, before, explicit.model.force(u), loads, drives), u
        if k + 1 in kept:
            shots.append(u)
    return np.array(shots).T
