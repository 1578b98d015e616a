"""Covariance recursions and precomputed gains of a linear Kalman filter, in compiled loops.

A `Claim` is what the filter claims about its error. Updates are kept as the pair G, B of Joseph's
form at the best gain, P+ = P- + G B^T + B G^T with B = G S_yy / 2 - P- H^T, which is symmetric by
construction, and to which an error in G adds only its square.

Compiled loops over modes: covariance of a diagonal transition, and all steps of a filter.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Protocol

import numpy as np
from scipy.linalg import eigh

from validate.arrays import Floats, Ints
from validate.estimate.kalman.formulas import Gain, Seen, best_gain, joseph, propagated
from validate.estimate.measurements import Timetable
from validate.fem.kernels.jit_cache import compiled
from validate.fem.system import System, once


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


# --- precomputed gains of a linear filter --------------------------------------------------------

# Change of the gain from one measurement to the next, of its largest entry, at which it is taken as
# settled: with a memory of a hundred measurements 1e-4 is left of it, below every noise's effect.
SETTLED = 1e-6


@dataclass(frozen=True)
class GainSequence:
    """Gains by step; from step `frozen` on they repeat (None: they never settled).

    `computed` counts the gains that were computed, `before` are those that were `mapped` to these;
    all lie in the span of `basis` (n, w), orthonormal columns, where one is known that is narrow.
    """

    gains: Mapping[int, Gain]
    frozen: int | None
    computed: int
    before: "GainSequence | None" = None
    basis: Floats | None = None

    def at(self, step: int) -> Gain | None:
        return self.gains.get(step)

    def mapped(self, turn: Callable[[Floats], Floats]) -> "GainSequence":
        """The same gains in other coordinates by a linear `turn`; repeats stay one array."""
        distinct = {id(gain): gain for gain in self.gains.values()}
        if not distinct:
            return self
        columns = np.cumsum([gain.G.shape[1] for gain in distinct.values()])[:-1]
        whole = np.hstack([gain.G for gain in distinct.values()])  # one product, not hundreds
        W = self.basis
        whole = turn(whole) if W is None else turn(W) @ (W.T @ whole)
        parts = zip(distinct.items(), np.split(whole, columns, axis=1), strict=True)
        turned = {
            k: Gain(np.ascontiguousarray(G), gain.S_yy, gain.seen, gain.root)
            for (k, gain), G in parts
        }
        gains = {step: turned[id(gain)] for step, gain in self.gains.items()}
        return replace(self, gains=MappingProxyType(gains), before=self, basis=None)


@dataclass(frozen=True)
class Event:
    """A measurement: its step, its gain, what is claimed after it, and if its gain is a repeat."""

    step: int
    gain: Gain
    claim: Claim
    repeated: bool


def schedule(timetable: Timetable) -> Mapping[int, Seen]:
    """Which components are measured at which steps, in order."""
    rows = sorted(timetable.z.items())
    return MappingProxyType({k: tuple(np.isfinite(z).tolist()) for k, z in rows})


def events(
    recursion: Recursion, when: Mapping[int, Seen], tolerance: float = SETTLED
) -> Iterator[Event]:
    """Gains in order. Once settled they repeat while interval and components stay what they are;
    after a break the recursion goes on from where it stood."""
    claim, last, step = recursion.start(), None, 0
    pattern: tuple[int, Seen] | None = None
    settled = False
    for k, seen in when.items():
        same = (k - step, seen) == pattern
        if last is not None and settled and same:
            yield Event(k, last, claim, True)
        else:
            gain, claim = recursion.update(recursion.predict(claim, k - step), seen)
            settled = False
            if last is not None and same:
                change, size = np.abs(gain.G - last.G).max(), np.abs(gain.G).max()
                settled = float(change) <= tolerance * float(size)
            last, pattern = gain, (k - step, seen)
            yield Event(k, gain, claim, False)
        step = k


def gain_sequence(
    recursion: Recursion, when: Mapping[int, Seen], tolerance: float = SETTLED
) -> GainSequence:
    """All gains of a schedule; `frozen` is the step after which none was computed any more."""
    gains, computed, frozen = {}, 0, None
    for event in events(recursion, when, tolerance):
        gains[event.step] = event.gain
        if not event.repeated:
            computed, frozen = computed + 1, None
        elif frozen is None:
            frozen = event.step
    return GainSequence(MappingProxyType(gains), frozen, computed)


class Claims:
    """Covariance at the end of any step, recomputed in one pass while steps rise.

    A whole covariance per step would not fit in memory; only the walk's place is kept.
    """

    def __init__(
        self, covariance: Covariance, when: Mapping[int, Seen], tolerance: float = SETTLED
    ) -> None:
        self._covariance, self._when, self._tolerance = covariance, when, tolerance
        self._walk: Iterator[Event] | None = None
        self._ahead: Event | None = None
        self._claim: Claim
        self._step = 0

    def at(self, step: int) -> Claim:
        if self._walk is None or step < self._step:
            self._walk = events(self._covariance, self._when, self._tolerance)
            self._claim, self._step = self._covariance.start(), 0
            self._ahead = next(self._walk, None)
        while self._ahead is not None and self._ahead.step <= step:
            self._claim, self._step = self._ahead.claim, self._ahead.step
            self._ahead = next(self._walk, None)
        if step > self._step:
            self._claim = self._covariance.predict(self._claim, step - self._step)
        self._step = step
        return self._claim


_LEFT = 1e-12  # share of A^k H^T outside the space that is taken as none
_NOTHING = 1e-14  # singular value, of the largest, that is rounding
_WORTH = 5  # times narrower than the whole, or the whole is cheaper

Spaces = dict[Hashable, "NarrowSpace"]


@dataclass(frozen=True)
class NarrowSpace:
    """V (n, r) and W (n, w), orthonormal, in which A is diagonal: `theta` (r,) and `phi` (w,)."""

    V: Floats
    theta: Floats
    W: Floats
    phi: Floats


@dataclass(frozen=True)
class Observed:
    """Claims hold W^T P V (w, r) where others hold P, and W^T G where others hold G.

    QV and PV0 (w, r) are Q V and P0 V in the span of W; `rows` (m, r) = H V, H (m, w) = H W.
    """

    space: NarrowSpace
    QV: Floats
    PV0: Floats
    rows: Floats
    H: Floats
    R: Floats

    def start(self) -> Claim:
        return claimed(self.PV0, self.PV0 @ self.rows.T)

    def predict(self, claim: Claim, steps: int = 1) -> Claim:
        s = self.space
        for _ in range(steps):
            moved = advance_observed(claim.P, claim.G, claim.B, s.phi, s.theta, self.QV, self.rows)
            claim = claimed(*moved)
        return claim

    def update(self, claim: Claim, seen: Seen, late: Floats | None = None) -> tuple[Gain, Claim]:
        within = best_gain(claim.PHt, self.H @ claim.PHt + noise(self.R, late), seen)
        B = (self.H if all(seen) else self.H[np.array(seen)]) @ claim.P
        gain = Gain(self.space.W @ within.G, within.S_yy, seen, within.root)
        return gain, Claim(claim.P, claim.PHt, within.G, B.T.copy())


def observed(covariance: Decoupled, steps: int, known: Spaces) -> Observed | None:
    """Return the narrow recursion if `steps` steps stay in a space that is narrow, else None.

    `known` keeps spaces for filters that differ in their variances only.
    """
    f, H = covariance.f, covariance.H
    key = (f.tobytes(), H.tobytes(), steps)
    space = known.get(key)
    V = space.V if space else _span(H.T, f, steps, len(f) // _WORTH)
    if V is None:
        return None
    QV, PV0 = covariance.Q @ V, covariance.P0 @ V
    if not (QV.any() or PV0.any()):  # nothing is doubted: there is no gain
        return None
    if space is None or not all(_holds(space.W, f, X, steps) for X in (QV, PV0)):
        sizes = (float(np.linalg.norm(X)) or 1.0 for X in (QV, PV0))
        X = np.hstack([X / size for X, size in zip((QV, PV0), sizes, strict=True)])
        W = _span(X, f, steps, len(f) // 2)
        wide = (np.eye(len(f)), f) if W is None else _diagonal(W, f)
        space = known[key] = NarrowSpace(*_diagonal(V, f), *wide)
        QV, PV0 = covariance.Q @ space.V, covariance.P0 @ space.V
    W, V = space.W, space.V
    return Observed(space, W.T @ QV, W.T @ PV0, H @ V, H @ W, covariance.R)


def _diagonal(V: Floats, f: Floats) -> tuple[Floats, Floats]:
    """V turned so that V^T A V is diagonal, and that diagonal."""
    values, turn = eigh(V.T @ (f[:, None] * V))
    return V @ turn, values


def _span(X: Floats, f: Floats, steps: int, most: int) -> Floats | None:
    """Orthonormal columns that span X (n, k) and its products with A up to `steps` times; None
    for more than `most`."""
    V = block = _basis(X)
    while not _holds(V, f, X, steps):
        block = (f - f.mean())[:, None] * block
        for _ in range(2):  # once leaves what rounding leaves
            block = block - V @ (V.T @ block)
        block = _basis(block)
        V = np.hstack([V, block])
        if V.shape[1] > most:
            return None
    return V


def _basis(X: Floats) -> Floats:
    U, s, _ = np.linalg.svd(X, full_matrices=False)
    return np.asarray(U[:, s > _NOTHING * s[0]])


def _holds(V: Floats, f: Floats, X: Floats, steps: int) -> bool:
    """Whether powers of A up to `steps` keep X within V."""
    for k in (0, 1, steps // 4, steps // 2, steps):
        moved = (f / np.abs(f).max())[:, None] ** k * X
        if np.linalg.norm(moved - V @ (V.T @ moved)) > _LEFT * np.linalg.norm(moved):
            return False
    return True


def shared_gains(
    system: System, covariance: Covariance, table: Timetable, settled: float
) -> GainSequence:
    """All gains of the measurements, from the narrowest recursion that gives them."""
    when = schedule(table)
    if isinstance(covariance, Decoupled):
        known: Spaces = once(system, "spaces of what is observed", dict)
        narrow = observed(covariance, max(when, default=1), known)
        if narrow is not None:
            return replace(gain_sequence(narrow, when, settled), basis=narrow.space.W)
    return gain_sequence(covariance, when, settled)
