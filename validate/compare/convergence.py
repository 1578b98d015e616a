"""Numerical uncertainty u_num of a result by refinement of mesh or time step.

Two sizes have no observed order: the error follows from the formal one, with F = 3 (Roache 1994).

Answers at three and more sizes h of similar meshes are fitted by f(h) = f0 + a h^p (Eca & Hoekstra
2014, J. Comput. Phys. 262, 104-130): least squares, with equal weights and with weights 1/h; the
fit with the smaller standard deviation s counts. The observed order p is trusted from 0.5 to 1.5
times the formal order q, the one that theory gives for h to 0. Otherwise the best of
f0 + a h^(q/2), f0 + a h^q and f0 + a h^(q/2) + b h^q is taken (the last one for p below 0.5 alone,
from four sizes on).

With the estimated error e of the judged answer, its distance r from the fit and the data range
D = (max - min) / (n - 1), the 95 % band is

    F e + s + r             where s < D; F = 1.25 for a trusted order, else 3,
    3 (s / D) (e + s + r)   where s >= D.

It is always finite. u is half of it (ASME V&V 20, section 2).

Departures from the paper. Answers may be arrays: one order then serves all components, and rms
stands for the absolute value. The scatter of an answer of 20 numbers and more is known from all of
them, not from a few sizes alone: where s >= D its band is F e + 2 s + r, F as above. (s adds up
over the numbers and D does not: meshes that cut a curved wall anew, 0.1 mm apart, had a band of
0.9 mm.) Three sizes are enough; a scalar has no s then. A trusted order above
the formal one is replaced by the formal one in the fit: near a corner the observed order falls as
the mesh is refined, and the band of the rule as printed (p up to 2.1 as it is) was short for pads
between bonded plates (`benchmarks/bodies.py table`, docs/explanation/discretisation.md).

`richardson` is for tables of studies: the observed order of three answers by a fixed point for
unequal ratios, and the grid convergence index of the finest (Celik et al. 2008).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot
from types import MappingProxyType
from typing import Literal

import numpy as np

from validate.arrays import Floats, rms
from validate.errors import ComparisonError

NEAR, FAR = 1.25, 3.0  # factors of safety (Roache 1994)
_LEAST, _MOST = 0.5, 1.5  # trusted orders: from, and to so many times the formal one
_LOWEST, _ABOVE = 0.05, 4.0  # orders looked for: from, and to so far above the formal one
_ZOOMS = 4
_MANY = 20  # numbers of an answer from which its scatter is known well
_TINY = 1e-300

Conduct = Literal["monotone", "oscillating", "no order", "at rounding", "two sizes"]


@dataclass(frozen=True)
class GridConvergence:
    """Convergence of answers at `sizes` sizes: the observed `order` (None: not trusted), the factor
    of `safety`, and the standard uncertainty `u` of the judged answer in its unit.

    `range` is the largest rms difference to the judged answer, `finest` the smallest size over it.
    """

    conduct: Conduct
    sizes: int
    finest: float
    formal: float
    order: float | None
    safety: float
    u: float
    range: float

    @property
    def asymptotic(self) -> bool:
        """Whether the observed order is trusted, or the answers do not differ."""
        return self.order is not None or self.conduct == "at rounding"

    @property
    def words(self) -> str:
        if self.conduct == "at rounding":
            return f"{self.sizes} sizes differ by a negligible amount ({self.u:.1g})"
        if self.conduct == "two sizes":
            return f"two sizes, formal order {self.formal:g} assumed, safety {self.safety:.3g}"
        if self.order is None:
            return (
                f"{self.conduct} over {self.sizes} sizes that can be trusted (formal "
                f"{self.formal:g}), safety {self.safety:.3g}"
            )
        return (
            f"{self.conduct} over {self.sizes} sizes, order {self.order:.2g} of formal "
            f"{self.formal:g}, safety {self.safety:.3g}"
        )

    def deciding(self, limit: float) -> float:
        """Size over the judged one at which 2 u would be half of `limit` (answer's unit).

        Extrapolated by the trusted order, at most the formal one; without one by half the formal
        order.
        """
        if self.conduct == "at rounding":
            return 1.0
        order = self.formal / 2 if self.order is None else min(self.order, self.formal)
        return float(min(limit / 4 / self.u, 1.0) ** (1 / order))


@dataclass(frozen=True)
class Numerical:
    """Standard uncertainties by what they come from ("mesh", "time step"), in the residual's unit.

    Infinite where fewer than two sizes compare the same points. `words` say how each
    was found, `deciding` by part what would make it small enough. No parts: no discretisation.
    """

    parts: Mapping[str, float] = field(default_factory=dict)
    words: str = ""
    deciding: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", MappingProxyType(dict(self.parts)))
        object.__setattr__(self, "deciding", MappingProxyType(dict(self.deciding)))

    @property
    def u(self) -> float:
        return hypot(*self.parts.values())


def convergence(
    h: Sequence[float],
    answers: Sequence[Floats],
    judged: int,
    formal: float,
    rounding: float = 0.0,
) -> GridConvergence:
    """Of `answers` (one shape (k, c)) at sizes `h` (n,), the one at index `judged` in question.

    Differences up to `rounding` (answers' unit) are rounding, not discretisation. Raises
    `ComparisonError` for fewer than two different sizes.
    """
    sizes, values = np.asarray(h, dtype=float), np.array([np.ravel(a) for a in answers])
    if len(values) != len(sizes) or len(np.unique(sizes)) < 2 or not sizes.min() > 0:
        raise ComparisonError(
            f"{len(values)} answers at sizes {', '.join(f'{x:.3g}' for x in sizes)}: u_num "
            "needs at least two different ones"
        )
    share = sizes / sizes[judged]
    like = answers[judged]
    distance = max(_rms(v - values[judged], like) for v in values)
    found = (len(share), float(share.min()), formal)
    if distance <= rounding:
        return GridConvergence("at rounding", *found, None, 1.0, distance, distance)
    if len(np.unique(sizes)) == 2:
        error = _rms(_fit(share, values, np.ones(len(share)), (formal,), like).error, like)
        return GridConvergence("two sizes", *found, None, FAR, FAR * error / 2, distance)
    fits = []
    for w in _weights(share):
        orders = (_order(share, values, w, formal),)
        fits.append(_fit(share, values, w, orders, like, known=False))
    fit = free = _best(fits)
    trusted = _LEAST <= free.order <= _MOST * formal
    if not trusted or free.order > formal:
        # Orders of the expansions to choose from, where the observed one is not trusted
        terms: list[tuple[float, ...]] = [(formal,)]
        if not trusted:
            terms = [(formal / 2,), (formal,)]
            if free.order < _LEAST and len(share) > 3:
                terms.append((formal / 2, formal))
        fit = _best([_fit(share, values, w, t, like) for w in _weights(share) for t in terms])
    spread = max(_rms(a - b, like) for a in values for b in values) / (len(share) - 1)
    safety = NEAR if trusted else FAR
    off = _rms(fit.left[judged], like)
    error = _rms(fit.error, like)
    if fit.sd < spread:
        band = safety * error + fit.sd + off
    elif values.shape[1] >= _MANY:
        band = safety * error + 2 * fit.sd + off
    else:
        safety = FAR * fit.sd / spread
        band = safety * (error + fit.sd + off)
    conduct: Conduct = "no order"
    if trusted:
        # It oscillates where the step to the finest answer goes back on the one before.
        coarse, middle, fine = values[np.argsort(-share)][-3:]
        opposed = float(np.vdot(middle - coarse, fine - middle)) < 0
        conduct = "oscillating" if opposed else "monotone"
    order = free.order if trusted else None
    return GridConvergence(conduct, *found, order, safety, band / 2, distance)


@dataclass(frozen=True)
class _Fit:
    """f0 + terms: the `error` (m,) of the judged answer, what is `left` (n, m) and its `sd`."""

    order: float
    error: Floats
    left: Floats
    sd: float


def _weights(share: Floats) -> tuple[Floats, Floats]:
    """Equal weights, and those of Eca & Hoekstra; both with mean 1."""
    return np.ones(len(share)), len(share) / share / np.sum(1 / share)


def _best(fits: Sequence[_Fit]) -> _Fit:
    return min(fits, key=lambda fit: fit.sd)


def _fit(
    share: Floats,
    values: Floats,
    weights: Floats,
    orders: tuple[float, ...],
    like: Floats,
    *,
    known: bool = True,
) -> _Fit:
    """Weighted least squares of f0 + sum of a share^order; an order that is not `known` is one
    parameter more, shared by the m components."""
    n, m = values.shape
    terms = np.stack([np.ones(n), *(share**p for p in orders)], axis=1)
    root = np.sqrt(weights)[:, None]
    found = np.linalg.lstsq(root * terms, root * values, rcond=None)[0]
    left = values - terms @ found
    free = n - 1 - len(orders) - (0 if known else 1 / m)
    squares = sum(w * _rms(row, like) ** 2 for w, row in zip(weights, left, strict=True))
    sd = float(np.sqrt(squares / free)) if free > 0 else 0.0
    return _Fit(orders[0], found[1:].sum(axis=0), left, sd)


def _rms(values: Floats, like: Floats) -> float:
    """Rms length of the rows of flat answers (..., m) that have the shape of `like` (k, c)."""
    return rms(values.reshape(-1, like.shape[-1])) if like.ndim > 1 else rms(values.ravel())


def _order(share: Floats, values: Floats, weights: Floats, formal: float) -> float:
    """The order that leaves least: the best of a grid, then of one between its neighbours."""
    about = values - np.average(values, axis=0, weights=weights)
    gram = about @ about.T

    def explained(p: float) -> float:
        x = share**p - np.average(share**p, weights=weights)
        along = weights * x
        return float(along @ gram @ along / (along @ x))

    low, high = _LOWEST, formal + _ABOVE
    for _ in range(_ZOOMS):
        grid = np.linspace(low, high, 31)
        best = int(np.argmax([explained(p) for p in grid]))
        low, high = float(grid[max(best - 1, 0)]), float(grid[min(best + 1, 30)])
    return (low + high) / 2


# --- the finest of a few answers, for tables of studies -------------------------------------------

_WITHIN = 1.0  # an observed order further from the theoretical one is not trusted with NEAR
_LOW, _HIGH = 0.05, 10.0  # orders looked for
_ITERATIONS = 200

Steps = Literal["monotone", "oscillating", "diverging", "two only"]


@dataclass(frozen=True)
class Richardson:
    """Of answers on rising sizes h: `order` observed (None: cannot be), and what it implies.

    `differences` are the norms between neighbours, finest first; `error` is Richardson's estimate
    of the finest answer's error, `index` that times the factor of safety (both in the answers'
    unit); `extrapolated` is the answer at h = 0. `used` is the order they rest on.
    """

    conduct: Steps
    order: float | None
    used: float
    differences: tuple[float, ...]
    error: float
    index: float
    extrapolated: Floats


def richardson(h: Sequence[float], answers: Sequence[Floats], theoretical: float) -> Richardson:
    """From answers of one shape at sizes h, finest first: two, or three and more (three are used).

    Without an observed order (two answers, growing differences) the theoretical one is used, with
    the larger factor of safety. Raises `ComparisonError` for fewer than two, or sizes not rising.
    """
    if len(h) != len(answers) or len(h) < 2 or min(np.diff(h)) <= 0:
        raise ComparisonError(
            f"{len(answers)} answers at sizes {list(h)}: expected at least "
            "two, with increasing sizes"
        )
    steps = [rms(np.atleast_2d(a - b)) for a, b in pairwise(answers)]
    r21 = h[1] / h[0]
    if len(h) == 2:
        return _made("two only", None, theoretical, r21, steps, answers)
    order = observed_order(r21, h[2] / h[1], steps[0], steps[1])
    if order is None:
        return _made("diverging", None, theoretical, r21, steps, answers)
    along = float(np.vdot(answers[0] - answers[1], answers[1] - answers[2]))
    conduct: Steps = "monotone" if along > 0 else "oscillating"
    return _made(conduct, order, theoretical, r21, steps, answers)


def observed_order(r21: float, r32: float, e21: float, e32: float) -> float | None:
    """p with e32/e21 = r21^p (r32^p - 1)/(r21^p - 1); None where the differences do not shrink so.

    r21 = h2/h1 and r32 = h3/h2 > 1; e21, e32 >= 0 are norms of the differences.
    """
    if not (e21 > 0 and e32 > 0):
        return None

    def missing(p: float) -> float:
        return float(np.log(r21**p * (r32**p - 1) / (r21**p - 1)) - np.log(e32 / e21))

    low, high = _LOW, _HIGH
    if missing(low) > 0 or missing(high) < 0:
        return None
    for _ in range(_ITERATIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if missing(middle) < 0 else (low, middle)
    return (low + high) / 2


def _made(
    conduct: Steps,
    order: float | None,
    theoretical: float,
    r21: float,
    steps: list[float],
    answers: Sequence[Floats],
) -> Richardson:
    used = theoretical if order is None else min(order, theoretical)
    share = 1 / (r21**used - 1)
    trusted = conduct == "monotone" and order is not None and abs(order - theoretical) <= _WITHIN
    error = share * steps[0]
    extrapolated = answers[0] + share * (answers[0] - answers[1])
    index = (NEAR if trusted else FAR) * error
    return Richardson(conduct, order, used, tuple(steps), error, index, extrapolated)
