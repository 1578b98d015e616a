"""Distances between closed planar outlines."""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial.distance import cdist

from validate.arrays import Floats
from validate.errors import ComparisonError

_TURN = 2 * np.pi
EVERY_TEN = np.deg2rad(np.arange(0.0, 360.0, 10.0))  # rad


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
    centre, at, radius = _rays(outline)
    found = np.interp(np.mod(angles, _TURN), at, radius, period=_TURN)
    return np.asarray(centre + found[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def outline_places(angles: Floats) -> tuple[str, ...]:
    """Return the names of places at polar angles (a,) rad."""
    return tuple(f"outline at {deg:.0f} deg" for deg in np.rad2deg(angles))


def ray_points(outline: Floats, angles: Floats) -> Floats:
    """Where rays from the outline's centroid at polar angles (a,) rad cross its straight segments:
    (a, 2) m, on the outline itself."""
    centre, at, radius = _rays(outline)
    after = np.searchsorted(at, np.mod(angles, _TURN)) % len(at)
    before = after - 1
    span = np.mod(at[after] - at[before], _TURN)
    gone = np.mod(angles - at[before], _TURN)
    across = radius[before] * np.sin(gone) + radius[after] * np.sin(span - gone)
    corner = across <= 0  # two vertices on one ray
    whole = radius[before] * radius[after] * np.sin(span) / np.where(corner, 1.0, across)
    found = np.where(corner, radius[after], whole)
    return np.asarray(centre + found[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def at_normals(outline: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return the outline's vertices nearest to points (m, 2) m, and the outward normals there."""
    nearest = cdist(points, outline).argmin(axis=1)
    across = normals(outline)
    middle = enclosed(outline)[1]
    outward = np.sign(((outline - middle) * across).sum(axis=1, keepdims=True))
    return outline[nearest], (outward * across)[nearest]


def along_normals(still: Floats, outlines: Sequence[Floats], angles: Floats) -> Floats:
    """Displacements (nt, a, 2) m of outlines along the normals of the one at rest, at its places at
    polar angles (a,) rad; to first order those of the material."""
    places, across = at_normals(still, ray_points(still, angles))
    away = np.array([normal_distances(outline, places) for outline in outlines])
    return np.asarray((away - normal_distances(still, places))[:, :, None] * across)


def polar_angles(outline: Floats) -> Floats:
    """Polar angles (k,) rad of the outline's points about its centroid."""
    _, centre = enclosed(outline)
    away = outline - centre
    return np.asarray(np.arctan2(away[:, 1], away[:, 0]))


def normals(outline: Floats) -> Floats:
    """Unit normals (k, 2) of a closed outline at its points, across the chord of both next ones."""
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def angular_weights(outline: Floats, angles: Floats) -> Floats:
    """Weights (a, k) by which `angular_points` takes the radii of the outline's points, in the
    order of their polar angles."""
    _, at, _ = _rays(outline)
    ahead = np.mod(angles[:, None] - at, _TURN)
    # Of points at one angle (repeated, or on one ray) the last: the next one lies ahead of it.
    rows, before = np.arange(len(angles)), len(at) - 1 - ahead[:, ::-1].argmin(axis=1)
    after = (before + 1) % len(at)
    share = ahead[rows, before] / np.mod(at[after] - at[before], _TURN)
    weights = np.zeros(ahead.shape)
    weights[rows, before], weights[rows, after] = 1 - share, share
    return weights


def _rays(outline: Floats) -> tuple[Floats, Floats, Floats]:
    """The centroid (2,) m, and polar angles (k,) in 0..2 pi, rising, with radii (k,) m about it."""
    _, centre = enclosed(outline)
    away = outline - centre
    polar = np.arctan2(away[:, 1], away[:, 0])
    around = np.unwrap(np.append(polar, polar[0]))  # the closed way
    ahead = (around - around[0]) * np.sign(around[-1] - around[0])
    back = (np.maximum.accumulate(ahead) - ahead).max()
    if back > np.deg2rad(20) or not 1.5 * np.pi < ahead[-1] < 2.5 * np.pi:
        raise ComparisonError("an outline folds back on itself; its polar angles are not ordered")
    at = np.mod(polar, _TURN)
    order = np.argsort(at, kind="stable")
    return centre, at[order], np.linalg.norm(away[order], axis=1)


def _polygon(outline: Floats) -> shapely.Polygon:
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid or polygon.area == 0:
        reason = shapely.is_valid_reason(polygon)
        raise ComparisonError(f"outline of {len(outline)} points is not a simple curve: {reason}")
    return polygon
