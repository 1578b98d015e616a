"""Kalman filters for any small model, as pure functions: what is written once and trusted.

Compact references with generic f and h; `filterpy_guest.oracle_table` shows that they equal
filterpy's to rounding. States x (n,), covariances P (n, n), measurements z (m,), all of one
system of units. Updates are in Joseph's form, which stays symmetric and positive for any gain.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky

from validate.arrays import Floats

Function = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Gaussian:
    """Mean x (n,) and covariance P (n, n)."""

    x: Floats
    P: Floats


@dataclass(frozen=True)
class Update:
    """A posterior with the innovation y (m,), its covariance S_yy (m, m) and the gain G (n, m)."""

    posterior: Gaussian
    y: Floats
    S_yy: Floats
    G: Floats

    @property
    def nis(self) -> float:
        """y^T S_yy^-1 y."""
        return float(self.y @ np.linalg.solve(self.S_yy, self.y))


def joseph(P: Floats, G: Floats, H: Floats, R: Floats) -> Floats:
    """(I - G H) P (I - G H)^T + G R G^T: positive whatever the gain."""
    I_GH = np.eye(len(P)) - G @ H
    return np.asarray(I_GH @ P @ I_GH.T + G @ R @ G.T)


def kf_predict(prior: Gaussian, A: Floats, Q: Floats, forced: Floats | float = 0.0) -> Gaussian:
    """x- = A x + forced, P- = A P A^T + Q."""
    return Gaussian(A @ prior.x + forced, A @ prior.P @ A.T + Q)


def kf_update(prior: Gaussian, z: Floats, H: Floats, R: Floats) -> Update:
    """The linear update (paper 001, eq 3)."""
    return ekf_update(prior, z, lambda x: np.asarray(H @ x), lambda _: H, R)


def ekf_predict(prior: Gaussian, f: Function, jacobian: Function, Q: Floats) -> Gaussian:
    """x- = f(x), P- = A P A^T + Q with A = df/dx (n, n) at x."""
    A = jacobian(prior.x)
    return Gaussian(f(prior.x), A @ prior.P @ A.T + Q)


def ekf_update(prior: Gaussian, z: Floats, h: Function, jacobian: Function, R: Floats) -> Update:
    """The update with H = dh/dx (m, n) at the prior."""
    H = jacobian(prior.x)
    PHt = prior.P @ H.T
    S_yy = H @ PHt + R
    G = np.asarray(np.linalg.solve(S_yy, PHt.T).T, dtype=np.float64)
    y = z - h(prior.x)
    return Update(Gaussian(prior.x + G @ y, joseph(prior.P, G, H, R)), y, S_yy, G)


@dataclass(frozen=True)
class SigmaPoints:
    """The scaled unscented transform of van der Merwe (2004): 2n + 1 points and weights."""

    alpha: float = 1e-3
    beta: float = 2.0
    kappa: float = 0.0

    def points(self, g: Gaussian) -> Floats:
        """(2n + 1, n): the mean, then plus and minus the rows of the upper Cholesky factor."""
        n = len(g.x)
        U = cholesky(self.alpha**2 * (n + self.kappa) * g.P)
        return np.vstack([g.x, g.x + U, g.x - U])

    def weights(self, n: int) -> tuple[Floats, Floats]:
        """Of the mean and of the covariance, (2n + 1,) each."""
        spread = self.alpha**2 * (n + self.kappa)
        mean = np.full(2 * n + 1, 0.5 / spread)
        mean[0] = 1 - n / spread
        covariance = mean.copy()
        covariance[0] += 1 - self.alpha**2 + self.beta
        return mean, covariance


def ukf_predict(prior: Gaussian, f: Function, Q: Floats, sigma: SigmaPoints) -> Gaussian:
    """Mean and covariance of the points through f, plus Q."""
    points = np.array([f(p) for p in sigma.points(prior)])
    mean, covariance = sigma.weights(len(prior.x))
    x = mean @ points
    return Gaussian(x, (points - x).T @ (covariance[:, None] * (points - x)) + Q)


def ukf_update(prior: Gaussian, z: Floats, h: Function, R: Floats, sigma: SigmaPoints) -> Update:
    """The update from new points about the prior, so that Q is seen by h."""
    points = sigma.points(prior)
    mean, covariance = sigma.weights(len(prior.x))
    seen = np.array([h(p) for p in points])
    middle = mean @ seen
    weighted = covariance[:, None] * (seen - middle)
    S_yy = (seen - middle).T @ weighted + R
    G: Floats = np.linalg.solve(S_yy, weighted.T @ (points - prior.x)).T
    y = z - middle
    return Update(Gaussian(prior.x + G @ y, prior.P - G @ S_yy @ G.T), y, S_yy, G)


def enkf_predict(members: Floats, f: Function, noise: Floats) -> Floats:
    """Members (N, n) through f, with draws (N, n) of the process noise added."""
    return np.array([f(member) for member in members]) + noise


def enkf_update(members: Floats, z: Floats, h: Function, R: Floats, noise: Floats) -> Floats:
    """Members (N, n) corrected by perturbed measurements z + noise (N, m) (Burgers et al. 1998)."""
    seen = np.array([h(member) for member in members])
    off, apart = members - members.mean(axis=0), seen - seen.mean(axis=0)
    S_yy = apart.T @ apart / (len(members) - 1) + R
    G: Floats = np.linalg.solve(S_yy, apart.T @ off / (len(members) - 1)).T
    return np.asarray(members + (z + noise - seen) @ G.T)


def ensemble_gaussian(members: Floats) -> Gaussian:
    """Sample mean and covariance (ddof 1) of members (N, n)."""
    x = members.mean(axis=0)
    return Gaussian(x, (members - x).T @ (members - x) / (len(members) - 1))
