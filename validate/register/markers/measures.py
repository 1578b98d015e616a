"""Quality measures of a point registration: FRE, TRE, mirror images and outliers.

FLE is the localisation error of one marker, FRE the residual at the markers, TRE the error at a
point of interest; all are rms distances in m over all d axes. FRE is no accuracy: it does not know
where the target lies, and 2 or collinear markers give FRE 0 with a wrong rotation.

Sources: J. M. Fitzpatrick, J. B. West, C. R. Maurer, "Predicting error in rigid-body point-based
registration", IEEE Trans. Med. Imaging 17 (1998): FRE^2 = (1 - 2/k) FLE^2 and
TRE^2(r) = FLE^2/k (1 + 1/3 sum_i d_i^2/f_i^2), first order in FLE over marker spread, isotropic
independent noise. Here as a covariance, so that any direction can be told apart; the 2-D and the
scaled forms follow from the same linearisation.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from validate.arrays import Floats, rms
from validate.register.markers.transform import Similarity, fit_rigid, fit_similarity

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
    return fit_similarity if scaled else fit_rigid


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
    robust = _absolute_fit(source, target, noise, scaled).apply(source) - target
    limit = bound * max(noise, robust_noise(robust)) ** 2
    suspect = (robust**2).sum(axis=1) > limit
    if not suspect.any() or k - suspect.sum() < FEWEST:
        return ()
    return _judged(names, source, target, suspect, noise, scaled)


def _judged(
    names: Sequence[str],
    source: Floats,
    target: Floats,
    suspect: Mask,
    noise: float,
    scaled: bool,
) -> tuple[Outlier, ...]:
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


def _absolute_fit(source: Floats, target: Floats, noise: float, scaled: bool) -> Similarity:
    """Least sum of distances by reweighting; distances below the noise count as the noise."""
    fit = fit_similarity if scaled else fit_rigid
    weights = np.ones(len(source))
    for _ in range(30):  # only picks suspects: `_judged` decides, converged or not
        lengths = np.linalg.norm(fit(source, target, weights).apply(source) - target, axis=1)
        weights = noise / np.maximum(lengths, noise)
    return fit(source, target, weights)


def _turns(r: Floats, values: Floats) -> list[Floats]:
    """Movement (m, d) per unit of each rotation, over the rms distance f_i of the markers."""
    if r.shape[1] == 2:
        turned = np.stack([-r[:, 1], r[:, 0]], axis=1)
        return [turned / np.sqrt(values.sum())]
    axes = np.eye(3)
    return [np.cross(axes[i], r) / np.sqrt(values.sum() - values[i]) for i in range(3)]
