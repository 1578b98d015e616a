"""Position of a blurred wall, corrected for blur.

A path between grey levels lies inward of the wall, because the logarithm lifts the skirt of the
point spread. The wall of the scatterers is where half of the power is left: 3.01 dB below the level
of the brighter side. A grey level's dB are known from the speckle itself, whose log envelope has a
standard deviation of 5.57 dB whatever the dynamic range, so no setting of the scanner is needed.
Where that level would lie below the middle of both sides (low contrast) the middle is taken, and
towards the middle where the scanner smoothed the logarithm too, which blurs evenly to both sides:
the skewness of log speckle tells how much.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from validate.arrays import Floats
from validate.recording.outlines.polar import DIRECTIONS, HALF_POWER, LOG_SPECKLE_SD, Grey, Wall

_SPAN = 0.35  # of the radius, to both sides of the path
_SAMPLES = 71
_RAW_SKEW = 0.8  # log speckle has 1.14, less what the texture of tissue takes
_SMOOTHED = 0.35  # of the step from the brighter side: blurred before and after the logarithm
_MOST = 1.5  # speckle sizes; a blur is not wider


@dataclass(frozen=True)
class Placed:
    """Points (RAYS, 2) m on the wall and their mean outward move m from the path."""

    points: Floats
    moved: float


def placed(grey: Grey, wall: Wall, bright: bool) -> Placed:
    """Return the wall's points moved from the path to where half of the power is left."""
    points = wall.centre + wall.radius[:, None] * DIRECTIONS
    normals = _normals(points)
    s = np.linspace(-_SPAN, _SPAN, _SAMPLES) * float(wall.radius.mean())
    profile = grey.at(points[:, None, :] + s[None, :, None] * normals[:, None, :])
    level = _level(wall, bright)
    across = normals[:, 0] ** 2  # 1: the wall faces sideways, 0: it faces along depth
    sideways = _crossing(profile, s, wall, level, across)
    along = _crossing(profile, s, wall, level, 1 - across)
    most = _MOST * float(np.sqrt(grey.speckle))
    sideways, along = (float(np.clip(m, -most, most)) for m in (sideways, along))
    move = across * sideways + (1 - across) * along
    there = points + move[:, None] * normals
    if not _goes_round(there - wall.centre):
        there = points + move[:, None] * DIRECTIONS
    return Placed(there, float(move.mean()))


def _goes_round(away: Floats) -> bool:
    """Whether polar angles of (k, 2) grow: a wall moved along normals that cross folds."""
    one, next_ = away, np.roll(away, -1, axis=0)
    return bool((one[:, 0] * next_[:, 1] > one[:, 1] * next_[:, 0]).all())


def _normals(points: Floats) -> Floats:
    """Outward normals (k, 2) of a closed outline with growing polar angle."""
    tangent = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)


def _level(wall: Wall, bright: bool) -> float:
    """Share 0..1 of the step from inside to outside at which the wall lies."""
    levels = wall.levels
    step = max(float(np.mean(levels.outside)) - levels.inside, 1e-9)
    spread = levels.sd_inside if bright else levels.sd_outside
    skew = levels.skew_inside if bright else -levels.skew_outside
    raw = float(np.clip(skew / _RAW_SKEW, 0, 1))
    below = raw * min(HALF_POWER / LOG_SPECKLE_SD * spread / step, 0.5) + (1 - raw) * _SMOOTHED
    return float(below if bright else 1 - below)


def _crossing(profile: Floats, s: Floats, wall: Wall, level: float, weight: Floats) -> float:
    """Where the weighted mean profile passes `level`, m from the path, nearest to it."""
    seen = ~np.isnan(profile)
    step = np.maximum(wall.levels.outside - wall.levels.inside, 0)[:, None] * seen
    rise = np.where(seen, profile - wall.levels.inside, 0) * weight[:, None]
    mean = rise.sum(axis=0) / np.maximum((step * weight[:, None]).sum(axis=0), 1e-9)
    mean = gaussian_filter1d(mean, 1.0, mode="nearest")
    above = mean >= level
    passes = np.flatnonzero(~above[:-1] & above[1:])
    if not len(passes):
        return 0.0
    places = s[passes] + (s[1] - s[0]) * (level - mean[passes]) / (mean[passes + 1] - mean[passes])
    return float(min(places.tolist(), key=abs))
