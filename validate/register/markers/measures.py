"""Quality measures of a point registration: FRE, TRE, mirror images, outliers, marker names.

FLE is the localisation error of one marker, FRE the residual at the markers, TRE the error at a
point of interest; all are rms distances in m over all d axes. FRE is no accuracy: it does not
know where the target lies, and 2 or collinear markers give FRE 0 with a wrong rotation.

Sources: J. M. Fitzpatrick, J. B. West, C. R. Maurer, "Predicting error in rigid-body point-based
registration", IEEE Trans. Med. Imaging 17 (1998): FRE^2 = (1 - 2/k) FLE^2 and
TRE^2(r) = FLE^2/k (1 + 1/3 sum_i d_i^2/f_i^2), first order in FLE over marker spread, isotropic
independent noise. Here as a covariance, so that any direction can be told apart; the 2-D and the
scaled forms follow from the same linearisation.

Check of marker names: relabelling by iterated closest assignment.

Given labels are never changed: a better labelling is only reported. With points alone, labels
that are wrong by a symmetry of the marker set (a regular grid turned by half a turn) fit as well
as the right ones and cannot be seen.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation
from scipy.special import chdtri

from validate.arrays import Floats, Ints, rms
from validate.register.markers.transform import Similarity, fit_similarity, spread

P_EXCESS = 1e-3  # chance that noise alone exceeds a bound stated here
CLEARLY = 3.0  # an alternative this many times better explains an excess
BETTER = 1.5  # ... or this many times, when it agrees with the declared noise
ROUNDING = 1e-9  # noise floor over marker spread: data said to be exact still carry rounding
FEWEST = 4  # markers that leave the residual of a rigid 3-D fit some redundancy

Fit = Callable[[Floats, Floats], Similarity]
Mask = NDArray[np.bool_]


class Reflection(NamedTuple):
    """Rms residuals, m, of the best fit by a proper rotation and by a reflection."""

    proper: float
    improper: float


class Scale(NamedTuple):
    """Size of the source over that of the target, and the half-width of its 99.9 % interval."""

    value: float
    half: float


class Outlier(NamedTuple):
    """A marker far from the fit to the others: its distance from where they put it, m."""

    name: str
    residual: float


def least_squares(scaled: bool) -> Fit:
    """Return the rigid fit, or the one with a scale."""
    return fit_similarity if scaled else Similarity.rigid


def chi_square_bound(dof: int, p: float = P_EXCESS) -> float:
    """Return the value that a chi-square with `dof` degrees of freedom exceeds with probability
    p."""
    return float(chdtri(dof, p))


def fit_parameters(d: int, scaled: bool) -> int:
    """Numbers a fit takes from the data: d shifts, d (d-1)/2 rotations, a scale if asked for."""
    return d + d * (d - 1) // 2 + int(scaled)


def localisation_error(fre: float, k: int, d: int, scaled: bool = False) -> float:
    """FLE, m, estimated from FRE, m, of k markers in d dimensions.

    FLE^2 = FRE^2 / (1 - p/(d k)) with p fitted parameters: Fitzpatrick's 1 - 2/k for rigid 3-D.
    NaN when nothing is left over (d k <= p).
    """
    share = 1 - fit_parameters(d, scaled) / (d * k)
    return float(fre / np.sqrt(share)) if share > 0 else float("nan")


def target_covariance(points: Floats, markers: Floats, fle: float, scaled: bool = False) -> Floats:
    """Predicted covariance (m, d, d), m^2, of the registration error at points (m, d) m.

    markers (k, d) m in the same frame, fle m. The trace is Fitzpatrick's TRE^2: a shift of
    variance sd^2/k, a rotation about each principal axis of variance sd^2/(k f_i^2) with f_i the
    rms distance of the markers from it, and with `scaled` a relative scale of sd^2/(k f^2).
    """
    k, d = markers.shape
    centre = markers.mean(axis=0)
    values, axes = np.linalg.eigh((markers - centre).T @ (markers - centre) / k)
    r = (points - centre) @ axes  # components along the principal axes
    moved = [np.broadcast_to(e, r.shape) for e in np.eye(d)]  # columns of d(error)/d(parameter)
    moved += _turns(r, values)
    if scaled:
        moved.append(r / np.sqrt(values.sum()))
    J = np.stack(moved, axis=-1)
    local = fle**2 / (d * k) * J @ J.transpose(0, 2, 1)
    covariance: Floats = axes @ local @ axes.T
    return covariance


def reflection(source: Floats, target: Floats, fit: Fit, across: Floats) -> Reflection:
    """Residuals of `fit` and of the best fit by a reflection; points (k, d) m.

    `across` (d,) is the normal of the plane in which the source is mirrored before `fit`; every
    reflection is that mirror and a rotation. A planar 3-D set cannot be told from its mirror image
    by a fit free to turn it over: both residuals are equal then, and only a fit that keeps a
    declared side (`up` of `fit_two_step`), with `across` normal to `up`, sees a mirror.
    """
    n = across / np.linalg.norm(across)
    mirrored = source - 2 * np.outer(source @ n, n)
    return Reflection(*(rms(fit(x, target).apply(x) - target) for x in (source, mirrored)))


def looks_mirrored(found: Reflection, bound: float) -> bool:
    """True when the reflection explains an excess; `bound` m is the largest rms noise explains."""
    if found.proper <= bound:
        return False
    factor = BETTER if found.improper <= bound else CLEARLY
    return found.proper > factor * found.improper


def fitted_scale(source: Floats, target: Floats, noise: float) -> Scale:
    """Return the scale of points (k, d) m with noise m per axis in the source, unbiased by it.

    Fitted onto the source, where the noise is; sd of a relative scale as in `target_covariance`.
    """
    k, d = source.shape
    back = fit_similarity(target, source)
    fle = localisation_error(rms(back.apply(target) - source), k, d, scaled=True)
    sd = max(noise, fle / float(np.sqrt(d))) if np.isfinite(fle) else noise
    size = rms(target - target.mean(axis=0))
    return Scale(back.s, float(np.sqrt(chi_square_bound(1) / k)) * sd / size)


def robust_noise(residuals: Floats) -> float:
    """Noise per axis, m, from the median length of residuals (k, d) m (a scaled MAD about 0)."""
    lengths = np.linalg.norm(residuals, axis=1)
    return float(np.median(lengths) / np.sqrt(chi_square_bound(residuals.shape[1], 0.5)))


def find_outliers(
    names: Sequence[str], source: Floats, target: Floats, noise: float, scaled: bool = False
) -> tuple[Outlier, ...]:
    """Markers far from where the others put them; points (k, d) m, noise m per axis.

    Suspects stand out from a least-absolute-distance fit; each is then judged by the least-squares
    fit to all markers that are not suspect (leave-out): outlier when its squared distance over
    noise and predicted TRE exceeds the chi-square bound with d degrees of freedom at `P_EXCESS`/k,
    so that a clean set raises one in a thousand times. The noise is the declared one or, if
    larger, that of the markers left. Empty when fewer than `FEWEST` remain; suspects are always
    fewer than half, since their limit lies above the median.
    """
    k, d = source.shape
    bound = chi_square_bound(d, P_EXCESS / k)
    # Least sum of distances by reweighting; distances below the noise count as the noise.
    fit = fit_similarity if scaled else Similarity.rigid
    weights = np.ones(len(source))
    for _ in range(30):  # only picks suspects: `_judged` decides, converged or not
        lengths = np.linalg.norm(fit(source, target, weights).apply(source) - target, axis=1)
        weights = noise / np.maximum(lengths, noise)
    robust = fit(source, target, weights).apply(source) - target
    limit = bound * max(noise, robust_noise(robust)) ** 2
    suspect = (robust**2).sum(axis=1) > limit
    if not suspect.any() or k - suspect.sum() < FEWEST:
        return ()
    kept = ~suspect
    transform = least_squares(scaled)(source[kept], target[kept])
    off = transform.apply(source) - target
    k, d = source.shape
    fle = localisation_error(rms(off[kept]), int(kept.sum()), d, scaled)
    sd = max(noise, fle / np.sqrt(d))
    at = [int(i) for i in np.flatnonzero(suspect)]
    spread = target_covariance(target[at], target[kept], sd * np.sqrt(d), scaled)
    inverse = np.linalg.inv(spread + sd**2 * np.eye(d))
    squared = np.einsum("ni,nij,nj->n", off[at], inverse, off[at])
    return tuple(
        Outlier(names[i], float(np.linalg.norm(off[i])))
        for i, value in zip(at, squared, strict=True)
        if value > chi_square_bound(d, P_EXCESS / k)
    )


def _turns(r: Floats, values: Floats) -> list[Floats]:
    """Movement (m, d) per unit of each rotation, over the rms distance f_i of the markers."""
    if r.shape[1] == 2:
        turned = np.stack([-r[:, 1], r[:, 0]], axis=1)
        return [turned / np.sqrt(values.sum())]
    axes = np.eye(3)
    return [np.cross(axes[i], r) / np.sqrt(values.sum() - values[i]) for i in range(3)]


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
    # Centroid on centroid, size on size, principal axes on principal axes, turned.
    A, B = _axes(source), _axes(target)
    s = float(np.linalg.norm(spread(target)) / np.linalg.norm(spread(source)))
    centre, onto = source.mean(axis=0), target.mean(axis=0)
    rotations = [B @ turn @ A.T for turn in _symmetric_turns(source.shape[1])]
    for start in [Similarity(R, onto - s * R @ centre, s) for R in rotations]:
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
    names = [names[i] for i in best.moved]
    if len(names) <= SHOWN:
        moved = ", ".join(names[:-1]) + f" and {names[-1]}"
    else:
        moved = f"{', '.join(names[:SHOWN])} and {len(names) - SHOWN} others"
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
    # The assignment when all distances beyond the marker spacing count the same. An outlier then
    # keeps its label, where plain squares would shift a whole row to meet it.
    cost = np.minimum(_squared(transform, source, target) / _spacing(target) ** 2, 1.0)
    cost -= 1e-9 * np.eye(len(cost))  # ties go to the given label
    order = linear_sum_assignment(cost)[1]
    transform = fit(source, target[order])
    return Relabelling(order, rms(transform.apply(source) - target[order]))


def _squared(transform: Similarity, source: Floats, target: Floats) -> Floats:
    distances: Floats = cdist(transform.apply(source), target, "sqeuclidean")
    return distances


def _axes(points: Floats) -> Floats:
    """Principal axes as right-handed columns, the smallest last."""
    Vt = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2]
    Vt[-1] *= np.sign(np.linalg.det(Vt))
    axes: Floats = Vt.T
    return axes


def _symmetric_turns(d: int) -> list[Floats]:
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
