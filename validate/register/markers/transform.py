"""Similarity transforms and their least-squares fits from matched points: closed-form, two-step of
planar markers, and with anisotropic noise.

Directions are in the names: a fit of `source` onto `target` is T_target_from_source,

    x_target = s R x_source + t,      R proper (det R = +1),      s = 1 unless a scale is asked for.

Sources: K. S. Arun, T. S. Huang, S. D. Blostein, "Least-squares fitting of two 3-D point sets",
IEEE PAMI 9 (1987): rotation from the singular value decomposition of the cross-covariance.
S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
IEEE PAMI 13 (1991), eqs 40-43: rotation, translation, scale, and the correction that keeps the
rotation proper.

Two-step least-squares registration of planar markers (paper 000).

Gosline, Salcudean, Yan, "Haptic simulation of linear elastic media with fluid pockets" (2004),
section 4.5: the undeformed markers are fitted to a plane, then linear least squares compensates
for rotation and scaling within it.

Step 1: total least squares plane through each set (smallest singular vector of the centred points)
and the proper rotation that lays the source plane on the target plane.
Step 2: with in-plane coordinates as complex numbers a (source) and b (target), the linear least
squares factor z of  b = z a  is  z = a^H b / a^H a : angle arg z, scale |z|.

A plane has two sides, and only one of the two normals gives the right handedness. `up` declares
the side; without it the proper rotation with the lower residual of the two is taken. Laying the
plane on its wrong side fits a set mirrored within its plane, exactly: without `up` that mirror
cannot be seen from the points.

Departures: the paper fits a scale, and so lets its scale and shift enter the comparison; here the
scale is off unless asked for (`scale=True` replays the paper), and it acts along the normal too.
The paper does not say how it chooses the side of the plane.

Rigid fit of markers with anisotropic noise, and its covariance.

Noise of covariance C lies in the source: the maximum-likelihood fit minimises the sum of
r^T C^-1 r with r_i = x_i - R^T (y_i - t), by Gauss-Newton over a small turn w and shift d of the
source frame, r -> r + w x p + d with p_i = R^T (y_i - t).
"""

from dataclasses import dataclass
from typing import NamedTuple

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

    @classmethod
    def rigid(
        cls, source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None
    ) -> "Similarity":
        """T_target_from_source with s = 1 that minimises sum_i w_i |R x_i + t - y_i|^2.

        source, target (k, d) m row by row the same points, d = 2 or 3; weights (k,) >= 0, default
        1. Raises `RegistrationError` for shapes, non-finite values and degenerate sets
        (`check_spread`). A planar 3-D set fits its mirror image exactly; the proper rotation is the
        one returned. Source: Arun 1987, eqs 11-13, with the determinant correction of Umeyama 1991,
        eqs 40, 41, 43.
        """
        return _fit(*_pairs(source, target, weights), scaled=False)


