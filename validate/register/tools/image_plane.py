"""Calibration of tracked tools: the image plane of a probe, the tip of a pivoted pointer.

A point at pixel (u, v) of image k lies at R_k (T (s_x u, s_y v, 0)) + t_k in the tracker's frame, T
the rigid transform from the image to the probe, (R_k, t_k) the tracked pose of the probe. It must
meet a known place, or a known straight wire, from which only its distance is known (N-wires and any
other phantom of wires). Were T any affine map, the equations would be linear in nine unknowns:
their least squares is the start. As T is rigid there are eight, found by Gauss-Newton.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError
from validate.register.markers.transform import Similarity

_UNKNOWN = 8
_TIGHT = 1e-14
_STEP = 1e-6  # rad, m, 1
_FLAT = 1e-6  # smallest over largest singular value below which the points leave something open


@dataclass(frozen=True)
class KnownTarget:
    """A known place m in the tracker's frame; with `along` (3,) of length 1 a wire through it."""

    name: str
    place: Floats
    along: Floats | None = None

    @property
    def seen_along(self) -> Floats:
        """What of a distance counts: projector (3, 3)."""
        return np.eye(3) if self.along is None else np.eye(3) - np.outer(self.along, self.along)


@dataclass(frozen=True)
class SeenPoints:
    """Points at `px` (n, 2) px of images `image` (n,), of `targets`; R (n, 3, 3) and t (n, 3) m are
    the probe's poses then."""

    px: Floats
    image: Ints
    targets: tuple[KnownTarget, ...]
    R: Floats
    t: Floats

    @cached_property
    def projectors(self) -> Floats:
        return np.array([target.seen_along for target in self.targets])

    @cached_property
    def places(self) -> Floats:
        return np.array([target.place for target in self.targets])

    def some(self, chosen: Floats | Ints) -> "SeenPoints":
        at = np.flatnonzero(chosen)
        return SeenPoints(self.px[at], self.image[at], tuple(self.targets[i] for i in at),
                          self.R[at], self.t[at])  # fmt: skip

    @property
    def equations(self) -> int:
        """Independent numbers that the points tell."""
        return sum(3 if target.along is None else 2 for target in self.targets)


@dataclass(frozen=True)
class ImagePlane:
    """T_probe_from_image and m_per_px (x, y); `off` (n, 3) m by which the points miss, `left_out`
    (n,) m by how much those of each image do when it does not serve; `covariance` (8, 8) of turn
    (rad), shift (m) and logarithms of the scales."""

    pose: Similarity
    m_per_px: tuple[float, float]
    off: Floats
    left_out: Floats
    covariance: Floats

    @property
    def rms(self) -> float:
        """m, of the points that served."""
        return rms(np.linalg.norm(self.off, axis=1))

    @property
    def predicted(self) -> float:
        """m, of points of images that did not serve; NaN where there is one image."""
        known = self.left_out[np.isfinite(self.left_out)]
        return rms(known) if len(known) else float("nan")

    def sd(self, px: Floats) -> float:
        """Standard uncertainty m (root mean square of three axes) of the place of a pixel (2,)."""
        x = np.array([*(np.asarray(self.m_per_px) * px), 0.0])
        arm = self.pose.R @ x
        turn = -np.cross(np.eye(3), arm)
        scales = self.pose.R[:, :2] * x[:2]
        J = np.hstack([turn, np.eye(3), scales])
        return float(np.sqrt(np.trace(J @ self.covariance @ J.T) / 3))


def image_plane(seen: SeenPoints) -> ImagePlane:
    """Raise `RegistrationError` for too few points, and for ones that leave a motion of the plane
    open, as wires seen from one direction do."""
    pose, scale, J = _fitted(seen)
    off = _misses(seen, pose, scale)
    freedom = max(seen.equations - _UNKNOWN, 1)
    covariance = np.linalg.inv(J.T @ J) * float((off**2).sum()) / freedom
    away = np.full(len(seen.px), np.nan)
    for image in np.unique(seen.image):
        there = seen.image == image
        if there.all():
            continue
        try:
            others = _fitted(seen.some(~there))
        except RegistrationError:
            continue  # the others alone leave something open
        away[there] = np.linalg.norm(_misses(seen.some(there), *others[:2]), axis=1)
    return ImagePlane(pose, scale, off, away, covariance)


