"""Precomputed gains of a linear filter.

Covariance of the observed unknowns: all gains of a linear filter by a small recursion. A gain needs
P H^T only. With V (n, r) spanning H^T, A H^T, A^2 H^T, ... and A V = V T the columns P V close
among themselves: (P- V) = A (P V) T + Q V, (P+ V) = P- V - G H P- V. They stay in the span of W (n,
w), of Q V, P0 V and their products with powers of A. In the eigenvectors of A within either span
both products are by numbers. Where damping makes all modes decay alike the spans are narrow (r =
18, w = 108 of 525 on paper 001's cube), and the gains equal those of the whole covariance to
rounding.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.linalg import eigh

from validate.arrays import Floats
from validate.estimate.kalman.covariance import (
    Claim,
    Covariance,
    Decoupled,
    Recursion,
    advance_observed,
    claimed,
    noise,
)
from validate.estimate.kalman.formulas import Gain, Seen, best_gain
from validate.estimate.measurements import Timetable
from validate.fem.system import System, once

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
