"""Pivot calibration: tip of a tracked tool from rotations about a fixed point.

R_i p + T_i = c for every pose i: the tip p in the tool's frame and the point c follow by linear
least squares (the algebraic one step of Yaniv, "Which pivot calibration?", Proc. SPIE 9415, 2015);
less the means over each point only p is left. A tool that turns about one axis alone leaves its
tip open along that axis: such a motion is refused.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError

_LEAST = 20  # poses
_TURNS = 0.1  # rad, rms about the second axis: an error of a pose counts ten times in the tip
_BLOCKS = 10  # parts in time, each left out once
_FAR = 4.0  # standard deviations beyond which the tip did not stand on the point
_MEDIAN = 1.538  # of the length of a vector of three normal numbers of sd 1
_STILL = 0.05  # of the tool's travel about its point, that its tip may travel
_FLOOR = 1e-6  # m: finer than trackers tell


@dataclass(frozen=True)
class Pivot:
    """Tip (3,) m in the tool's frame with its standard deviation (3,) m, the points (k, 3) m that
    it stood on, `off` (n, 3) m of every pose from its point, which of them were `used` (n,), and
    `turns` (3,) rad: the rms turn that decides the tip in its three directions, the least first."""

    tip: Floats
    sd: Floats
    points: Floats
    off: Floats
    used: Ints
    turns: Floats

    @property
    def rms(self) -> float:
        """Rms distance m per axis of the poses that were used from their points."""
        return rms(self.off[self.used]) / float(np.sqrt(3))


def pivot(R: Floats, T: Floats, point: Ints) -> Pivot:
    """Return the tip from rotations R (n, 3, 3) and places T (n, 3) m; `point` (n,) counts from 0.

    Poses that lie beyond four standard deviations of the others, while the tip came or left, are
    not used. The standard deviation is found by leaving out parts in time, so that noise that lasts
    counts as it should. Raises `RegistrationError` for too few poses, for turns that leave the tip
    open, and where less than half of the poses belong to one point each.
    """
    if len(R) < _LEAST:
        raise RegistrationError(f"{len(R)} poses; at least {_LEAST} are needed")
    used = _standing(R, T, point)
    if 2 * len(used) < len(R) or len(used) < _LEAST:
        raise RegistrationError(
            f"the tip stands on a point in {len(used)} of {len(R)} poses, fewer than half: "
            f"shorten the recording to the time in which the tip stands still"
        )
    turns = _turns(R[used], point[used])
    if turns[0] < _TURNS:
        raise RegistrationError(
            f"turned by {np.degrees(turns[0]):.2g} degrees rms about the second axis, at least "
            f"{np.degrees(_TURNS):.2g} are needed: the tip is not determined along one direction; "
            f"tilt the tool to all sides"
        )
    tip = _solved(R[used], T[used], point[used])
    x = R @ tip + T
    points = np.array([x[used][point[used] == k].mean(axis=0) for k in np.unique(point[used])])
    of = np.searchsorted(np.unique(point[used]), point).clip(max=len(points) - 1)
    off = np.asarray(x - points[of])
    found = Pivot(tip, _sd(R[used], T[used], point[used]), points, off, used, turns)
    travel = rms(_centred(T[used], point[used])) / float(np.sqrt(3))
    if found.rms > _STILL * travel:
        raise RegistrationError(
            f"the tip wanders by {1e3 * found.rms:.3g} mm rms where the tool travels "
            f"{1e3 * travel:.3g} mm: it does not stay on one point; hold it still and record again"
        )
    return found


def _centred(values: Floats, point: Ints) -> Floats:
    """Less the mean over each point."""
    out = values.copy()
    for k in np.unique(point):
        out[point == k] -= values[point == k].mean(axis=0)
    return out


def _solved(R: Floats, T: Floats, point: Ints) -> Floats:
    A, b = _centred(R, point).reshape(-1, 3), -_centred(T, point).ravel()
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])


def _turns(R: Floats, point: Ints) -> Floats:
    """Rms turn rad: singular values of R less its mean over the root of the number of poses."""
    size = np.linalg.svd(_centred(R, point).reshape(-1, 3), compute_uv=False)
    return np.asarray(size[::-1] / np.sqrt(len(R)))


def _standing(R: Floats, T: Floats, point: Ints) -> Ints:
    """Poses in which the tip stands: from the quarter that the most others follow, outwards."""
    n = len(R)
    starts = range(0, n - n // 4 + 1, max(n // 8, 1))
    used = min(
        [np.arange(n), *(np.arange(s, s + n // 4) for s in starts)],
        key=lambda some: _spread(_lengths(R, T, point, some)),
    )
    for _ in range(50):
        off = _lengths(R, T, point, used)
        near = np.flatnonzero(off <= _FAR * max(_spread(off), _FLOOR))
        if np.array_equal(near, used):
            break
        used = near
    return used


def _lengths(R: Floats, T: Floats, point: Ints, used: Ints) -> Floats:
    """Distance (n,) m of the tip that some poses tell from its point's median."""
    x = R @ _solved(R[used], T[used], point[used]) + T
    for k in np.unique(point):
        x[point == k] -= np.median(x[point == k], axis=0)
    return np.asarray(np.linalg.norm(x, axis=1))


def _spread(off: Floats) -> float:
    return float(np.median(off)) / _MEDIAN


def _sd(R: Floats, T: Floats, point: Ints) -> Floats:
    """Of the tip, by the jackknife over parts in time."""
    part = np.arange(len(R)) * _BLOCKS // len(R)
    tips = np.array([_solved(R[part != j], T[part != j], point[part != j]) for j in range(_BLOCKS)])
    return np.asarray(np.sqrt((_BLOCKS - 1) * tips.var(axis=0)))
