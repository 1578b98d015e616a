"""Uncertain inputs: where their ranges come from, and whether their effects add up.

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
    return min(tables, key=_correlated)


def _correlated(table: Floats) -> float:
    products = table.T @ table
    return float(np.abs(products - np.diag(np.diag(products))).max())


def joint(base: Residual, parts: Sequence[Sensitivity], drawn: Sequence[Residual]) -> Joint:
    """Both u_input of one residual; the sample counts distances from what was simulated.

    What a range does on one side only (plates cannot rub less than not at all) is an error too.
    """
    first = float(np.sqrt(sum(rms(p.change.values) ** 2 for p in parts)))
    sampled = rms(np.array([[rms(one.values - base.values)] for one in drawn]))
    least = _ROUNDING * rms(base.values)  # an input that moves nothing leaves rounding
    first, sampled = (u if u > least else 0.0 for u in (first, sampled))
    return Joint(base.name, base.unit, first, sampled, len(drawn))
