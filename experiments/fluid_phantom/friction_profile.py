"""Interval of a bounded parameter from its profile of chi-square."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from validate.arrays import Floats
from validate.errors import ComparisonError

WITHIN = 4.0  # rise of chi-square at two standard deviations of one parameter


@dataclass(frozen=True)
class Interval:
    """The best value, the values within two standard deviations, and chi-square at the best.

    `low` or `high` at the end of the grid means that the data do not bound that side. `mesh` is the
    discretisation's standard uncertainty, which `low` and `high` count.
    """

    best: float
    low: float
    high: float
    chi_square: float
    count: int
    mesh: float = 0.0


def profile_interval(grid: Floats, chi_square: Floats, count: int, mesh: float = 0.0) -> Interval:
    """From chi-square (g,) over `count` residuals at ascending parameter values (g,).

    Between grid points a monotone cubic interpolates. Two standard uncertainties `mesh` of the
    discretisation are added to both sides as squares, within the grid. Raises `ComparisonError`
    for fewer than 4 points or no residuals.
    """
    if len(grid) < 4 or count == 0:
        raise ComparisonError(f"a profile of {len(grid)} points over {count} residuals; 4 needed")
    fine = np.linspace(grid[0], grid[-1], 2001)
    curve = PchipInterpolator(grid, chi_square)(fine)
    best = int(np.argmin(curve))
    inside = np.flatnonzero(curve <= curve[best] + WITHIN)
    at = float(fine[best])
    below, above = (float(np.hypot(at - fine[inside[i]], 2 * mesh)) for i in (0, -1))
    ends = max(at - below, float(grid[0])), min(at + above, float(grid[-1]))
    return Interval(at, *ends, float(curve[best]), count, mesh)
