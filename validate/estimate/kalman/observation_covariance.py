"""Covariance of the observed unknowns: all gains of a linear filter by a small recursion.

A gain needs P H^T only. With V (n, r) spanning H^T, A H^T, A^2 H^T, ... and A V = V T the columns
P V close among themselves: (P- V) = A (P V) T + Q V, (P+ V) = P- V - G H P- V. They stay in the
span of W (n, w), of Q V, P0 V and their products with powers of A. In the eigenvectors of A within
either span both products are by numbers. Where damping makes all modes decay alike the spans are
narrow (r = 18, w = 108 of 525 on paper 001's cube), and the gains equal those of the whole
covariance to rounding.
"""

from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from validate.arrays import Floats
from validate.estimate.kalman.covariance import Claim, Covariance, Decoupled, claimed, noise
from validate.estimate.kalman.formulas import Gain, Seen, best_gain
from validate.estimate.kalman.gains import GainSequence, gain_sequence, schedule
from validate.estimate.kalman.modal_kernel import advance_observed
from validate.estimate.measurements import Timetable
from validate.fem.system import System, once

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
        space = known[key] = _space(f, V, QV, PV0, steps)
        QV, PV0 = covariance.Q @ space.V, covariance.P0 @ space.V
    W, V = space.W, space.V
    return Observed(space, W.T @ QV, W.T @ PV0, H @ V, H @ W, covariance.R)


def _space(f: Floats, V: Floats, QV: Floats, PV0: Floats, steps: int) -> NarrowSpace:
    sizes = (float(np.linalg.norm(X)) or 1.0 for X in (QV, PV0))
    X = np.hstack([X / size for X, size in zip((QV, PV0), sizes, strict=True)])
    W = _span(X, f, steps, len(f) // 2)
    if W is None:
        return NarrowSpace(*_diagonal(V, f), np.eye(len(f)), f)
    return NarrowSpace(*_diagonal(V, f), *_diagonal(W, f))


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
