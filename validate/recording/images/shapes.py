"""Ellipses and circles through an outline's points, and how far points lie off a curve."""

import numpy as np
from scipy.optimize import least_squares

from validate.arrays import Floats
from validate.recording.images.image import ellipse_through
from validate.recording.images.polar import ANGLES, DIRECTIONS


def ellipse_points(points: Floats) -> Floats:
    """Points (120, 2) on the direct least-squares ellipse (Fitzgibbon et al. 1999) of (k, 2)."""
    centre, axes, turn = ellipse_through(points)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    around = np.stack([axes[0] * np.cos(ANGLES), axes[1] * np.sin(ANGLES)], axis=1)
    return np.asarray(centre + around @ R.T)


def circle_points(points: Floats) -> Floats:
    """Points (120, 2) on the circle of least radial distances to points (k, 2)."""
    middle = points.mean(axis=0)
    scale = float(np.linalg.norm(points - middle, axis=1).mean())

    def off(p: Floats) -> Floats:
        return np.asarray(np.linalg.norm(points - middle - scale * p[:2], axis=1) / scale - p[2])

    found = least_squares(off, [0.0, 0.0, 1.0]).x
    return np.asarray(middle + scale * found[:2] + scale * found[2] * DIRECTIONS)


def off_curve(points: Floats, curve: Floats) -> Floats:
    """Distances (k,) of points (k, 2) from the closed curve through (m, 2), along its chords.

    Of 120 points of a circle the chords lie within 0.04 % of the radius.
    """
    chord = np.roll(curve, -1, axis=0) - curve
    away = points[:, None] - curve
    share = np.clip((away * chord).sum(axis=-1) / (chord**2).sum(axis=-1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - share[..., None] * chord, axis=-1).min(axis=1))
