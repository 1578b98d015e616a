"""Round outlines: circle fit, and an inclusion's pose."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from validate.arrays import Floats, rms
from validate.errors import RegistrationError
from validate.recording.types import Contours, Record
from validate.register.outlines.plane import from_image
from validate.scene.geometries.inclusion import Capsule


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


def outlined_capsule(
    contours: Contours, rest: int, sweep: Record, allowance: float = 0.0
) -> Capsule:
    """Centre x, z and radius of outline number `rest`; height y and length from the sweep.

    Raises `RegistrationError` when the outline's centre lies further from the sweep's than 4
    standard deviations and `allowance` m: a mirrored image or a wrong pose.
    """
    circle = fit_circle(contours.outlines[rest], contours.sd)
    centre = from_image(contours.pose, circle.centre[None])[0]
    declared = np.array([_metres(sweep, f"centre_{axis}_m") for axis in "xyz"])
    off = float(np.linalg.norm((centre - declared)[[0, 2]]))
    allowed = 4 * float(np.hypot(_metres(sweep, "sd_centre_m"), circle.sd_centre)) + allowance
    if off > allowed:
        raise RegistrationError(
            f"the rest outline's centre is {1e3 * off:.2f} mm from the inclusion of the sweep "
            f"(allowed {1e3 * allowed:.2f} mm): mirrored image or wrong pose; check record "
            "'pose/outline'"
        )
    place = (float(centre[0]), float(declared[1]), float(centre[2]))
    return Capsule(place, circle.radius, _metres(sweep, "length_m"))


def _metres(record: Record, key: str) -> float:
    try:
        return float(record[key])
    except (KeyError, ValueError):
        raise RegistrationError(
            f"record 'inclusion' lacks a number '{key}'; it has {sorted(record)}"
        ) from None
