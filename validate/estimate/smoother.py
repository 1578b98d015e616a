"""Smoothing of a recorded run: every step estimated from all measurements, later ones too.

Rauch, Tung & Striebel (1965), in the form of Bryson & Frazier (1963), whose results are the same
and which inverts no P: ours is singular wherever the start is known or noise acts along few shapes.
Backward, from lambda = 0 and W = 0 (n, 0) after the last step,

    lambda- = lambda - H^T (G^T lambda + S_yy^-1 y),   lambda of the step before = A^T lambda-
    W- = [(I - G H)^T W, H^T S_yy^-1/2],               W of the step before = A^T W-

and forward the correction e of every filtered state, e = -P0 lambda at the start, then
e' = A e - Q lambda- - G y. The covariance is P_s = P - (P W)(P W)^T, never above P.

A run is stepped twice, so that of its steps only innovations, lambda (n,) and e are kept, and W at
output frames, in as few columns as carry it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from validate.arrays import Floats
from validate.errors import UsageError
from validate.estimate.kalman.formulas import Gain, Innovation
from validate.parameters import quantity

_WIDE = 48  # columns of W from which fewer are looked for
_FEW = 100  # states up to which W is only turned, none of it left out
_LEFT = 1e-12  # singular values of W, of the largest, that are left out of more states


def smooth_setting() -> Any:
    """Return the field of every filter that can smooth."""
    return quantity(
        False, "1", "estimate each step from all measurements, also later ones; not in real time"
    )


class Transition(Protocol):
    """Transition of errors (n,) of a state; Q and P0 (n, n) as of the filter, H (m, n)."""

    @property
    def Q(self) -> Floats: ...

    @property
    def P0(self) -> Floats: ...

    @property
    def H(self) -> Floats: ...

    def ahead(self, x: Floats) -> Floats:
        """Return a x."""
        ...

    def back(self, x: Floats) -> Floats:
        """A^T x of x (n,) or (n, k)."""
        ...


@dataclass(frozen=True)
class Look:
    """The gain of a step, and the innovations y (k,) m of the components that it has seen."""

    gain: Gain
    y: Floats


def look_of(gain: Gain, found: Innovation) -> Look:
    return Look(gain, found.y[np.array(gain.seen)])


@dataclass(frozen=True)
class Note:
    """What smoothing needs of a step: its look, if any, whether it is an output frame, and how
    errors went over to it where that is not as at every step."""

    look: Look | None
    framed: bool = False
    across: Transition | None = None


@dataclass(frozen=True)
class Smoothed:
    """Corrections (steps, n) of the filtered states; W (n, r) by step number at output frames."""

    corrections: Floats
    roots: Mapping[int, Floats]

    def after(self, step: int) -> Floats:
        """Return the correction (n,) of the state after a step 1, 2, ..."""
        return np.asarray(self.corrections[step - 1])


def smoothed(model: Transition, notes: Sequence[Note]) -> Smoothed:
    """From the `notes` of steps 1, 2, ..."""
    n, roots = len(model.P0), {}
    kept, away, W = np.empty((len(notes), n)), np.zeros(n), np.zeros((n, 0))
    for i in reversed(range(len(notes))):
        if notes[i].framed:
            roots[i + 1] = W = _narrow(W)
        look = notes[i].look
        if look is not None:
            # lambda- and W- of the look
            H, G, root = model.H[np.array(look.gain.seen)], look.gain.G, look.gain.root
            away = away - H.T @ (G.T @ away + cho_solve((root, False), look.y))
            seen = solve_triangular(root, H, trans="T")
            W = np.hstack([W - H.T @ (G.T @ W), seen.T])
        kept[i], across = away, notes[i].across or model
        wide = max(_WIDE, 2 * n if n <= _FEW else 0)
        away, W = across.back(away), across.back(W if W.shape[1] <= wide else _narrow(W))
    # Corrections (steps, n), in the place of `kept`
    e = -model.P0 @ away
    for i, note in enumerate(notes):
        across = note.across or model
        e = across.ahead(e) - across.Q @ kept[i]
        if note.look is not None:
            e = e - note.look.gain.G @ note.look.y
        kept[i] = e
    return Smoothed(kept, roots)


def _narrow(W: Floats) -> Floats:
    """Fewer columns (n, r) with the same W W^T."""
    n, c = W.shape
    if n <= _FEW:
        return W if c <= n else np.asarray(np.linalg.qr(W.T, mode="r")).T
    U, s, _ = np.linalg.svd(W, full_matrices=False)
    kept = s > _LEFT * s.max(initial=0.0)
    return np.asarray(U[:, kept] * s[kept])


def require_exact(smooth: bool, gains: str) -> None:
    """Raise `UsageError` for smoothing by gains that are not those of the filter's own P."""
    if smooth and gains == "steady":
        raise UsageError("smooth needs the exact gains: take gains='sequence'")
