"""Ellipses and circles through an outline's points."""

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
