"""Mode shapes, frequencies and damping ratios of a system: K phi = w^2 M phi."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System, once

_CLUSTER = 1e-3  # relative distance of frequencies that are taken as one cluster
_COUPLED = 1e-8  # of the damping: rounding leaves 1e-12, other materials' damping far more
_DENSE = 1500  # free unknowns up to which all modes together are cheaper than some


@dataclass(frozen=True)
class Modes:
    """Shapes (m, r), M-orthonormal over the free unknowns, frequencies 1/s and dampings 1/s."""

    shapes: Floats
    omega: Floats
    damping: Floats


def modes_of(system: System, count: int | None = None) -> Modes:
    """Return the lowest modes, with the whole of the last cluster of equal frequencies.

    They are kept with the system. Raises `SceneError` for more modes than unknowns or a C that they
    do not make diagonal.
    """
    return once(system, ("modes", count), lambda: _modes(system, count))


def _modes(system: System, count: int | None) -> Modes:
    free = system.free
    m = len(free)
    wanted = m if count is None else count
    if wanted > m:
        raise SceneError(f"{wanted} modes of {m} unknowns: expected at most {m}")
    K, M = (X[free][:, free] for X in (system.K, system.M))
    squares, shapes = lowest(K, M, wanted + max(8, wanted // 10))
    omega = np.sqrt(np.maximum(squares, 0.0))  # a body that is not held: 0 less rounding
    end = wanted
    while end < len(omega) and omega[end] <= omega[wanted - 1] * (1 + _CLUSTER):
        end += 1
    shapes, omega = np.ascontiguousarray(shapes[:, :end]), omega[:end]
    C = shapes.T @ (system.C[free][:, free] @ shapes)
    damping = np.diag(C).copy()
    if np.abs(C - np.diag(damping)).max() > _COUPLED * max(float(np.abs(C).max()), 1e-300):
        raise SceneError(
            "the damping couples the modes (regions damped differently); use Newmark, or the "
            "same mass_damping and stiffness_damping for all materials"
        )
    return Modes(shapes, omega, damping)


def lowest(K: sparse.csr_array, M: sparse.csr_array, count: int) -> tuple[Floats, Floats]:
    """Squares (r,) of the lowest frequencies and shapes (m, r), rising: `count`, or all where that
    is cheaper. K (m, m) N/m positive definite, M (m, m) kg."""
    m = K.shape[0]
    if m <= _DENSE or count >= m - 1:
        squares, shapes = eigh(K.toarray(), M.toarray())
    else:
        start = np.random.default_rng(0).standard_normal(m)
        squares, shapes = eigsh(K.tocsc(), k=count, M=M.tocsc(), sigma=0.0, which="LM", v0=start)
    order = np.argsort(squares)
    return np.asarray(squares)[order], np.asarray(shapes)[:, order]
