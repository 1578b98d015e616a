"""Gains and covariances of the reduced filter, found before the run: they need no data.

The recursion is that of few states over the gaps between measurements, in Joseph's form; the
steady one is the fixed point of the discrete algebraic Riccati equation.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve

from validate.arrays import Floats
from validate.estimate.linear_model import LinearModel
from validate.estimate.measured import Timetable
from validate.estimate.small import joseph
from validate.estimate.steady import steady_claim

Bools = NDArray[np.bool_]
_SETTLED = 1e-9  # change of a gain from one update to the next: with slow modes 1e-6 is too early


@dataclass(frozen=True)
class Jump:
    """A transition A (s, s) over some steps and the process noise Q (s, s) gathered on the way."""

    A: Floats
    Q: Floats

    def then(self, later: "Jump") -> "Jump":
        return Jump(later.A @ self.A, later.A @ self.Q @ later.A.T + later.Q)


@dataclass(frozen=True)
class ReducedModel:
    """The state (q, q_before, bias) of s = 2 r + l numbers: one explicit step, P at rest, H (m, s)
    and R (m, m) m^2 of the measurements."""

    Phi: Floats
    one: Jump
    P0: Floats
    H: Floats
    R: Floats

    @property
    def r(self) -> int:
        return int(self.Phi.shape[1])

    def over(self, steps: int) -> Jump:
        """The transition over any number of explicit steps >= 0, by repeated squaring."""
        s = len(self.P0)
        whole, part = Jump(np.eye(s), np.zeros((s, s))), self.one
        while steps:
            whole = whole.then(part) if steps & 1 else whole
            steps, part = steps >> 1, part.then(part)
        return whole

    def update(self, P: Floats, seen: Bools) -> "Update":
        """The update of P- (s, s) by the `seen` (m,) components, in Joseph's form."""
        H, R, m = self.H[seen], self.R[seen][:, seen], len(seen)
        S_yy = H @ P @ H.T + R
        inverse, G = np.zeros((m, m)), np.zeros((len(P), m))
        inverse[np.ix_(seen, seen)] = np.linalg.inv(S_yy)
        G[:, seen] = solve(S_yy, H @ P, assume_a="pos").T
        sd = np.zeros(m)
        sd[seen] = np.sqrt(np.diag(S_yy))
        return Update(G, inverse, sd, int(seen.sum()), joseph(P, G[:, seen], H, R))


@dataclass(frozen=True)
class Update:
    """Gain G (s, m) and S_yy^-1 (m, m), zero where nothing is seen; sd (m,) m of the innovations,
    how many are seen, and P (s, s) afterwards."""

    G: Floats
    inverse: Floats
    sd: Floats
    dof: int
    P: Floats


def updates(model: ReducedModel, times: Timetable, *, steady: bool) -> Mapping[int, Update]:
    """By explicit step. They depend on when what is measured, not on what was read.

    A settled gain is kept while interval and components stay what they are. Raises
    `ComparisonError` for a steady gain that does not exist.
    """
    found: dict[int, Update] = {}
    gaps = np.diff([0, *sorted(times.z)])
    jumps = {int(gap): model.over(int(gap)) for gap in np.unique(gaps)}
    prior = steady_prior(jumps[int(np.median(gaps))], model) if steady and len(gaps) else None
    P, at, settled = model.P0, 0, False
    last, pattern = None, None
    for number, z in sorted(times.z.items()):
        seen, jump = np.isfinite(z), jumps[number - at]
        same = (number - at, seen.tolist()) == pattern
        if last is None or not (same and settled):
            new = model.update(jump.A @ P @ jump.A.T + jump.Q if prior is None else prior, seen)
            settled = last is not None and same and _close(new.G, last.G)
            last, pattern = new, (number - at, seen.tolist())
        found[number], P, at = last, last.P, number
    return found


def _close(new: Floats, old: Floats) -> bool:
    return float(np.abs(new - old).max()) <= _SETTLED * float(np.abs(new).max())


def steady_prior(jump: Jump, model: ReducedModel) -> Floats:
    """P- (s, s) that updates a `jump` apart settle to."""
    s = len(model.P0)
    Q, none = (jump.Q + jump.Q.T) / 2, np.zeros((s, 0))
    return steady_claim(
        LinearModel(jump.A, none, model.H, Q, model.R, np.zeros(s), model.P0)
    ).P  # fmt: skip
