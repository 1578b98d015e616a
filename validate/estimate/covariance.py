"""Covariance recursions of a linear Kalman filter: they need no data, only when data comes.

A `Claim` is what the filter claims about its error. Updates are kept as the pair G, B of Joseph's
form at the best gain, P+ = P- + G B^T + B G^T with B = G S_yy / 2 - P- H^T, which is symmetric by
construction, and to which an error in G adds only its square.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg.lapack import dposv

from validate.arrays import Floats
from validate.estimate.modal_kernel import advance, mirrored
from validate.estimate.small import joseph


@dataclass(frozen=True)
class Claim:
    """P (n, n) m^2, of which `Modal` fills the lower triangle; PHt (n, m) = P H^T.

    G, B (n, r): an update not yet added to P, r = 0 for none.
    """

    P: Floats
    PHt: Floats
    G: Floats
    B: Floats


@dataclass(frozen=True)
class Gain:
    """Gain G (n, k) of the k `seen` components of m, and S_yy (m, m) m^2 of all of them."""

    G: Floats
    S_yy: Floats
    seen: tuple[bool, ...]


class Recursion(Protocol):
    """What gains come from; H (m, n) reads measured components from the coordinates."""

    @property
    def H(self) -> Floats: ...

    def start(self) -> Claim:
        """What is claimed before the first step."""
        ...

    def predict(self, claim: Claim) -> Claim: ...

    def update(self, claim: Claim, seen: tuple[bool, ...]) -> tuple[Gain, Claim]: ...


class Covariance(Recursion, Protocol):
    """A recursion of the whole covariance."""

    @property
    def P0(self) -> Floats: ...

    def matrix(self, claim: Claim) -> Floats:
        """P (n, n) with the last update in it."""
        ...


def claimed(P: Floats, PHt: Floats) -> Claim:
    """A claim without an update to come."""
    none = np.zeros((len(P), 0))
    return Claim(P, PHt, none, none)


def best_gain(PHt: Floats, H: Floats, R: Floats, seen: tuple[bool, ...]) -> Gain:
    """G = P H^T S_yy^-1 over the seen components, R (m,) m^2."""
    S_yy = H @ PHt + np.diag(R)
    S_yy = (S_yy + S_yy.T) / 2
    if all(seen):
        return Gain(_divided(PHt, S_yy), S_yy, seen)
    i = np.array(seen)
    return Gain(_divided(PHt[:, i], S_yy[np.ix_(i, i)]), S_yy, seen)


def _divided(PHt: Floats, S: Floats) -> Floats:
    """P H^T S^-1 by Cholesky; LAPACK itself, as scipy's checks take ten times the work of small S.

    Raises `LinAlgError` for an S that is not positive definite.
    """
    _, G, info = dposv(S, PHt.T)
    if info:
        raise np.linalg.LinAlgError(f"S_yy {S.shape} is not positive definite (pivot {info})")
    return np.ascontiguousarray(G.T)


@dataclass(frozen=True)
class Dense:
    """P- = A P A^T + Q and Joseph's update with dense matrices, as paper 001 prints its filter."""

    A: Floats
    Q: Floats
    H: Floats
    R: Floats
    P0: Floats

    def start(self) -> Claim:
        return claimed(self.P0, self.P0 @ self.H.T)

    def predict(self, claim: Claim) -> Claim:
        P = self.A @ claim.P @ self.A.T + self.Q
        return claimed(P, P @ self.H.T)

    def update(self, claim: Claim, seen: tuple[bool, ...]) -> tuple[Gain, Claim]:
        gain, i = best_gain(claim.PHt, self.H, self.R, seen), np.array(seen)
        P = joseph(claim.P, gain.G, self.H[i], np.diag(self.R[i]))
        return gain, claimed((P + P.T) / 2, claim.PHt)

    def matrix(self, claim: Claim) -> Floats:
        return claim.P


@dataclass(frozen=True)
class Modal:
    """The same where the transition is diagonal, A = diag(f): P- = P * f f^T + Q, no product."""

    f: Floats
    Q: Floats
    H: Floats
    R: Floats
    P0: Floats

    def start(self) -> Claim:
        return claimed(self.P0, self.P0 @ self.H.T)

    def predict(self, claim: Claim) -> Claim:
        return claimed(*advance(claim.P, claim.G, claim.B, self.f, self.Q, self.H))

    def update(self, claim: Claim, seen: tuple[bool, ...]) -> tuple[Gain, Claim]:
        gain, i = best_gain(claim.PHt, self.H, self.R, seen), np.array(seen)
        B = gain.G @ gain.S_yy[np.ix_(i, i)] / 2 - claim.PHt[:, i]
        return gain, Claim(claim.P, claim.PHt, gain.G, np.ascontiguousarray(B))

    def matrix(self, claim: Claim) -> Floats:
        return mirrored(claim.P) + claim.G @ claim.B.T + claim.B @ claim.G.T
