"""Modulus of a law as the scale of its force curve, by linear least squares over logs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError


@dataclass(frozen=True)
class LawFit:
    """`scale` of the unit curve, mean over the logs; sd of one log (None for one), samples, N rms.

    Force is linear in the modulus for every law here (at a fixed Poisson ratio), so the scale is
    found by linear least squares; `residual_rms` shows how well the law's shape fits.
    """

    scale: float
    sd_repeats: float | None
    count: int
    residual_rms: float

    def confidence(self, logs: int, mesh: float = 0.0) -> float | None:
        """Two standard deviations: of the mean over `logs` repeats, and `mesh` of the mesh."""
        if self.sd_repeats is None:
            return None
        return 2 * float(np.hypot(self.sd_repeats / np.sqrt(logs), mesh))


def fit_scale(curves: Sequence[Floats], forces: Sequence[Floats]) -> LawFit:
    """Scale of `curves` (per log, (n,) N at unit scale) that fits `forces` (per log, (n,) N).

    Raises `ComparisonError` for no samples or a curve that is zero throughout.
    """
    scales: list[float] = []
    squares, count = 0.0, 0
    for curve, force in zip(curves, forces, strict=True):
        weight = float(curve @ curve)
        if len(curve) == 0 or weight == 0:
            raise ComparisonError(f"log {len(scales)}: {len(curve)} samples of a curve to fit, 0 N")
        scales.append(float(curve @ force) / weight)
        squares += float(((force - scales[-1] * curve) ** 2).sum())
        count += len(curve)
    if count == 0:
        raise ComparisonError("no logs to fit a law to")
    sd = float(np.std(scales, ddof=1)) if len(scales) > 1 else None
    return LawFit(float(np.mean(scales)), sd, count, float(np.sqrt(squares / count)))