def _fitted(seen: SeenPoints) -> tuple[Similarity, tuple[float, float], Floats]:
    if seen.equations <= _UNKNOWN:
        raise RegistrationError(
            f"{len(seen.px)} points give {seen.equations} equations for {_UNKNOWN} unknowns; mark "
            f"more points, in more images"
        )
    # From the least squares in the nine entries of the affine map pixel -> probe.
    size = np.abs(seen.px).max()
    u, v = (seen.px / size).T
    base = np.stack([u, v, np.ones_like(u)], axis=1)
    rows = np.einsum("nij,njk,nc->nick", seen.projectors, seen.R, base).reshape(-1, 9)
    right = np.einsum("nij,nj->ni", seen.projectors, seen.places - seen.t).ravel()
    found, _, rank, _ = np.linalg.lstsq(rows, right, rcond=1e-9)
    across, down, shift = found.reshape(3, 3)
    if rank < 9 or not (np.linalg.norm(across) and np.linalg.norm(down)):
        raise RegistrationError(
            f"the points fix {rank} of 9 numbers of the image plane: mark targets at larger "
            f"distances, in images between which the probe was turned and moved"
        )
    scale = float(np.linalg.norm(across) / size), float(np.linalg.norm(down) / size)
    axes = np.stack([across, down], axis=1) / (size * np.array(scale))
    U, _, V = np.linalg.svd(axes, full_matrices=False)
    x, y = (U @ V).T
    start = Similarity(np.stack([x, y, np.cross(x, y)], axis=1), shift), scale

    def left(by: Floats) -> Floats:
        return _residuals(seen, start, by)

    none = np.zeros(_UNKNOWN)
    found = least_squares(left, none, xtol=_TIGHT, ftol=_TIGHT, gtol=_TIGHT, x_scale="jac")
    pose, scale = _moved(start, found.x)
    # Central differences of the residuals about a plane, (3 n, 8).
    plane = (pose, scale)
    steps = np.eye(_UNKNOWN) * _STEP
    ways = [_residuals(seen, plane, s) - _residuals(seen, plane, -s) for s in steps]
    J = np.stack(ways, axis=1) / (2 * _STEP)
    singular = np.linalg.svd(J / np.linalg.norm(J, axis=0), compute_uv=False)
    if singular[-1] < _FLAT * singular[0]:
        raise RegistrationError(
            "the points do not fix the image plane: turn the probe further between images, or "
            "mark targets at larger distances"
        )
    return pose, scale, J


Plane = tuple[Similarity, tuple[float, float]]


def _moved(plane: Plane, by: Floats) -> Plane:
    pose, (sx, sy) = plane
    turned = Rotation.from_rotvec(by[:3]).as_matrix() @ pose.R
    return Similarity(turned, pose.t + by[3:6]), (sx * np.exp(by[6]), sy * np.exp(by[7]))


def _misses(seen: SeenPoints, pose: Similarity, scale: tuple[float, float]) -> Floats:
    """Where points lie less where they should (n, 3) m, along wires not counted."""
    flat = np.column_stack([seen.px * np.array(scale), np.zeros(len(seen.px))])
    there = np.einsum("nij,nj->ni", seen.R, pose.apply(flat)) + seen.t
    return np.asarray(np.einsum("nij,nj->ni", seen.projectors, there - seen.places))


def _residuals(seen: SeenPoints, plane: Plane, by: Floats) -> Floats:
    return _misses(seen, *_moved(plane, by)).ravel()


def by_target(seen: SeenPoints, off: Floats) -> Sequence[tuple[str, int, float]]:
    """Name, count of points and rms m of each target."""
    names = np.array([target.name for target in seen.targets])
    away = np.linalg.norm(off, axis=1)
    return [(str(n), int((names == n).sum()), rms(away[names == n])) for n in np.unique(names)]


# --- pivot calibration: tip of a tracked tool from rotations about a fixed point -----------------

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
