"""Distances between closed planar outlines."""

import numpy as np
import shapely

from validate.arrays import Floats
from validate.errors import ComparisonError


def normal_distances(outline: Floats, points: Floats) -> Floats:
    """How far the closed `outline` (k, 2) m lies outside each point (m, 2) m: negative inside.

    The distance is the shortest one, so along the outline's normal wherever that is smooth.
    """
    polygon = _polygon(outline)
    marks = shapely.points(points)
    distance = shapely.distance(polygon.exterior, marks)
    return np.asarray(np.where(shapely.contains(polygon, marks), distance, -distance))


def enclosed(outline: Floats) -> tuple[float, Floats]:
    """Area m^2 and centroid (2,) m inside a closed outline."""
    polygon = _polygon(outline)
    return float(polygon.area), np.array([polygon.centroid.x, polygon.centroid.y])


def angular_points(outline: Floats, angles: Floats) -> Floats:
    """Points (a, 2) m of the outline seen from its centroid at polar angles (a,) rad.

    The radius is interpolated linearly in angle; the outline must be star-shaped about its
    centroid, else `ComparisonError`.
    """
    _, centre = enclosed(outline)
    away = outline - centre
    polar = np.arctan2(away[:, 1], away[:, 0])
    around = np.unwrap(np.append(polar, polar[0]))  # the closed way
    ahead = (around - around[0]) * np.sign(around[-1] - around[0])
    back = (np.maximum.accumulate(ahead) - ahead).max()
    if back > np.deg2rad(20) or not 1.5 * np.pi < ahead[-1] < 2.5 * np.pi:
        raise ComparisonError("an outline folds back on itself; its polar angles are not ordered")
    at = np.mod(polar, 2 * np.pi)
    order = np.argsort(at, kind="stable")
    radius = np.interp(
        np.mod(angles, 2 * np.pi),
        at[order],
        np.linalg.norm(away[order], axis=1),
        period=2 * np.pi,
    )
    return np.asarray(centre + radius[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def _polygon(outline: Floats) -> shapely.Polygon:
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid or polygon.area == 0:
        reason = shapely.is_valid_reason(polygon)
        raise ComparisonError(f"outline of {len(outline)} points is not a simple curve: {reason}")
    return polygon
