"""Kalman filter formulas: linear, extended, unscented and ensemble.

Pure functions of states x (n,), covariances P (n, n) and measurements z (m,), NaN = missing, all of
one system of units; `filterpy.oracle.oracle_table` shows that they equal filterpy's to rounding.
Updates are in Joseph's form, which stays symmetric and positive for any gain.

Unscented and ensemble Kalman filters of any small model, as pure functions.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, cholesky
from scipy.linalg.lapack import dposv

from validate.arrays import Floats

Function = Callable[[Floats], Floats]
Seen = tuple[bool, ...]
_LN_2_PI = float(np.log(2 * np.pi))


@dataclass(frozen=True)
class Gain:
    """Gain G (n, k) of the k `seen` components of m, and S_yy (m, m) m^2 of all of them.

    `root` (k, k) is the upper Cholesky factor of S_yy over the seen components.
    """

    G: Floats
    S_yy: Floats
    seen: Seen
    root: Floats

    @cached_property
    def sd(self) -> Floats:
        """Standard deviations (m,) of the innovations, zero where nothing is seen."""
        return np.where(self.seen, np.sqrt(np.diag(self.S_yy)), 0.0)

    @cached_property
    def log_det(self) -> float:
        """Natural logarithm of the determinant of S_yy over the seen components."""
        return 2 * float(np.log(np.diag(self.root)).sum())

    def nis(self, y: Floats) -> Floats:
        """y^T S_yy^-1 y of innovations (k,) or (k, s) of the seen components."""
        return np.asarray((y * cho_solve((self.root, False), y, check_finite=False)).sum(axis=0))


def best_gain(PHt: Floats, S_yy: Floats, seen: Seen | None = None) -> Gain:
    """G = P H^T S_yy^-1 over the seen components, from P H^T (n, m) and H P H^T + R (m, m).

    LAPACK itself, as scipy's checks take ten times the work of a small S. Raises `LinAlgError` for
    an S that is not positive definite.
    """
    S = S_yy = (S_yy + S_yy.T) / 2
    if seen is None:
        seen = (True,) * len(S_yy)
    elif not all(seen):
        i = np.array(seen)
        PHt, S = PHt[:, i], S_yy[np.ix_(i, i)]
    root, G, info = dposv(S, PHt.T)
    if info:
        raise np.linalg.LinAlgError(f"S_yy {S.shape} is not positive definite (pivot {info})")
    return Gain(np.ascontiguousarray(G.T), S_yy, seen, root)


def propagated(P: Floats, A: Floats, Q: Floats) -> Floats:
    """P- = A P A^T + Q."""
    return np.asarray(A @ P @ A.T + Q)


def joseph(P: Floats, G: Floats, H: Floats, R: Floats) -> Floats:
    """(I - G H) P (I - G H)^T + G R G^T: positive whatever the gain."""
    return propagated(P, np.eye(len(P)) - G @ H, G @ R @ G.T)


@dataclass(frozen=True)
class Gated:
    """Markers whose looks a gate `tested` and `rejected`; `far` (k,) tells by how many standard
    deviations each rejected one lay off, zero for the others."""

    far: Floats
    tested: int
    rejected: int

    def and_then(self, other: "Gated") -> "Gated":
        far, rejected = np.maximum(self.far, other.far), self.rejected + other.rejected
        return Gated(far, self.tested + other.tested, rejected)


@dataclass(frozen=True)
class Innovation:
    """y = z - H u_prior (m,) m, zero where nothing was measured; sd (m,) m, zero there too, and of
    samples that a gate rejected.

    `nis` = y^T S_yy^-1 y of the `dof` components that were measured, and passed the gate if there
    is one; `log_det` is the logarithm of the determinant of their S_yy.
    """

    y: Floats
    sd: Floats
    nis: float
    dof: int
    log_det: float = 0.0
    gated: Gated | None = None

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the density, in metres, that the filter gave to what was measured."""
        return float(log_likelihood(self.nis, self.dof, self.log_det))

    def after(self, other: "Innovation") -> "Innovation":
        """This one, with the counts and sums of another in the same step before it."""
        gated = (self.gated and other.gated and other.gated.and_then(self.gated)) or self.gated
        nis, dof, log_det = self.nis + other.nis, self.dof + other.dof, self.log_det + other.log_det
        return Innovation(self.y, self.sd, nis, dof, log_det, gated)

    def numbers(self, names: tuple[str, ...]) -> Mapping[str, float]:
        """By trace name, for `State.numbers`."""
        numbers = {"nis": self.nis, "nis.dof": float(self.dof)}
        numbers["log_likelihood"] = self.log_likelihood
        for name, y, sd in zip(names, self.y.tolist(), self.sd.tolist(), strict=True):
            numbers[f"innovation.{name}"] = y
            numbers[f"innovation.{name}.sd"] = sd
        return numbers


