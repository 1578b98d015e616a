"""Pose of an inclusion: its rest outline in the image, checked against the declared sweep."""

import numpy as np

from validate.errors import RegistrationError
from validate.recording.types import Contours, Record
from validate.register.outlines.circle import fit_circle
from validate.register.outlines.plane import from_image
from validate.scene.geometries.inclusion import Capsule


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
