"""Distances between two boundaries of flat pieces, from samples of each to all of the other."""

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints
from validate.compare.boundary import Boundary, normals
from validate.scene.shape_functions import symmetric_points

_SAMPLES = {2: symmetric_points(1, 3)[0], 3: symmetric_points(2, 2)[0]}  # segment, triangle
_CHUNK = 200_000  # point-piece pairs measured at once


def hausdorff(one: Boundary, other: Boundary) -> float:
    """max over both directions of the largest distance of a sample to the other boundary, m."""
    if _same(one, other):
        return 0.0
    return float(max(_all_samples(one, other).max(), _all_samples(other, one).max()))


def mean_surface_distance(one: Boundary, other: Boundary) -> float:
    """Mean of the two directions' mean distances, each weighted by length (area), m."""
    if _same(one, other):
        return 0.0
    return (_mean(one, other) + _mean(other, one)) / 2


def distances(points: Floats, boundary: Boundary) -> Floats:
    """Distance m of every point (k, d) to the boundary, exact up to rounding."""
    x = boundary.points[boundary.pieces]
    centres = x.mean(axis=1)
    reach = float(np.linalg.norm(x - centres[:, None], axis=2).max())
    near, _ = cKDTree(boundary.points).query(points)
    # The nearest piece holds a point no further than the nearest corner is.
    lists = cKDTree(centres).query_ball_point(points, np.asarray(near) * (1 + 1e-9) + reach)
    found = np.full(len(points), np.inf)
    for part in _parts([len(pieces) for pieces in lists]):
        which = np.repeat(np.arange(len(points))[part], [len(pieces) for pieces in lists[part]])
        pieces = np.concatenate([np.asarray(p, dtype=np.int64) for p in lists[part]])
        np.minimum.at(found, which, np.linalg.norm(_to_simplices(points[which], x[pieces]), axis=1))
    return found


def _same(one: Boundary, other: Boundary) -> bool:
    """Whether nothing differs: Gauss points of one boundary would miss it by rounding, 1e-16."""
    return np.array_equal(one.points, other.points) and np.array_equal(one.pieces, other.pieces)


def _all_samples(one: Boundary, other: Boundary) -> Floats:
    return distances(np.vstack([one.points, _gauss(one)]), other)


def _mean(one: Boundary, other: Boundary) -> float:
    found = distances(_gauss(one), other).reshape(len(one.pieces), -1).mean(axis=1)
    weights = np.linalg.norm(normals(one), axis=1)
    return float(found @ weights / weights.sum())


def _gauss(boundary: Boundary) -> Floats:
    samples = _SAMPLES[boundary.pieces.shape[1]]
    places = np.einsum("qa,sad->sqd", samples, boundary.points[boundary.pieces])
    return np.asarray(places.reshape(-1, boundary.points.shape[1]))


def _parts(lengths: list[int]) -> list[slice]:
    number = np.cumsum(lengths) // _CHUNK
    cuts = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(lengths)]
    return [slice(a, b) for a, b in pairwise(cuts)]


def _to_simplices(p: Floats, x: Floats) -> Floats:
    """Vector (k, d) from each point to the nearest point of its segment or triangle (k, c, d)."""
    if x.shape[1] == 2:
        return _to_segment(p, x[:, 0], x[:, 1])
    edges = [_to_segment(p, x[:, i], x[:, (i + 1) % 3]) for i in range(3)]
    best = np.take_along_axis(np.stack(edges), _shortest(edges)[None, :, None], axis=0)[0]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    square = (normal**2).sum(axis=1)
    sides = [np.cross(x[:, (i + 1) % 3] - x[:, i], p - x[:, i]) for i in range(3)]
    above = np.all([(s * normal).sum(axis=1) >= 0 for s in sides], axis=0) & (square > 0)
    height = ((x[:, 0] - p) * normal).sum(axis=1) / np.where(square > 0, square, 1.0)
    return np.asarray(np.where(above[:, None], height[:, None] * normal, best))


def _shortest(vectors: list[Floats]) -> Ints:
    return np.asarray(np.argmin([np.linalg.norm(v, axis=1) for v in vectors], axis=0))


def _to_segment(p: Floats, a: Floats, b: Floats) -> Floats:
    along = b - a
    square = (along**2).sum(axis=1)
    s = np.clip(((p - a) * along).sum(axis=1) / np.where(square > 0, square, 1.0), 0, 1)
    return np.asarray(a + s[:, None] * along - p)
