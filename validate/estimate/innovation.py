"""What every filter reports of a step: innovation, its standard deviation, and NIS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from validate.arrays import Floats
from validate.solve.types import State, Trace


@dataclass(frozen=True)
class Innovation:
    """y = z - H u_prior (m,) m, zero where nothing was measured; sd (m,) m, zero there too.

    `nis` = y^T S_yy^-1 y of the `dof` components that were measured.
    """

    y: Floats
    sd: Floats
    nis: float
    dof: int

    def numbers(self, names: tuple[str, ...]) -> Mapping[str, float]:
        """By trace name, for `State.numbers`."""
        numbers = {"nis": self.nis, "nis.dof": float(self.dof)}
        for name, y, sd in zip(names, self.y.tolist(), self.sd.tolist(), strict=True):
            numbers[f"innovation.{name}"] = y
            numbers[f"innovation.{name}.sd"] = sd
        return numbers


def innovation(z: Floats, predicted: Floats, S_yy: Floats) -> Innovation:
    """From z (m,) with NaN = missing, H u_prior (m,) and the covariance S_yy (m, m) m^2."""
    seen = np.isfinite(z)
    y = np.where(seen, z - predicted, 0.0)
    S = S_yy[np.ix_(seen, seen)]
    nis = float(y[seen] @ cho_solve(cho_factor(S), y[seen]))
    return Innovation(y, np.where(seen, np.sqrt(np.diag(S_yy)), 0.0), nis, int(seen.sum()))


def nothing(m: int) -> Innovation:
    """A step without a measurement."""
    return Innovation(np.zeros(m), np.zeros(m), 0.0, 0)


def innovation_traces(names: tuple[str, ...], states: Sequence[State]) -> dict[str, Trace]:
    """Traces "nis", "nis.dof", "innovation.<name>" and "innovation.<name>.sd" of all steps."""
    units = {"nis": "1", "nis.dof": "1"}
    for name in names:
        units |= {f"innovation.{name}": "m", f"innovation.{name}.sd": "m"}
    return {
        key: Trace(np.array([s.numbers.get(key, 0.0) for s in states]), unit)
        for key, unit in units.items()
    }
