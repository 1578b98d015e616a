"""Rigid fit of markers with anisotropic noise, and its covariance.

Noise of covariance C lies in the source: the maximum-likelihood fit minimises the sum of
r^T C^-1 r with r_i = x_i - R^T (y_i - t), by Gauss-Newton over a small turn w and shift d of the
source frame, r -> r + w x p + d with p_i = R^T (y_i - t).
"""

import numpy as np

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.register.markers.transform import Similarity

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
        R, t = _turned(R, step[:3]), t + R @ step[3:]
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


def _turned(R: Floats, w: Floats) -> Floats:
    """R exp([w]x), by Rodrigues' formula."""
    angle = float(np.linalg.norm(w))
    if angle == 0:
        return R
    K = np.cross(np.eye(3), w / angle)
    turned: Floats = R @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
    return turned
