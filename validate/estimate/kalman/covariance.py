"""Covariance recursions of a linear Kalman filter; they need times of data, no values.

A `Claim` is what the filter claims about its error. Updates are kept as the pair G, B of Joseph's
form at the best gain, P+ = P- + G B^T + B G^T with B = G S_yy / 2 - P- H^T, which is symmetric by
construction, and to which an error in G adds only its square.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from validate.arrays import Floats
from validate.estimate.kalman.formulas import Gain, Seen, best_gain, joseph, propagated
from validate.estimate.kalman.modal_kernel import advance, mirrored


@dataclass(frozen=True)
class Claim:
    """P (n, n) m^2, of which `Decoupled` fills the lower triangle; PHt (n, m) = P H^T.

    G, B (n, r): an update not yet added to P, r = 0 for none.
    """

    P: Floats
    PHt: Floats
    G: Floats
    B: Floats


class Recursion(Protocol):
    """Recursion that gains follow from; H (m, n) reads measured components from the coordinates."""

    @property
    def H(self) -> Floats: ...

    @property
    def R(self) -> Floats:
        """Variances (m,) m^2 of the components."""
        ...

    def start(self) -> Claim:
        """Return the covariance before the first step."""
        ...

    def predict(self, claim: Claim, steps: int = 1) -> Claim:
        """Return the covariance so many steps >= 1 later, without a measurement."""
        ...

    def update(self, claim: Claim, seen: Seen, late: Floats | None = None) -> tuple[Gain, Claim]:
        """By the components that are seen; `late` as in `noise`."""
        ...


class Covariance(Recursion, Protocol):
    """A recursion of the whole covariance."""

    @property
    def Q(self) -> Floats: ...

    @property
    def P0(self) -> Floats: ...

    def ahead(self, x: Floats) -> Floats:
        """Return a x."""
        ...

    def back(self, x: Floats) -> Floats:
        """A^T x of x (n,) or (n, k)."""
        ...

    def matrix(self, claim: Claim) -> Floats:
        """P (n, n) with the last update in it."""
        ...


def noise(R: Floats, late: Floats | None) -> Floats:
    """R (m, m) m^2 from variances (m,), and from what a late look (m,) m moves together."""
    return np.diag(R) if late is None else np.diag(R) + np.outer(late, late)


def claimed(P: Floats, PHt: Floats) -> Claim:
    """Return a claim without an update to come."""
    none = np.zeros((len(P), 0))
    return Claim(P, PHt, none, none)


@dataclass(frozen=True)
class Dense:
    """P- = A P A^T + Q and Joseph's update with dense matrices, as paper 001 prints its filter."""

    A: Floats
    Q: Floats
    H: Floats
    R: Floats
    P0: Floats
    _kept: dict[int, tuple[Floats, Floats]] = field(default_factory=dict, repr=False)

    def start(self) -> Claim:
        return claimed(self.P0, self.P0 @ self.H.T)

    def ahead(self, x: Floats) -> Floats:
        return np.asarray(self.A @ x)

    def back(self, x: Floats) -> Floats:
        return np.asarray(self.A.T @ x)

    def over(self, steps: int) -> tuple[Floats, Floats]:
        """Return a and Q (n, n) of so many steps >= 1 together, by repeated squaring; kept."""
        if steps == 1:
            return self.A, self.Q
        if steps not in self._kept:
            half, odd = self.over(steps // 2), steps % 2 == 1
            twice = _chained(half, half)
            self._kept[steps] = _chained((self.A, self.Q), twice) if odd else twice
        return self._kept[steps]

    def predict(self, claim: Claim, steps: int = 1) -> Claim:
        P = propagated(claim.P, *self.over(steps))
        return claimed(P, P @ self.H.T)

    def update(self, claim: Claim, seen: Seen, late: Floats | None = None) -> tuple[Gain, Claim]:
        R, i = noise(self.R, late), np.array(seen)
        gain = best_gain(claim.PHt, self.H @ claim.PHt + R, seen)
        P = joseph(claim.P, gain.G, self.H[i], R[np.ix_(i, i)])
        return gain, claimed((P + P.T) / 2, claim.PHt)

    def matrix(self, claim: Claim) -> Floats:
        return claim.P


def _chained(one: tuple[Floats, Floats], then: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    return then[0] @ one[0], propagated(one[1], *then)


@dataclass(frozen=True)
class Steady:
    """A covariance that has settled: `prior` is claimed before every measurement."""

    covariance: Dense
    prior: Claim

    @property
    def H(self) -> Floats:
        return self.covariance.H

    @property
    def R(self) -> Floats:
        return self.covariance.R

    def start(self) -> Claim:
        return self.covariance.start()

    def predict(self, claim: Claim, steps: int = 1) -> Claim:
        return self.prior

    def update(self, claim: Claim, seen: Seen, late: Floats | None = None) -> tuple[Gain, Claim]:
        return self.covariance.update(claim, seen, late)


@dataclass(frozen=True)
class Decoupled:
    """As `Dense` where the transition is diagonal, A = diag(f): P- = P * f f^T + Q, no product."""

    f: Floats
    Q: Floats
    H: Floats
    R: Floats
    P0: Floats

    def start(self) -> Claim:
        return claimed(self.P0, self.P0 @ self.H.T)

    def ahead(self, x: Floats) -> Floats:
        return self.f * x

    def back(self, x: Floats) -> Floats:
        return self.f * x if x.ndim == 1 else self.f[:, None] * x

    def predict(self, claim: Claim, steps: int = 1) -> Claim:
        for _ in range(steps):
            claim = claimed(*advance(claim.P, claim.G, claim.B, self.f, self.Q, self.H))
        return claim

    def update(self, claim: Claim, seen: Seen, late: Floats | None = None) -> tuple[Gain, Claim]:
        i = np.array(seen)
        gain = best_gain(claim.PHt, self.H @ claim.PHt + noise(self.R, late), seen)
        B = gain.G @ gain.S_yy[np.ix_(i, i)] / 2 - claim.PHt[:, i]
        return gain, Claim(claim.P, claim.PHt, gain.G, np.ascontiguousarray(B))

    def matrix(self, claim: Claim) -> Floats:
        return mirrored(claim.P) + claim.G @ claim.B.T + claim.B @ claim.G.T
