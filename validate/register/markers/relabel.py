"""Check of marker names: relabelling by iterated closest assignment.

Given labels are never changed: a better labelling is only reported. With points alone, labels that
are wrong by a symmetry of the marker set (a regular grid turned by half a turn) fit as well as the
right ones and cannot be seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints, rms
from validate.register.markers.measures import CLEARLY, Fit, chi_square_bound
from validate.register.markers.transform import Similarity, spread

STEPS = 50  # assignment and refit; the residual falls each time, few are needed
TURNS = 24  # starts per turn: every 15 degrees, in 3-D for both sides of the marker plane
EQUAL = 2 * np.log(1000.0)  # chi-square difference below which two labellings are equally good
NEAR = 0.25  # residual over marker spacing below which an assignment is no coincidence
SHOWN = 6  # names in a message


@dataclass(frozen=True)
class Relabelling:
    """Source point i belongs to target point order[i]; rms residual m after the refit."""

    order: Ints
    rms: float

    @property
    def moved(self) -> Ints:
        """The source points that get another label."""
        return np.flatnonzero(self.order != np.arange(len(self.order)))


def relabellings(source: Floats, target: Floats, fit: Fit, noise: float) -> tuple[Relabelling, ...]:
    """Return the best labelling found, followed by others equally good; points (k, d) m, noise m
    per axis.

    Starts from the given labels; unless moving fewer than half of them explains the excess
    (`label_fault`), also from the principal axes of both sets, with `TURNS` rotations about the
    smallest one and, in 3-D, the 60 rotations of the icosahedron. Equally good: likelihood within
    1:1000, at the declared noise or, if larger, that of the best.
    """
    k, d = source.shape
    first = _closest(source, target, fit(source, target), fit)
    if 2 * len(first.moved) < k and _explains(first, source, target, fit, noise):
        return (first,)
    found = {first.order.tobytes(): first}
    for start in _starts(source, target):
        one = _closest(source, target, start, fit)
        found.setdefault(one.order.tobytes(), one)
    ranked = sorted(found.values(), key=lambda one: one.rms)
    scale = max(noise, ranked[0].rms / np.sqrt(d))
    limit = ranked[0].rms ** 2 + EQUAL * scale**2 / k
    return tuple(one for one in ranked if one.rms**2 <= limit)


def label_fault(
    names: Sequence[str], source: Floats, target: Floats, fit: Fit, noise: float
) -> str | None:
    """Return the fault of the labels in one line, or None.

    A labelling explains an excess when it lowers the rms residual of the markers it moves
    `CLEARLY` times, down to the declared noise or below `NEAR` of the marker spacing (unrelated
    clouds come as close as their spacing).
    """
    best, *rivals = relabellings(source, target, fit, noise)
    if not _explains(best, source, target, fit, noise):
        return None
    before = rms(fit(source, target).apply(source) - target)
    change = f"residual {1e3 * before:.3g} -> {1e3 * best.rms:.3g} mm"
    moved = _listed([names[i] for i in best.moved])
    if rivals:
        return (
            f"markers {moved} seem permuted ({change}), but {1 + len(rivals)} labellings fit "
            f"equally well (up to {1e3 * rivals[-1].rms:.3g} mm): ambiguous; correct the labels "
            f"manually"
        )
    verb = "swapped" if len(best.moved) == 2 else "permuted"
    return f"markers {moved} seem {verb}: {change}; correct the names or exclude them"


def _explains(best: Relabelling, source: Floats, target: Floats, fit: Fit, noise: float) -> bool:
    moved = best.moved
    if len(moved) == 0:
        return False
    before = rms((fit(source, target).apply(source) - target)[moved])
    matched = target[best.order]
    residuals = fit(source, matched).apply(source) - matched
    after = rms(residuals[moved])
    bound = np.sqrt(chi_square_bound(residuals[moved].size) / len(moved))  # rms over noise
    near = max(bound * noise, NEAR * _spacing(target))
    return bool(before > CLEARLY * after and after <= near)


def _closest(source: Floats, target: Floats, start: Similarity, fit: Fit) -> Relabelling:
    transform, order = start, np.full(len(source), -1)
    for _ in range(STEPS):
        _, assigned = linear_sum_assignment(_squared(transform, source, target))
        if np.array_equal(assigned, order):
            break
        order = assigned
        transform = fit(source, target[order])
    order = _settled(_squared(transform, source, target), _spacing(target))
    transform = fit(source, target[order])
    return Relabelling(order, rms(transform.apply(source) - target[order]))


def _squared(transform: Similarity, source: Floats, target: Floats) -> Floats:
    distances: Floats = cdist(transform.apply(source), target, "sqeuclidean")
    return distances


def _settled(squared: Floats, spacing: float) -> Ints:
    """The assignment when all distances beyond the marker spacing count the same.

    An outlier then keeps its label, where plain squares would shift a whole row to meet it.
    """
    cost = np.minimum(squared / spacing**2, 1.0)
    cost -= 1e-9 * np.eye(len(cost))  # ties go to the given label
    order: Ints = linear_sum_assignment(cost)[1]
    return order


def _starts(source: Floats, target: Floats) -> list[Similarity]:
    """Centroid on centroid, size on size, principal axes on principal axes, turned."""
    A, B = _axes(source), _axes(target)
    s = float(np.linalg.norm(spread(target)) / np.linalg.norm(spread(source)))
    centre, onto = source.mean(axis=0), target.mean(axis=0)
    rotations = [B @ turn @ A.T for turn in _turns(source.shape[1])]
    return [Similarity(R, onto - s * R @ centre, s) for R in rotations]


def _axes(points: Floats) -> Floats:
    """Principal axes as right-handed columns, the smallest last."""
    Vt = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2]
    Vt[-1] *= np.sign(np.linalg.det(Vt))
    axes: Floats = Vt.T
    return axes


def _turns(d: int) -> list[Floats]:
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    turns = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()
    if d == 2:
        return [*turns[:, :2, :2]]
    turned_over = turns @ np.diag([1.0, -1.0, -1.0])
    return [*turns, *turned_over, *Rotation.create_group("I").as_matrix()]


def _spacing(points: Floats) -> float:
    """Median distance to the nearest other point, m."""
    distances = cdist(points, points)
    np.fill_diagonal(distances, np.inf)
    return float(np.median(distances.min(axis=1)))


def _listed(names: Sequence[str]) -> str:
    if len(names) <= SHOWN:
        return ", ".join(names[:-1]) + f" and {names[-1]}"
    return f"{', '.join(names[:SHOWN])} and {len(names) - SHOWN} others"