def fit_similarity(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None
) -> Similarity:
    """As `Similarity.rigid`, with the scale free.

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


PLANAR = 0.5  # third over second rms spread above which a set has no plane to speak of

Up = tuple[ArrayLike, ArrayLike]


class Plane(NamedTuple):
    """Centroid (3,) m; `axes` (3, 3) right-handed columns: two in the plane, then the normal."""

    centre: Floats
    axes: Floats


def fit_plane(points: ArrayLike, name: str = "points", up: ArrayLike | None = None) -> Plane:
    """Return the total least squares plane of points (k, 3) m, its normal on the side of `up` (3,).

    Raises `RegistrationError` for degenerate sets, a set without a plane (third over second rms
    spread above `PLANAR`) and an `up` within the plane.
    """
    x = checked(points, f"{name} [m]", (None, 3), error=RegistrationError)
    check_spread(x, name)
    centre = x.mean(axis=0)
    _, values, Vt = np.linalg.svd(x - centre, full_matrices=True)
    if len(values) == 3 and values[2] > PLANAR * values[1]:
        shown = ", ".join(f"{1e3 * v / np.sqrt(len(x)):.3g}" for v in values)
        raise RegistrationError(
            f"{name}: not a plane (spread {shown} mm along principal axes, third over second above "
            f"{PLANAR:g}): use the rigid method, without `up`"
        )
    axes = Vt.T * np.array([1.0, 1.0, np.sign(np.linalg.det(Vt))])
    plane = Plane(centre, axes)
    if up is None:
        return plane
    direction = checked(up, f"{name}: up", (3,), error=RegistrationError)
    along = float(plane.axes[:, 2] @ direction)
    if abs(along) <= 0.1 * np.linalg.norm(direction):
        angle = f"normal part {abs(along):.2g} of length {np.linalg.norm(direction):.2g}"
        raise RegistrationError(
            f"{name}: `up` lies in the marker plane ({angle}): point it to the side of the pen"
        )
    return plane if along > 0 else _turned(plane)


def fit_two_step(
    source: ArrayLike, target: ArrayLike, *, up: Up | None = None, scale: bool = False
) -> Similarity:
    """T_target_from_source of planar markers by plane, then in-plane rotation (and scale).

    source, target (k, 3) m row by row the same points; `up`: directions (3,), (3,) in the source
    and in the target frame to the same side of the marker plane, e.g. that of the pen or camera.
    Raises `RegistrationError` as `fit_plane`, or when the in-plane angle is not determined.
    Source: paper 000, section 4.5; equal to `Similarity.rigid` on exactly planar data.
    """
    x = checked(source, "source points [m]", (None, 3), error=RegistrationError)
    y = checked(target, "target points [m]", x.shape, error=RegistrationError)
    up_source, up_target = up or (None, None)
    onto = fit_plane(y, "target points", up_target)
    side = fit_plane(x, "source points", up_source)
    first = _lay(x, y, side, onto, scale)
    if up is not None:
        return first
    second = _lay(x, y, _turned(side), onto, scale)
    return min((first, second), key=lambda T: float(((T.apply(x) - y) ** 2).sum()))


def _lay(x: Floats, y: Floats, side: Plane, onto: Plane, scale: bool) -> Similarity:
    """The fit that lays normal on normal."""
    a, b = _in_plane(x, side), _in_plane(y, onto)
    z = np.vdot(a, b) / np.vdot(a, a)
    if abs(z) ** 2 * np.vdot(a, a).real <= 1e-24 * np.vdot(b, b).real:
        raise RegistrationError(
            f"in-plane angle of {len(x)} points not determined (factor {abs(z):.1e}): check labels"
        )
    s = float(abs(z)) if scale else 1.0
    c, n = z.real / abs(z), z.imag / abs(z)
    turn = np.array([[c, -n, 0.0], [n, c, 0.0], [0.0, 0.0, 1.0]])
    R = onto.axes @ turn @ side.axes.T
    return Similarity(R, onto.centre - s * R @ side.centre, s)


def _in_plane(points: Floats, plane: Plane) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    local = (points - plane.centre) @ plane.axes
    complex_points: np.ndarray[tuple[int], np.dtype[np.complex128]] = local[:, 0] + 1j * local[:, 1]
    return complex_points


def _turned(plane: Plane) -> Plane:
    """The same plane seen from its other side; the axes stay right-handed."""
    return Plane(plane.centre, plane.axes * np.array([1.0, -1.0, -1.0]))


_MOST = 50  # Gauss-Newton steps; a handful suffices from the isotropic fit
_SMALL = 1e-11  # rad, and shift over the markers' size, at which they end


def covariance_of(sd: Floats) -> Floats:
    """(3, 3) m^2 of three standard deviations m along the source's axes, or a covariance itself.

    Raises `RegistrationError` unless it is symmetric and positive definite.
    """
    C = np.diag(sd**2) if sd.ndim == 1 else sd
    if C.shape != (3, 3) or not np.isfinite(C).all() or not np.allclose(C, C.T):
        raise RegistrationError(
            f"marker noise of shape {np.shape(sd)}: expected one sd, three or a 3 x 3 covariance"
        )
    if np.linalg.eigvalsh(C).min() <= 0:
        raise RegistrationError("marker noise: its covariance is not positive; give sd above 0 m")
    return C


def fit_weighted(source: Floats, target: Floats, C: Floats, start: Similarity) -> Similarity:
    """T_target_from_source of points (k, 3) m with noise C (3, 3) m^2 in the source.

    Raises `RegistrationError` when the steps do not end.
    """
    W = np.linalg.inv(C)
    size = float(np.abs(source - source.mean(axis=0)).max())
    R, t = start.R, start.t
    for _ in range(_MOST):
        p = (target - t) @ R
        J = _moves(p)
        step = np.linalg.solve(
            np.einsum("kia,ij,kjb->ab", J, W, J), -np.einsum("kia,ij,kj->a", J, W, source - p)
        )
        R, t = _weighted_turn(R, step[:3]), t + R @ step[3:]
        if np.abs(step[:3]).max() < _SMALL and np.abs(step[3:]).max() < _SMALL * size:
            return Similarity(R, t)
    raise RegistrationError(f"the weighted fit did not converge in {_MOST} steps: check the noise")


def weighted_covariance(points: Floats, markers: Floats, C: Floats, T: Similarity) -> Floats:
    """Covariance (m, 3, 3) m^2 of the registration error at points (m, 3) m of the target frame."""
    J, at = _moves((markers - T.t) @ T.R), _moves((points - T.t) @ T.R)
    parameters = np.linalg.inv(np.einsum("kia,ij,kjb->ab", J, np.linalg.inv(C), J))
    error: Floats = T.R @ (at @ parameters @ at.transpose(0, 2, 1)) @ T.R.T
    return error


def _moves(p: Floats) -> Floats:
    """What a turn and a shift do to r: (k, 3, 6) of [w x p, d]."""
    turns = np.cross(np.eye(3)[None], p[:, None])  # row a: e_a x p
    shifts = np.broadcast_to(np.eye(3), (len(p), 3, 3))
    return np.concatenate([turns.transpose(0, 2, 1), shifts], axis=2)


def _weighted_turn(R: Floats, w: Floats) -> Floats:
    """R exp([w]x), by Rodrigues' formula."""
    angle = float(np.linalg.norm(w))
    if angle == 0:
        return R
    K = np.cross(np.eye(3), w / angle)
    turned: Floats = R @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
    return turned
