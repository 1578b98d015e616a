"""Means over seeds with Student's t intervals, alone and in pairs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

LEVEL = 0.95


@dataclass(frozen=True)
class SeedInterval:
    """A mean of `count` independent numbers; `half` is half the 95 % interval, None for one."""

    mean: float
    half: float | None
    count: int

    @property
    def low(self) -> float:
        return self.mean - (self.half or 0.0)

    @property
    def high(self) -> float:
        return self.mean + (self.half or 0.0)

    def overlaps(self, other: "SeedInterval") -> bool:
        return self.low <= other.high and other.low <= self.high


def interval(values: Sequence[float]) -> SeedInterval:
    """Of the mean of independent, equally distributed values (n,), n >= 1."""
    n = len(values)
    mean = float(np.mean(values))
    if n < 2:
        return SeedInterval(mean, None, n)
    spread = float(np.std(values, ddof=1)) / np.sqrt(n)
    return SeedInterval(mean, float(student.ppf((1 + LEVEL) / 2, n - 1) * spread), n)
