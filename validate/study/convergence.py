"""Discretisation error from the answers of a ladder: observed order, Richardson, convergence index.

Sources: Roache (1994), the grid convergence index; Celik et al. (2008), ASME J. Fluids Eng. 130,
078001, the procedure and its fixed point for unequal ratios.

Departures: answers may be fields at common points; norms of their differences take the place of
the differences of one number. Whether they converge monotonously is the sign of their product.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from validate.arrays import Floats, rms
from validate.errors import ComparisonError

SAFETY, UNSURE = (
    1.25,
    3.0,
)  # factors of the index: three meshes, two meshes or an odd order (Roache)
_WITHIN = 1.0  # an observed order further from the theoretical one is not trusted with SAFETY
_LEAST, _MOST = 0.05, 10.0  # orders looked for
_ITERATIONS = 200

Conduct = Literal["monotone", "oscillating", "diverging", "two only"]


@dataclass(frozen=True)
class Convergence:
    """Of answers on rising sizes h: `order` observed (None: cannot be), and what it implies.

    `differences` are the norms between neighbours, finest first; `error` is Richardson's estimate
    of the finest answer's error, `index` that times the factor of safety (both in the answers'
    unit); `extrapolated` is the answer at h = 0. `used` is the order they rest on.
    """

    conduct: Conduct
    order: float | None
    used: float
    differences: tuple[float, ...]
    error: float
    index: float
    extrapolated: Floats


def convergence(h: Sequence[float], answers: Sequence[Floats], theoretical: float) -> Convergence:
    """From answers of one shape at sizes h, finest first: two, or three and more (three are used).

    Without an observed order (two answers, growing differences) the theoretical one is used, with
    the larger factor of safety. Raises `ComparisonError` for fewer than two, or sizes not rising.
    """
    if len(h) != len(answers) or len(h) < 2 or min(np.diff(h)) <= 0:
        raise ComparisonError(f"{len(answers)} answers at sizes {list(h)}: two and more, rising")
    steps = [rms(np.atleast_2d(a - b)) for a, b in pairwise(answers)]
    r21 = h[1] / h[0]
    if len(h) == 2:
        return _made("two only", None, theoretical, r21, steps, answers)
    order = observed_order(r21, h[2] / h[1], steps[0], steps[1])
    if order is None:
        return _made("diverging", None, theoretical, r21, steps, answers)
    along = float(np.vdot(answers[0] - answers[1], answers[1] - answers[2]))
    conduct: Conduct = "monotone" if along > 0 else "oscillating"
    return _made(conduct, order, theoretical, r21, steps, answers)


def observed_order(r21: float, r32: float, e21: float, e32: float) -> float | None:
    """p with e32/e21 = r21^p (r32^p - 1)/(r21^p - 1); None where the differences do not shrink so.

    r21 = h2/h1 and r32 = h3/h2 > 1; e21, e32 >= 0 are norms of the differences.
    """
    if not (e21 > 0 and e32 > 0):
        return None

    def missing(p: float) -> float:
        return float(np.log(r21**p * (r32**p - 1) / (r21**p - 1)) - np.log(e32 / e21))

    low, high = _LEAST, _MOST
    if missing(low) > 0 or missing(high) < 0:
        return None
    for _ in range(_ITERATIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if missing(middle) < 0 else (low, middle)
    return (low + high) / 2


def _made(
    conduct: Conduct,
    order: float | None,
    theoretical: float,
    r21: float,
    steps: list[float],
    answers: Sequence[Floats],
) -> Convergence:
    used = theoretical if order is None else min(order, theoretical)
    share = 1 / (r21**used - 1)
    trusted = conduct == "monotone" and order is not None and abs(order - theoretical) <= _WITHIN
    error = share * steps[0]
    extrapolated = answers[0] + share * (answers[0] - answers[1])
    index = (SAFETY if trusted else UNSURE) * error
    return Convergence(conduct, order, used, tuple(steps), error, index, extrapolated)
