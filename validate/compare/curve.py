"""Residuals of a force-displacement curve, by windows of the driven displacement."""

import numpy as np

from validate.compare.residual import Residual
from validate.errors import ComparisonError
from validate.register.observe import Registered
from validate.solve.types import Run


def curve_residuals(registered: Registered, run: Run) -> tuple[Residual, ...]:
    """One residual per signal and window of the stage, sample by sample.

    Raises `ComparisonError` when a window holds no sample.
    """
    stage = registered.stage.y[: len(run.t), 0]
    found = []
    for label, (low, high) in registered.windows.items():
        inside = np.flatnonzero((stage > low) & (stage <= high))
        if len(inside) == 0:
            raise ComparisonError(
                f"window {label}: 0 samples between {1e3 * low:g} and {1e3 * high:g} mm; the stage "
                f"covers {1e3 * stage.min():.2f}..{1e3 * stage.max():.2f} mm"
            )
        for seen in registered.signals:
            off = run.traces[seen.trace].y[inside] - seen.y[inside]
            found.append(
                Residual(
                    seen.quantity, label, off[:, None], seen.sd, 0.0, seen.unit,
                    f"{seen.quantity} at every sample with the stage between {1e3 * low:g} and "
                    f"{1e3 * high:g} mm",
                )
            )  # fmt: skip
    return tuple(found)
