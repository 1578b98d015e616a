"""Unscented and ensemble Kalman filters of any small model, as pure functions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky

from validate.arrays import Floats
from validate.estimate.kalman.formulas import Gaussian, Innovation, Update, best_gain, innovation

Function = Callable[[Floats], Floats]


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
    """Return the update from new points about the prior, so that Q is seen by h."""
    points = sigma.points(prior)
    mean, covariance = sigma.weights(len(prior.x))
    seen = np.array([h(p) for p in points])
    middle = mean @ seen
    weighted = covariance[:, None] * (seen - middle)
    gain = best_gain((points - prior.x).T @ weighted, (seen - middle).T @ weighted + R)
    found = innovation(z, middle, gain)
    P = prior.P - gain.G @ gain.S_yy @ gain.G.T
    return Update(Gaussian(prior.x + gain.G @ found.y, P), gain, found)


def enkf_predict(members: Floats, f: Function, noise: Floats) -> Floats:
    """Members (N, n) through f, with draws (N, n) of the process noise added."""
    return np.array([f(member) for member in members]) + noise


def enkf_update(members: Floats, z: Floats, h: Function, R: Floats, noise: Floats) -> Floats:
    """Members (N, n) corrected by perturbed measurements z + noise (N, m) (Burgers et al. 1998)."""
    seen = np.array([h(member) for member in members])
    return ensemble_update(members, seen, z, R, noise).members


@dataclass(frozen=True)
class Corrected:
    """Members (N, n) after an update, and the innovation that led to it."""

    members: Floats
    innovation: Innovation


@dataclass(frozen=True)
class Reach:
    """Factors between 0 and 1 on the sample covariances of state and measured (n, m), and of what
    is measured among itself (m, m)."""

    state: Floats
    seen: Floats


def ensemble_update(
    members: Floats,
    seen: Floats,
    z: Floats,
    R: Floats,
    noise: Floats | None,
    reach: Reach | None = None,
) -> Corrected:
    """Members (N, n), of which `seen` (N, m) would be measured, corrected by z (m,), NaN = missing.

    With draws `noise` (N, m) of R every member takes a measurement of its own (Burgers et al.
    1998); without, all move by the mean's correction, and half the gain draws them together, which
    is right to first order in H P H^T R^-1 (Sakov & Oke 2008). What the reach leaves no covariance
    is not moved at all.
    """
    off, apart = members - members.mean(axis=0), seen - seen.mean(axis=0)
    degrees, i = len(members) - 1, np.isfinite(z)
    PHt, HPHt = off.T @ apart / degrees, apart.T @ apart / degrees
    if reach is not None:
        PHt, HPHt = reach.state * PHt, reach.seen * HPHt
    gain = best_gain(PHt, HPHt + R, tuple(i.tolist()))
    found = innovation(z, seen.mean(axis=0), gain)
    y = found.y[i] - apart[:, i] / 2 if noise is None else (z + noise - seen)[:, i]
    return Corrected(np.asarray(members + y @ gain.G.T), found)


def ensemble_gaussian(members: Floats) -> Gaussian:
    """Sample mean and covariance (ddof 1) of members (N, n)."""
    x = members.mean(axis=0)
    return Gaussian(x, (members - x).T @ (members - x) / (len(members) - 1))
