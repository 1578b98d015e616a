"""Search box of an identification: every parameter between its bounds, mapped to [0, 1]."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError

DECADE = 10.0  # bounds further apart than this factor are searched on a logarithmic scale


@dataclass(frozen=True)
class Range:
    """A parameter searched from `low` to `high`, in its own unit."""

    name: str
    low: float
    high: float

    @property
    def logarithmic(self) -> bool:
        return self.low > 0 and self.high / self.low > DECADE


@dataclass(frozen=True)
class Space:
    """p parameters; coordinates x (p,) from 0 at `low` to 1 at `high`."""

    ranges: tuple[Range, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(r.name for r in self.ranges)

    def value(self, i: int, x: float) -> float:
        """Parameter i at a coordinate, in its own unit, never beyond its bounds."""
        r = self.ranges[i]
        x = min(max(x, 0.0), 1.0)
        return r.low * (r.high / r.low) ** x if r.logarithmic else r.low + x * (r.high - r.low)

    def values(self, x: Floats) -> tuple[float, ...]:
        return tuple(self.value(i, float(xi)) for i, xi in enumerate(x))

    def coordinates(self, values: Sequence[float]) -> Floats:
        """Where values (p,) lie, as `values` has them."""
        pairs = zip(self.ranges, values, strict=True)
        return np.array([
            np.log(v / r.low) / np.log(r.high / r.low) if r.logarithmic
            else (v - r.low) / (r.high - r.low)
            for r, v in pairs
        ])  # fmt: skip

    def slope(self, i: int, x: float) -> float:
        """d value / d coordinate of parameter i there."""
        r = self.ranges[i]
        if r.logarithmic:
            return self.value(i, x) * float(np.log(r.high / r.low))
        return r.high - r.low

    def starts(self, count: int, seed: int = 1) -> Floats:
        """(count, p): the middle, then a seeded Latin hypercube (McKay, Beckman & Conover 1979).

        Raises `UsageError` for no start.
        """
        if count < 1:
            raise UsageError(
                f"--seeds {count}: expected at least one start; ten or more for a reliable result"
            )
        p = len(self.ranges)
        return np.vstack([np.full((1, p), 0.5), _latin_hypercube(count - 1, p, seed)])


def _latin_hypercube(n: int, p: int, seed: int) -> Floats:
    """Points (n, p), one in each n-th of every axis; those of `scipy.stats.qmc`, whose import costs
    more than most fits."""
    draw = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
    within = draw.uniform(size=(n, p))
    parts = np.tile(np.arange(1, n + 1), (p, 1))
    for row in parts:
        draw.shuffle(row)
    return np.asarray((parts.T - within) / max(n, 1))
