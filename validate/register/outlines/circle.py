"""Circle fit of a measured outline, with the uncertainty of its centre and radius."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from validate.arrays import Floats, rms
from validate.errors import RegistrationError


@dataclass(frozen=True)
class Circle:
    """Centre (2,) m, radius m; sd of each coordinate of the centre and of the radius, m."""

    centre: Floats
    radius: float
    sd_centre: float
    sd_radius: float
    rms: float


def fit_circle(points: Floats, sd: float) -> Circle:
    """Least squares of the radial distances of points (k, 2) m with noise sd m.

    Raises `RegistrationError` for fewer than 6 points or an outline far from a circle.
    """
    if len(points) < 6:
        raise RegistrationError(f"outline of {len(points)} points: a circle fit needs 6 or more")
    middle = points.mean(axis=0)
    start = np.array([*middle, np.linalg.norm(points - middle, axis=1).mean()])

    def off_circle(p: Floats) -> Floats:
        return np.asarray(np.linalg.norm(points - p[:2], axis=1) - p[2])

    found = least_squares(off_circle, start)
    x, residual = found.x, np.asarray(found.fun)
    off = rms(residual)
    if off > 0.2 * x[2]:
        raise RegistrationError(
            f"the outline is not a circle: {1e3 * off:.2f} mm rms off a radius of "
            f"{1e3 * x[2]:.2f} mm"
        )
    k = len(points)
    noise = max(sd, off)
    sds = noise * np.sqrt(2 / k), noise / np.sqrt(k)
    return Circle(x[:2], float(x[2]), float(sds[0]), float(sds[1]), off)
