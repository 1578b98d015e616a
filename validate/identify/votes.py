"""Values of repeats on specimens: every specimen has one vote, however many logs it has."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Votes:
    """Means by specimen; `between`: their sd (None for one), `within`: sd of repeats of one (None
    where each has one log); in the unit of the values."""

    means: dict[str, float]
    between: float | None
    within: float | None
    logs: int

    @property
    def mean(self) -> float:
        return float(np.mean(list(self.means.values())))

    @property
    def sd_mean(self) -> float | None:
        """Of the mean over specimens: by what scatters most, specimens, else repeats; None where
        neither is known."""
        if self.between is not None:
            return float(self.between / np.sqrt(len(self.means)))
        return None if self.within is None else float(self.within / np.sqrt(self.logs))


def by_specimen(values: Sequence[float], specimens: Sequence[str]) -> Votes:
    """Values of logs, and the specimen of each; every specimen has one vote."""
    of = {s: np.array([v for v, o in zip(values, specimens, strict=True) if o == s])
          for s in dict.fromkeys(specimens)}  # fmt: skip
    means = {s: float(v.mean()) for s, v in of.items()}
    between = float(np.std(list(means.values()), ddof=1)) if len(means) > 1 else None
    freedom = len(values) - len(means)
    spread = sum(float(((v - v.mean()) ** 2).sum()) for v in of.values())
    within = float(np.sqrt(spread / freedom)) if freedom > 0 else None
    return Votes(means, between, within, len(values))