def innovation(z: Floats, predicted: Floats, gain: Gain) -> Innovation:
    """Of z (m,) where the gain has seen it, against the predicted (m,)."""
    seen = np.array(gain.seen)
    y = np.where(seen, z - predicted, 0.0)
    return Innovation(y, gain.sd, float(gain.nis(y[seen])), int(seen.sum()), gain.log_det)


def log_likelihood(nis: Any, dof: Any, log_det: Any) -> Any:
    """-(nis + ln det S_yy + dof ln 2 pi) / 2: of Gaussian innovations of `dof` components."""
    return -(nis + log_det + dof * _LN_2_PI) / 2


def nothing(m: int) -> Innovation:
    """Return a step without a measurement."""
    return Innovation(np.zeros(m), np.zeros(m), 0.0, 0)


def innovation_units(names: tuple[str, ...]) -> dict[str, str]:
    """Units of what `Innovation.numbers` tells."""
    units = {"nis": "1", "nis.dof": "1", "log_likelihood": "1"}
    for name in names:
        units |= {f"innovation.{name}": "m", f"innovation.{name}.sd": "m"}
    return units


@dataclass(frozen=True)
class Gaussian:
    """Mean x (n,) and covariance P (n, n)."""

    x: Floats
    P: Floats


@dataclass(frozen=True)
class Update:
    """A posterior with the gain and the innovation that led to it."""

    posterior: Gaussian
    gain: Gain
    innovation: Innovation


def kf_predict(prior: Gaussian, A: Floats, Q: Floats, forced: Floats | float = 0.0) -> Gaussian:
    """x- = A x + forced, P- = A P A^T + Q."""
    return Gaussian(A @ prior.x + forced, propagated(prior.P, A, Q))


def kf_update(prior: Gaussian, z: Floats, H: Floats, R: Floats) -> Update:
    """Return the linear update (paper 001, eq 3)."""
    return ekf_update(prior, z, lambda x: np.asarray(H @ x), lambda _: H, R)


def ekf_predict(prior: Gaussian, f: Function, jacobian: Function, Q: Floats) -> Gaussian:
    """x- = f(x), P- = A P A^T + Q with A = df/dx (n, n) at x."""
    return Gaussian(f(prior.x), propagated(prior.P, jacobian(prior.x), Q))


def ekf_update(prior: Gaussian, z: Floats, h: Function, jacobian: Function, R: Floats) -> Update:
    """Return the update with H = dh/dx (m, n) at the prior."""
    H, i = jacobian(prior.x), np.isfinite(z)
    PHt = prior.P @ H.T
    gain = best_gain(PHt, H @ PHt + R, tuple(i.tolist()))
    found = innovation(z, h(prior.x), gain)
    P = joseph(prior.P, gain.G, H[i], R[np.ix_(i, i)])
    return Update(Gaussian(prior.x + gain.G @ found.y[i], P), gain, found)


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
