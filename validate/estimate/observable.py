"""The covariance of what is observed alone: all gains of a linear filter from a narrow recursion.

A gain needs P H^T only. With V (n, r) spanning H^T, A H^T, A^2 H^T, ... and A V = V T the columns
P V close among themselves: (P- V) = A (P V) T + Q V, (P+ V) = P- V - G H P- V. Where damping makes
all modes decay alike that space is narrow (r = 18 of 525 on paper 001's cube), and the gains equal
those of the whole covariance to rounding.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.estimate.covariance import Claim, Decoupled, Recursion, claimed, noise
from validate.estimate.kalman import Gain, Seen, best_gain

_LEFT = 1e-12  # share of A^k H^T outside the space that is taken as none
_WORTH = 5  # times narrower than the whole, or the whole is cheaper


@dataclass(frozen=True)
class Observed:
    """f (n,) the diagonal of A; T (r, r), QV and PV0 (n, r), `rows` (m, r) = H V.

    Its claims hold P V where others hold P.
    """

    f: Floats
    T: Floats
    QV: Floats
    PV0: Floats
    rows: Floats
    V: Floats
    H: Floats
    R: Floats

    def start(self) -> Claim:
        return claimed(self.PV0, self.PV0 @ self.rows.T)

    def predict(self, claim: Claim, steps: int = 1) -> Claim:
        PV = claim.P
        for _ in range(steps):
            PV = self.f[:, None] * (PV @ self.T) + self.QV
        return claimed(PV, PV @ self.rows.T)

    def update(self, claim: Claim, seen: Seen, late: Floats | None = None) -> tuple[Gain, Claim]:
        gain = best_gain(claim.PHt, self.H @ claim.PHt + noise(self.R, late), seen)
        i = np.array(seen)
        PV = claim.P - gain.G @ (claim.PHt[:, i].T @ self.V)
        return gain, claimed(PV, claim.PHt)


def observed(covariance: Decoupled, steps: int) -> Recursion:
    """The narrow recursion if `steps` steps stay in a space that is narrow, else `covariance`."""
    f, H, n = covariance.f, covariance.H, len(covariance.f)
    V = np.linalg.qr(H.T)[0]
    block = V
    while not _holds(V, f, H, steps):
        if V.shape[1] + len(H) > n // _WORTH:
            return covariance
        block = (f - f.mean())[:, None] * block
        for _ in range(2):  # once leaves what rounding leaves
            block = block - V @ (V.T @ block)
        block = np.linalg.qr(block)[0]
        V = np.hstack([V, block])
    T = V.T @ (f[:, None] * V)
    return Observed(f, T, covariance.Q @ V, covariance.P0 @ V, H @ V, V, H, covariance.R)


def _holds(V: Floats, f: Floats, H: Floats, steps: int) -> bool:
    """Whether powers of A up to `steps` keep H^T within V."""
    for k in (1, steps // 4, steps // 2, steps):
        moved = (f / np.abs(f).max())[:, None] ** k * H.T
        if np.linalg.norm(moved - V @ (V.T @ moved)) > _LEFT * np.linalg.norm(moved):
            return False
    return True
