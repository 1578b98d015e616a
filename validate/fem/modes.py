"""Mode shapes, frequencies and dampings of a system: K phi = w^2 M phi."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.once import once
from validate.fem.system import System

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
    """The lowest modes, with the whole of the last cluster of equal frequencies.

    They are kept with the system. Raises `SceneError` for more modes than unknowns or a C that they
    do not make diagonal.
    """
    return once(system, ("modes", count), lambda: _modes(system, count))


def _modes(system: System, count: int | None) -> Modes:
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
