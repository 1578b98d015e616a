"""The reduced-order unscented filter's formulas: sigma points in the space of parameters alone.

The whole state is uncertain only through p parameters, so that P = L L^T has rank p: sigma points
are runs Z_i = mean + L I_i of unit points I_i with mean 0 and covariance 1, and so many runs as
unit points carry the covariance, without any tangent (Moireau & Chapelle 2011, ESAIM: Control,
Optimisation and Calculus of Variations 17, 380-405, sections 2 and 3).

Departures: points of equal weight alone. With fewer measurements than parameters S_yy is solved
instead of the paper's U; both are equal (Woodbury).
"""

from typing import Literal

import numpy as np
from scipy.linalg import helmert, solve, solve_triangular

from validate.arrays import Floats
from validate.estimate.kalman import best_gain, innovation
from validate.estimate.sampled_kalman import Corrected

SigmaName = Literal["simplex", "canonical"]


def unit_points(name: SigmaName, p: int) -> Floats:
    """(s, p) of equal weight 1/s: p + 1 corners of a regular simplex, or 2 p on the axes."""
    if name == "simplex":
        return np.asarray(np.sqrt(p + 1) * helmert(p + 1).T)
    axes = np.sqrt(p) * np.eye(p)
    return np.vstack([axes, -axes])


def spread(Z: Floats, unit: Floats) -> Floats:
    """L (n, p) of members Z (s, n) at unit points (s, p): P = L L^T."""
    return np.asarray((Z - Z.mean(axis=0)).T @ unit / len(unit))


def reduced_update(Z: Floats, seen: Floats, z: Floats, R: Floats, unit: Floats) -> Corrected:
    """Members Z (s, n), of which `seen` (s, m) would be measured, corrected by z (m,), NaN =
    missing, of noise R (m, m): new points about the new mean."""
    L, Ly, i = spread(Z, unit), spread(seen, unit), np.isfinite(z)
    gain = best_gain(L @ Ly.T, Ly @ Ly.T + R, tuple(i.tolist()))
    found = innovation(z, seen.mean(axis=0), gain)
    U = np.eye(unit.shape[1]) + Ly[i].T @ solve(R[np.ix_(i, i)], Ly[i], assume_a="pos")
    narrowed = solve_triangular(np.linalg.cholesky(U).T, np.eye(len(U)))  # T T^T = U^-1
    mean = Z.mean(axis=0) + gain.G @ found.y[i]
    return Corrected(mean + unit @ (L @ narrowed).T, found)
