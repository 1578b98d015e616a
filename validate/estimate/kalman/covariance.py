"""Covariance recursions of a linear Kalman filter and their compiled modal loops.

A `Claim` is what the filter claims about its error. Updates are kept as the pair G, B of Joseph's
form at the best gain, P+ = P- + G B^T + B G^T with B = G S_yy / 2 - P- H^T, which is symmetric by
construction, and to which an error in G adds only its square.

Compiled loops over modes: covariance of a diagonal transition, and all steps of a filter.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from validate.arrays import Floats, Ints
from validate.estimate.kalman.formulas import Gain, Seen, best_gain, joseph, propagated
from validate.fem.kernels.jit_cache import compiled


@compiled(fastmath={"contract", "reassoc"})
def advance(
    P: Floats, G: Floats, B: Floats, f: Floats, Q: Floats, H: Floats
) -> tuple[Floats, Floats]:
    """P- (n, n) = (P + G B^T + B G^T) * f f^T + Q and P- H^T (n, m).

    G, B (n, r) are the last update (see `covariance`), r = 0 for none. Only lower triangles of P, Q
    and P- are read and filled.
    """
    n, r, m = P.shape[0], G.shape[1], H.shape[0]
    prior, W = np.empty((n, n)), np.zeros((m, n))
    Gt, Bt, row = G.T.copy(), B.T.copy(), np.empty(n)
    for i in range(n):
        for j in range(i + 1):
            row[j] = P[i, j]
        for a in range(r):
            g, b = G[i, a], B[i, a]
            for j in range(i + 1):
                row[j] += g * Bt[a, j] + b * Gt[a, j]
        for j in range(i + 1):
            row[j] = f[i] * f[j] * row[j] + Q[i, j]
            prior[i, j] = row[j]
        for a in range(m):
            h, total = H[a, i], 0.0
            for j in range(i):
                total += row[j] * H[a, j]
                W[a, j] += row[j] * h
            W[a, i] += total + row[i] * h
    return prior, W.T


@compiled(fastmath={"contract", "reassoc"})
def advance_observed(
    P: Floats, G: Floats, B: Floats, phi: Floats, theta: Floats, Q: Floats, rows: Floats
) -> tuple[Floats, Floats]:
    """P- (w, r) = (P - G B^T) * phi theta^T + Q and P- rows^T (w, m): see `observable`.

    G (w, k), B (r, k) are the last update, k = 0 for none; rows (m, r).
    """
    (w, r), k, m = P.shape, G.shape[1], rows.shape[0]
    prior, seen, Bt = np.empty((w, r)), np.empty((w, m)), B.T.copy()
    for i in range(w):
        row = prior[i]
        for j in range(r):
            row[j] = P[i, j]
        for a in range(k):
            g = G[i, a]
            for j in range(r):
                row[j] -= g * Bt[a, j]
        for j in range(r):
            row[j] = phi[i] * theta[j] * row[j] + Q[i, j]
        for c in range(m):
            total = 0.0
            for j in range(r):
                total += row[j] * rows[c, j]
            seen[i, c] = total
    return prior, seen


def mirrored(P: Floats) -> Floats:
    """Return the symmetric matrix whose lower triangle P holds."""
    lower = np.tril(P)
    return lower + np.tril(P, -1).T


@compiled(fastmath={"contract", "reassoc"})
def walked(
    factors: Floats,
    rule: Floats,
    forces: Floats,
    begin: Floats,
    towards_prior: bool,
    which: Ints,
    gains: Floats,
    H: Floats,
    z: Floats,
    read: Floats,
) -> tuple[Floats, Floats]:
    """Values (nt, p) and innovations (nt, m) of one walk of amplitudes from rest.

    factors (4, n) as `InModes`, rule: h and b0, b1, g0, g1 as `Rule`; forces (nt, n), first
    acceleration `begin` (n,); gains (k, m, n), of step i the one `which` (nt,) says, -1 for none;
    H (m, n) of what is measured, read (p, n) of what is wanted. NaN of z (nt, m) is not measured.
    """
    nt, n = forces.shape
    m, p = len(H), len(read)
    values, y = np.zeros((nt, p)), np.zeros((nt, m))
    h, b0, b1, g0, g1 = rule
    fq, fv, fa, ff = factors
    x, v, a, prior, new = np.zeros(n), np.zeros(n), begin.copy(), np.empty(n), np.empty(n)
    for k in range(nt):
        f = forces[k]
        for i in range(n):
            prior[i] = fq[i] * x[i] + fv[i] * v[i] + fa[i] * a[i] + ff[i] * f[i]
            new[i] = prior[i]
        if which[k] >= 0:
            for c in range(m):
                if not np.isnan(z[k, c]):
                    total, row = 0.0, H[c]
                    for i in range(n):
                        total += row[i] * prior[i]
                    y[k, c] = z[k, c] - total
            for c in range(m):
                gain, e = gains[which[k], c], y[k, c]
                for i in range(n):
                    new[i] += gain[i] * e
        towards = prior if towards_prior else new
        for i in range(n):
            after = (towards[i] - x[i] - h * v[i] - h * h * b0 * a[i]) / (h * h * b1)
            v[i] += h * g0 * a[i] + h * g1 * after
            a[i] = after
            x[i] = new[i]
        for c in range(p):
            total, row = 0.0, read[c]
            for i in range(n):
                total += row[i] * x[i]
            values[k, c] = total
    return values, y


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
