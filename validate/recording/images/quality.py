"""Is a traced path the wall of a closed dark region, and how well is it known?"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from validate.arrays import Floats
from validate.recording.images.polar import DIRECTIONS, RAYS, Grey, Wall

SD_NOISE = 1.2  # wall error / (speckle size / contrast), measured on twins
SD_BIAS = 0.2  # what is left of the wall error where contrast is high / speckle size
_SECTOR = 20.0  # deg of the wall that are judged together


@dataclass(frozen=True)
class Quality:
    """gcnr 0..1 of inside against surroundings, closed share of the wall 0..1."""

    gcnr: float
    closed: float


def quality(grey: Grey, wall: Wall) -> Quality:
    """How well a path parts dark from bright.

    gcnr is 1 - overlap of the two grey level distributions (generalised contrast-to-noise ratio,
    Rodriguez-Molares et al. 2020): 0 for alike, 1 for apart, whatever the grey scale. `closed` is
    the share of the wall whose own surroundings (20 deg of them) are brighter than the inside by
    at least a third of the outline's median contrast.
    """
    within, beside = (_band(grey, wall, *span) for span in ((0.1, 0.85), (1.1, 1.5)))
    return Quality(_gcnr(within[0], beside[0]), _closed(within, beside))


def _band(grey: Grey, wall: Wall, low: float, high: float) -> tuple[Floats, Floats]:
    """Values (RAYS, 24) between two shares of the radius and their area weights (24,)."""
    shares = np.sqrt(np.linspace(low**2, high**2, 24))  # equal areas
    away = wall.radius[:, None, None] * shares[None, :, None] * DIRECTIONS[:, None, :]
    return grey.at(wall.centre + away), shares


def _gcnr(inside: Floats, outside: Floats) -> float:
    edges = np.linspace(0, 256, 33)
    a, b = (np.histogram(v[~np.isnan(v)], edges)[0] for v in (inside, outside))
    if not (a.sum() and b.sum()):
        return 0.0
    return float(1 - np.minimum(a / a.sum(), b / b.sum()).sum())


def _closed(within: tuple[Floats, Floats], beside: tuple[Floats, Floats]) -> float:
    values = beside[0]
    seen = ~np.isnan(values)
    width = _SECTOR / 360 * RAYS / 2
    total = gaussian_filter1d(np.where(seen, values, 0).sum(axis=1), width, mode="wrap")
    count = gaussian_filter1d(seen.sum(axis=1).astype(float), width, mode="wrap")
    step = total / np.maximum(count, 1e-9) - np.nanmedian(within[0])
    return float((step > np.median(step) / 3).mean()) if np.median(step) > 0 else 0.0


def wall_sd(grey: Grey, wall: Wall) -> float:
    """Standard deviation m along the normal, rms over the wall.

    A wall between two kinds of speckle is known to a speckle's size over the contrast of both; its
    place under the blur to a part of the speckle's size. Both factors were measured on twins of
    known truth (benchmarks/contours.py prints the calibration).
    """
    contrast = np.maximum(wall.levels.contrast, 0.5)
    share = SD_NOISE**2 * float((1 / contrast**2).mean()) + SD_BIAS**2
    return float(np.sqrt(grey.speckle * share))
