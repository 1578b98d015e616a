"""Undamped modes over the free unknowns, for filters whose transition is then diagonal."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats
from validate.errors import SceneError
from validate.solve.newmark_rule import Propagation

_DENSE = 3000  # unknowns up to which a dense eigensolution of all is taken: some 10 s there
_PROPORTIONAL = 1e-6  # of the damping's scale: what else couples the modes


@dataclass(frozen=True)
class Modes:
    """Phi (n, r) with Phi^T M Phi = I, omega2 (r,) 1/s^2, damping c (r,) 1/s; dual = M Phi.

    `dual` reads amplitudes from displacements: q = dual^T u, exact for all modes.
    """

    Phi: Floats
    omega2: Floats
    c: Floats
    dual: Floats


def modes_of(propagation: Propagation, count: int | None = None) -> Modes:
    """All modes or the lowest `count` of K and M.

    Raises `SceneError` for more than there are, for all of a large system, and where damping
    couples them (Rayleigh damping that differs between regions).
    """
    p, n = propagation, propagation.K.shape[0]
    r = n if count is None else count
    if not 1 <= r <= n:
        raise SceneError(f"{r} modes of {n} free unknowns: between 1 and {n}")
    if n <= _DENSE:
        omega2, Phi = eigh(p.K.toarray(), p.M.toarray(), subset_by_index=(0, r - 1))
    elif r < n // 4:
        omega2, Phi = eigsh(p.K, r, p.M, sigma=0.0)
    else:
        raise SceneError(f"{r} modes of {n} unknowns is a dense problem; take at most {n // 4}")
    damping = Phi.T @ (p.C @ Phi)
    c = np.diag(damping).copy()
    coupled = float(np.abs(damping - np.diag(c)).max())
    if coupled > _PROPORTIONAL * max(float(np.abs(c).max()), 1e-300):
        raise SceneError(
            f"damping couples the modes by {coupled:.2g} of {np.abs(c).max():.2g} 1/s (it differs "
            "between regions): use the filter in nodal coordinates"
        )
    return Modes(Phi, omega2, c, np.asarray(p.M @ Phi))
