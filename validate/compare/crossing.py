"""Where a boundary of flat pieces crosses itself."""

import numpy as np
import shapely
from numpy.typing import NDArray

from validate.arrays import Floats, Ints
from validate.compare.boundary import Boundary

# Share of the body's size by which an edge must reach past a triangle on both sides: triangles of
# one flat side lie off their common plane by rounding.
_PAST = 1e-10


def crossings(boundary: Boundary) -> int:
    """Pairs of pieces without a common point that meet: 0 for the boundary of a sound body.

    In space an edge must pass through the other triangle, from strictly one side to the other;
    triangles that lie flat on each other are not seen.
    """
    first, second = _close(boundary)
    if boundary.points.shape[1] == 2:
        return len(first)
    x = boundary.points[boundary.pieces]
    past = _PAST * float(np.ptp(boundary.points, axis=0).max())
    hits = _pierces(x[first], x[second], past) | _pierces(x[second], x[first], past)
    return int(hits.sum())


def _close(boundary: Boundary) -> tuple[Ints, Ints]:
    """Pairs (k,), (k,) of pieces without a common point that meet, in space whose boxes do."""
    x = boundary.points[boundary.pieces]
    low, high = x.min(axis=1), x.max(axis=1)
    if x.shape[2] == 2:
        segments = shapely.linestrings(x)
        first, second = shapely.STRtree(segments).query(segments, predicate="intersects")
    else:
        boxes = shapely.box(*low[:, :2].T, *high[:, :2].T)
        first, second = shapely.STRtree(boxes).query(boxes)
    once = first < second
    first, second = first[once], second[once]
    meet = ((low[first] <= high[second]) & (low[second] <= high[first])).all(axis=1)
    shared = (boundary.pieces[first][:, :, None] == boundary.pieces[second][:, None, :]).any(
        axis=(1, 2)
    )
    keep = meet & ~shared
    return np.asarray(first[keep]), np.asarray(second[keep])


def _pierces(edges_of: Floats, triangle: Floats, past: float) -> NDArray[np.bool_]:
    """Whether an edge of one triangle (k, 3, 3) passes through the other (k, 3, 3)."""
    a, b, c = (triangle[:, i] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    found = np.zeros(len(triangle), dtype=bool)
    for i in range(3):
        p, q = edges_of[:, i], edges_of[:, (i + 1) % 3]
        up, down = _dot(normal, p - a), _dot(normal, q - a)
        turns = np.stack([_dot(np.cross(v - p, w - p), q - p) for v, w in ((a, b), (b, c), (c, a))])
        inside = (turns >= 0).all(axis=0) | (turns <= 0).all(axis=0)
        through = (np.minimum(up, down) < -past) & (np.maximum(up, down) > past)
        found |= through & inside
    return found


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray((a * b).sum(axis=1))
