"""Similarity transforms and their closed-form least-squares fits from matched points.

Directions are in the names: a fit of `source` onto `target` is T_target_from_source,

    x_target = s R x_source + t,      R proper (det R = +1),      s = 1 unless a scale is asked for.

Sources: K. S. Arun, T. S. Huang, S. D. Blostein, "Least-squares fitting of two 3-D point sets",
IEEE PAMI 9 (1987): rotation from the singular value decomposition of the cross-covariance.
S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
IEEE PAMI 13 (1991), eqs 40-43: rotation, translation, scale, and the correction that keeps the
rotation proper.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from validate.arrays import Floats, checked
from validate.errors import RegistrationError

COLLINEAR = 1e-3  # second over first rms spread of a 3-D set below which it counts as a line
COINCIDENT = 1e-12  # largest spread over largest coordinate below which a set counts as one point
ORTHOGONAL = 1e-9  # largest entry of R^T R - I that still counts as a rotation


@dataclass(frozen=True)
class Similarity:
    """T_target_from_source: x_target = s R x_source + t.

    R (d, d) proper rotation, t (d,) m in the target frame, s > 0 dimensionless; d = 2 or 3.
    Raises `RegistrationError` for other shapes, a reflection, a shear or a scale not above 0.
    """

    R: Floats
    t: Floats
    s: float = 1.0

    def __post_init__(self) -> None:
        t = checked(self.t, "translation t [m]", (None,), error=RegistrationError)
        d = len(t)
        if d not in (2, 3):
            raise RegistrationError(f"translation t: {d} coordinates, expected 2 or 3")
        R = checked(self.R, "rotation R", (d, d), error=RegistrationError)
        error = float(np.abs(R.T @ R - np.eye(d)).max())
        det = float(np.linalg.det(R))
        if error > ORTHOGONAL or det < 0:
            raise RegistrationError(
                f"rotation R: |R^T R - I| {error:.1e}, det {det:+.3f}; expected 0 and +1"
            )
        if not (np.isfinite(self.s) and self.s > 0):
            raise RegistrationError(f"scale s: {self.s}, expected a number > 0")
        object.__setattr__(self, "R", R)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "s", float(self.s))

    def apply(self, points: ArrayLike) -> Floats:
        """Points (..., d) m of the source frame in the target frame, m; NaN stays NaN."""
        mapped: Floats = self.s * np.asarray(points, dtype=np.float64) @ self.R.T + self.t
        return mapped

    @property
    def matrix(self) -> Floats:
        """The homogeneous matrix (d+1, d+1), translation in m."""
        d = len(self.t)
        matrix = np.eye(d + 1)
        matrix[:d, :d] = self.s * self.R
        matrix[:d, d] = self.t
        return matrix

    def inverse(self) -> "Similarity":
        """T_source_from_target."""
        return Similarity(self.R.T, -(self.t @ self.R) / self.s, 1.0 / self.s)


def fit_rigid(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> Similarity:
    """T_target_from_source with s = 1 that minimises sum_i w_i |R x_i + t - y_i|^2.

    source, target (k, d) m row by row the same points, d = 2 or 3; weights (k,) >= 0, default 1.
    Raises `RegistrationError` for shapes, non-finite values and degenerate sets (`check_spread`).
    A planar 3-D set fits its mirror image exactly; the proper rotation is the one returned.
    Source: Arun 1987, eqs 11-13, with the determinant correction of Umeyama 1991, eqs 40, 41, 43.
    """
    return _fit(*_pairs(source, target, weights), scaled=False)


def fit_similarity(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None
) -> Similarity:
    """As `fit_rigid`, with the scale free.

    Source: Umeyama 1991, eqs 40-43. The scale is fitted in the target frame: noise in the source
    biases it low by about noise variance over marker variance.
    """
    return _fit(*_pairs(source, target, weights), scaled=True)


def spread(points: Floats, weights: Floats | None = None) -> Floats:
    """Rms extent of points (k, d) m along their principal axes about the centroid, (d,) m, falling.

    These are the singular values of the centred set over sqrt(k).
    """
    w = np.full(len(points), 1.0) if weights is None else weights
    w = w / w.sum()
    centred = np.sqrt(w)[:, None] * (points - w @ points)
    values: Floats = np.zeros(points.shape[1])
    found = np.linalg.svd(centred, compute_uv=False)
    values[: len(found)] = found
    return values


def check_spread(points: Floats, name: str, weights: Floats | None = None) -> None:
    """Raise `RegistrationError` when points (k, d) m do not determine a rotation.

    Refused: fewer than d points; coincident points (largest spread below `COINCIDENT` of the
    largest coordinate); in 3-D collinear points (second spread below `COLLINEAR` of the first).
    """
    used = points if weights is None else points[weights > 0]
    k, d = used.shape
    if k < d:
        raise RegistrationError(f"{name}: {k} points, a fit in {d}-D needs {d}: add markers")
    values = spread(points, weights)
    shown = ", ".join(f"{1e3 * v:.3g}" for v in values)
    if values[0] <= COINCIDENT * np.abs(used).max():
        raise RegistrationError(
            f"{name}: {k} coincident points (spread {shown} mm along principal axes): move the "
            f"markers to different places"
        )
    if d == 3 and values[1] < COLLINEAR * values[0]:
        raise RegistrationError(
            f"{name}: {k} collinear points (spread {shown} mm along principal axes, second over "
            f"first below {COLLINEAR:g}): add a marker off the line"
        )


def _pairs(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None
) -> tuple[Floats, Floats, Floats]:
    x = checked(source, "source points [m]", (None, None), error=RegistrationError)
    if x.shape[1] not in (2, 3):
        raise RegistrationError(f"source points: shape {x.shape}, expected (any, 2) or (any, 3)")
    y = checked(target, "target points [m]", x.shape, error=RegistrationError)
    w = np.ones(len(x)) if weights is None else weights
    w = checked(w, "weights", (len(x),), error=RegistrationError)
    if (w < 0).any():
        raise RegistrationError(f"weights: {int((w < 0).sum())} below 0, smallest {w.min():g}")
    check_spread(x, "source points", w)
    check_spread(y, "target points", w)
    return x, y, w / w.sum()


def _fit(x: Floats, y: Floats, w: Floats, *, scaled: bool) -> Similarity:
    mean_x, mean_y = w @ x, w @ y
    x, y = x - mean_x, y - mean_y
    covariance = (y * w[:, None]).T @ x  # Umeyama eq 38
    U, D, Vt = np.linalg.svd(covariance)
    S = np.ones(len(D))
    S[-1] = np.sign(np.linalg.det(U) * np.linalg.det(Vt))  # eq 43: keeps det R = +1
    R = (U * S) @ Vt  # eq 40
    s = float((D * S).sum() / (w @ (x**2).sum(axis=1))) if scaled else 1.0  # eq 42
    return Similarity(R, mean_y - s * R @ mean_x, s)  # eq 41
