"""Uncertain inputs: source of their ranges, and additivity of their effects.

u_input adds first-order effects of one input at a time (GUM 5.1.2). Draws of all inputs at once
(JCGM 101: propagation of distributions by Monte Carlo) see what that leaves out: curvature, and
inputs that act together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.residual import Residual
from validate.compare.verdict import Sensitivity
from validate.errors import ComparisonError

REACH = float(np.sqrt(3.0))  # an input lies uniformly within so many standard uncertainties
_ROUNDING = 1e-9
_TABLES = 200  # of which the one with the least correlated columns is taken


@dataclass(frozen=True)
class Declared:
    """An uncertain input: its range in words, and where that comes from or "assumed"."""

    name: str
    range: str
    source: str


@dataclass(frozen=True)
class Joint:
    """u_input of a residual by first order and by `draws` of all inputs at once, in `unit`."""

    name: str
    unit: str
    first_order: float
    sampled: float
    draws: int

    @property
    def percent(self) -> float | None:
        """How much more the sample shows than first order, %; None without a first order."""
        return 100 * (self.sampled / self.first_order - 1) if self.first_order else None


def joint_draws(draws: int, inputs: int, seed: int = 1) -> Floats:
    """(draws, inputs) standard uncertainties: a Latin hypercube of uniform ranges.

    Centred strata (McKay, Beckman, Conover, Technometrics 21 (1979)); of `_TABLES` permutations the
    one whose columns are least correlated, since a chance correlation would pass for an effect.
    """
    rng = np.random.default_rng(seed)
    strata = REACH * ((2 * np.arange(draws) + 1) / draws - 1)
    tables = [rng.permuted(np.tile(strata, (inputs, 1)), axis=1).T for _ in range(_TABLES)]
    products = [table.T @ table for table in tables]
    correlated = [float(np.abs(p - np.diag(np.diag(p))).max()) for p in products]
    return tables[int(np.argmin(correlated))]


def joint(base: Residual, parts: Sequence[Sensitivity], drawn: Sequence[Residual]) -> Joint:
    """Both u_input of one residual; the sample counts distances from what was simulated.

    What a range does on one side only (plates cannot rub less than not at all) is an error too.
    """
    first = float(np.sqrt(sum(rms(p.change.values) ** 2 for p in parts)))
    sampled = rms(np.array([[rms(difference(one, base))] for one in drawn]))
    least = _ROUNDING * rms(base.values)  # an input that moves nothing leaves rounding
    first, sampled = (u if u > least else 0.0 for u in (first, sampled))
    return Joint(base.name, base.unit, first, sampled, len(drawn))


def difference(moved: Residual, base: Residual) -> Floats:
    """What an input changed of a residual, for every point of the `base` (k, c).

    An input that moves the ends of a window (a height, of strains) lets samples in or out. Those
    that both have are found by what was measured; at an end that only the base has, the change is
    that of the next sample. Raises `ComparisonError` where no samples are the same.
    """
    if moved.values.shape == base.values.shape:
        return np.asarray(moved.values - base.values)
    a = np.zeros((0, 1)) if moved.reference is None else moved.reference
    b = np.zeros((0, 1)) if base.reference is None else base.reference
    starts = range(1 - len(b), len(a)) if len(a) and len(b) else range(0)
    for start in sorted(starts, key=abs):
        rows = np.arange(len(base.values)) + start
        both = (rows >= 0) & (rows < len(moved.values))
        if 2 * both.sum() > len(rows) and np.array_equal(a[rows[both]], b[both]):
            first, last = np.flatnonzero(both)[[0, -1]]
            change = moved.values[rows[both]] - base.values[both]
            edges = (first, len(rows) - 1 - last)
            return np.asarray(np.pad(change, (edges, (0, 0)), mode="edge"))
    raise ComparisonError(
        f"{base.name}: {len(base.values)} samples, {len(moved.values)} with an input moved, and "
        "they are not the same ones; its uncertainty cannot be found"
    )
