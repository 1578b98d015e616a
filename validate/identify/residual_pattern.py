"""Lack-of-fit F test: is the residual of a fitted curve noise or a systematic shape?

A wrong law leaves a residual that bends smoothly with the load. Legendre polynomials of degree 2
to 4, freed of what the fit itself can follow, are fitted to the residual; their mean square over
that of the noise has Fisher's distribution where the law is right. Noise is taken from second
differences, which a smooth misfit hardly enters, times the dependence of successive samples.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.polynomial import legendre
from scipy.special import fdtrc

from validate.arrays import Floats, rms
from validate.identify.budget import dependence

DEGREES = (2, 3, 4)
BY_CHANCE = 0.01  # how often a right law is called wrong
MATERIAL = 1.0  # in u_val: a smaller misfit changes no verdict, however clearly it is seen
_FEWEST = 12  # samples


@dataclass(frozen=True)
class Pattern:
    """The smooth part (n,) of a residual, N; the chance that noise alone looks like it; and whether
    the measured force rises faster than the fitted curve at the largest loads."""

    smooth: Floats
    chance: float
    stiffens: bool

    @property
    def rms(self) -> float:
        return rms(self.smooth[:, None])

    @property
    def significant(self) -> bool:
        return self.chance < BY_CHANCE


def pattern(
    load: Floats, residual: Floats, followed: Floats, sd: float = 0.0, times: float = 1.0
) -> Pattern | None:
    """Of `residual` (n,), measured less fitted, against `load` (n,) rising; None for few samples.

    `followed` (n, p) are the shapes that the fit can follow by itself: its derivatives by what was
    fitted. `sd` is the sensor's: noise is never taken as less, and at least `times` samples count
    as one.
    """
    n = len(load)
    if n < _FEWEST or np.ptp(load) == 0:
        return None
    x = 2 * (load - load.min()) / np.ptp(load) - 1
    shapes = np.stack([legendre.Legendre.basis(k)(x) for k in DEGREES], axis=1)
    q, _ = np.linalg.qr(followed)
    free = shapes - q @ (q.T @ shapes)
    own, size, _ = np.linalg.svd(free, full_matrices=False)
    own = own[:, size > 1e-8 * max(size.max(), 1e-300)]
    left = residual - q @ (q.T @ residual)
    amounts = own.T @ left
    smooth = own @ amounts
    rough = left - smooth
    freedom = n - q.shape[1] - own.shape[1]
    if freedom < 2 or not len(amounts):
        return None
    times = max(dependence(rough), times)
    noise = max(sqrt(float(rough @ rough) / freedom), sd)
    least = 1e-9 * float(np.abs(residual).max(initial=0.0)) or 1e-300
    ratio = float(amounts @ amounts) / len(amounts) / (times * max(noise, least) ** 2)
    chance = float(fdtrc(len(amounts), max(freedom / times, 1.0), ratio))
    return Pattern(smooth, chance, bool(_bend(x, smooth) > 0))


def _bend(x: Floats, smooth: Floats) -> float:
    """The second coefficient of the smooth part: positive where both ends lie above the middle."""
    return float(legendre.legfit(x, smooth, max(DEGREES))[2])
