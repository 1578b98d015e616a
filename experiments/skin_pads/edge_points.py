"""Points of the field that the pads follow: named by marks at rest, or at the edges of the field.

Points are (nt, k, 2) px, at rest first.
"""

import numpy as np
from scipy.spatial import cKDTree

from validate.arrays import Floats
from validate.errors import RecordingError

Points = np.ndarray  # numbers of points (k,)
Marks = tuple[Floats, Floats, Floats, Floats]  # x and y at rest, x and y in the images
_LEAST_POINTS = 2  # of the field, that a pad may follow


def named_points(name: str, points: Floats, files: list[Marks]) -> tuple[Points, Points]:
    """Points of the field at which the marks of the two pads lie at rest.

    They are these points where every mark is within half of the points' spacing of one, each pad
    has two or more, and these are at opposite edges of the field: inside a grid most places are
    near to a point, also marks of other images.
    """
    rest, spacing = points[0], _spacing(points[0])
    off, found = [], []
    for number, (x0, y0, *_) in enumerate(files, start=1):
        if x0.size != y0.size:
            raise RecordingError(
                f"{name}: marks of pad {number} at rest: {x0.size} numbers in x0_ref_"
                f"{number}.dat, {y0.size} in y0_ref_{number}.dat; as many of both are needed"
            )
        distance, nearest = _nearest(rest, np.stack([x0.ravel(), y0.ravel()], axis=1), 1)
        off.append(float(distance.max()))
        found.append(np.unique(nearest))
    at_edge = _at_edges(rest, found[0], found[1], spacing)
    count = [len(f) for f in found]
    if max(off) > spacing / 2 or min(count) < _LEAST_POINTS or at_edge != count:
        states = [1 + m[2].shape[1] for m in files]
        raise RecordingError(
            f"{name}: {len(points)} states of the points, {states} of the marks; and as "
            f"points of the field the marks lie up to [{off[0]:.4g}, {off[1]:.4g}] px from one "
            f"({spacing / 2:.4g} px allowed) and name {count} points ({_LEAST_POINTS} needed), "
            f"{at_edge} of these at the field's edges (all needed): give the marks of these "
            "images, or, where the pads hold the two edges of the field, pass --set "
            "pads.follow=edges"
        )
    return found[0], found[1]


def _at_edges(rest: Floats, one: Points, two: Points, spacing: float) -> list[int]:
    """How many points of the pads are at the two edges of the field, from pad to pad."""
    between = rest[two].mean(axis=0) - rest[one].mean(axis=0)
    distance = float(np.linalg.norm(between))
    if distance < spacing:
        return [0, 0]
    along, slack = rest @ (between / distance), spacing
    return [
        int((along[one] <= along.min() + slack).sum()),
        int((along[two] >= along.max() - slack).sum()),
    ]


def _spacing(rest: Floats) -> float:
    """Median distance px of a point (k, 2) to the nearest other one."""
    return float(np.median(_nearest(rest, rest, 2)[0][:, 1]))


def _nearest(rest: Floats, x: Floats, count: int) -> tuple[Floats, Points]:
    """Distances (m, count) of x (m, 2) to the nearest of points (k, 2), and their numbers."""
    distance, number = cKDTree(rest).query(x, k=list(range(1, count + 1)))
    return np.asarray(distance, dtype=np.float64), np.asarray(number)


def edges(points: Floats) -> tuple[Points, Points]:
    """Points at the two edges of the field across the pull; first those that move more.

    The pull is the image axis of the larger strain; an edge is half of the points' spacing wide.
    """
    rest, moved = points[0], points[-1] - points[0]
    near = _spacing(rest) / 2
    strain = [float(np.polyfit(rest[:, c], moved[:, c], 1)[0]) for c in (0, 1)]
    x = rest[:, int(np.argmax(strain))]
    low, high = np.flatnonzero(x <= x.min() + near), np.flatnonzero(x >= x.max() - near)
    size = [float(np.linalg.norm(np.median(moved[edge], axis=0))) for edge in (low, high)]
    if min(len(low), len(high)) < _LEAST_POINTS:
        raise RecordingError(
            f"pads.follow = edges: {len(low)} and {len(high)} points within {near:.4g} px of the "
            f"edges of the field, {_LEAST_POINTS} of both are needed: remove single points beyond "
            "the grid from the files, or give marks of the pads"
        )
    return (low, high) if size[0] >= size[1] else (high, low)
