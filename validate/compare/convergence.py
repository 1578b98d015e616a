"""How far the answer on one mesh (or step) is from that on an infinitely fine one: u_num, earned.

Answers at three and more sizes h are fitted by f(h) = f0 + a h^p, the observed order p common to
all components (Eca & Hoekstra 2014, least squares). The 95 % band of the judged answer is
F |a h^p| + s + r: F the factor of safety (Roache 1994), s the fit's scatter, r its distance from
the judged answer; u is half of it (ASME V&V 20, section 2). Three answers show no scatter: there s
is what the formal order in place of p would change. F is 1.25 from p = 0.5 to 1.25 times the formal
order, if three answers do not oscillate, else 3. An order above the formal one is not
believed: that one extrapolates, from the judged size, those finer and the next coarser.

Not asymptotic: p below 0.5, or a trend hidden by scatter. Nothing bounds the error then.

Measured: for linear tetrahedra the band was short in 7 of 15 cases, by a factor of at most 1.36.
The rule is kept as published, not tuned to them.

`richardson` is for tables of studies: the observed order of three answers by a fixed point for
unequal ratios, and the grid convergence index of the finest (Celik et al. 2008).

Departures: answers may be arrays; one order then serves all components, and rms stands for the
absolute value. Where Eca & Hoekstra enlarge the band of a bad fit, nothing is decided here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot, inf, isfinite
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, rms
from validate.errors import ComparisonError

NEAR, FAR = 1.25, 3.0  # Roache's factors of safety
_LEAST = 0.5  # order below which nothing is asymptotic (Eca & Hoekstra 2014)
_SLOWEST, _ABOVE = 0.05, 4.0  # orders looked for: from, and so far above the formal one
_ZOOMS = 4

BoolArray = NDArray[np.bool_]
Conduct = Literal["monotone", "oscillating", "diverging", "at rounding"]


@dataclass(frozen=True)
class GridConvergence:
    """Of answers at `sizes` sizes: the observed `order`, the factor of `safety`, and the standard
    uncertainty `u` of the judged answer in its unit, infinite where they are not asymptotic.

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
        return isfinite(self.u)

    @property
    def words(self) -> str:
        if self.conduct == "at rounding":
            return f"{self.sizes} sizes differ by nothing that counts ({self.u:.1g})"
        if self.order is None:
            return f"{self.conduct} over {self.sizes} sizes, not asymptotic"
        return (
            f"{self.conduct} over {self.sizes} sizes, order {self.order:.2g} of formal "
            f"{self.formal:g}, safety {self.safety:g}"
        )

    def deciding(self, limit: float) -> float:
        """Size over the judged one at which 2 u would be half of `limit` (answer's unit).

        Extrapolated by the order at hand; where there is none by the formal one from the range, and
        then at most half the finest size.
        """
        if self.conduct == "at rounding":
            return 1.0
        if self.order is None:
            size = (limit / 2 / (FAR * self.range)) ** (1 / self.formal)
            return float(min(size, self.finest / 2))
        order = min(self.order, self.formal)
        return float(min(limit / 4 / self.u, 1.0) ** (1 / order))


@dataclass(frozen=True)
class Numerical:
    """Standard uncertainties by what they come from ("mesh", "time step"), in the residual's unit.

    Infinite where the answers are not asymptotic: nothing bounds the error. `words` say how each
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
    `ComparisonError` for fewer than three different sizes.
    """
    sizes, values = np.asarray(h, dtype=float), np.array([np.ravel(a) for a in answers])
    if len(values) != len(sizes) or len(np.unique(sizes)) < 3 or not sizes.min() > 0:
        raise ComparisonError(
            f"{len(values)} answers at sizes {', '.join(f'{x:.3g}' for x in sizes)}: u_num needs "
            "three and more different ones"
        )
    share = sizes / sizes[judged]
    distance = max(_rms(v - values[judged], answers[judged]) for v in values)
    found = (len(share), float(share.min()), formal)
    if distance <= rounding:
        return GridConvergence("at rounding", *found, None, 1.0, distance, distance)
    order = _order(share, values, formal)
    band, safety = _band(share, values, order, formal, answers[judged])
    opposed = len(share) == 3 and _opposed(share, values)
    conduct: Conduct = "oscillating" if opposed else "monotone" if isfinite(band) else "diverging"
    return GridConvergence(
        conduct, *found, order if isfinite(band) else None, safety, band / 2, distance
    )


def _band(
    share: Floats, values: Floats, order: float, formal: float, like: Floats
) -> tuple[float, float]:
    """The 95 % band (infinite: not asymptotic) and its factor of safety."""
    n, m = values.shape
    a, left = _fit(share, values, order)
    near = order <= 1.25 * formal and not (n == 3 and _opposed(share, values))
    safety = NEAR if near else FAR
    if order < _LEAST or _hidden(share, values, a, left):
        return inf, safety
    scatter = _rms(left, like) * np.sqrt(n / max(n - 2 - 1 / m, 1.0))
    about = _about(share) if order > formal else share > 0
    a, left = _fit(share[about], values[about], min(order, formal))
    off = _rms(left[share[about] == 1][0], like)
    if n == 3:
        other = _fit(share[about], values[about], max(order, formal))[0]
        scatter += abs(_rms(a, like) - _rms(other, like))
    return safety * _rms(a, like) + scatter + off, safety


def _about(share: Floats) -> BoolArray:
    """The judged size, those finer and the next coarser; all where it is the finest or coarsest."""
    inside = share.min() < 1 < share.max()
    found: BoolArray = share <= share[share > 1].min() if inside else share > 0
    return found


def _hidden(share: Floats, values: Floats, a: Floats, left: Floats) -> bool:
    """Whether scatter hides the trend: half of it from the coarsest to the finest, along a (m,)."""
    n, along = len(share), a / max(float(np.linalg.norm(a)), 1e-300)
    scatter = np.linalg.norm(left @ along) / np.sqrt(max(n - 3, 1))
    trend = (values[share.argmax()] - values[share.argmin()]) @ along
    return bool(2 * scatter >= abs(trend))


def _rms(values: Floats, like: Floats) -> float:
    """Rms length of the rows of flat answers (..., m) that have the shape of `like` (k, c)."""
    return rms(values.reshape(-1, like.shape[-1])) if like.ndim > 1 else rms(values.ravel())


def _opposed(share: Floats, values: Floats) -> bool:
    """Whether, of three, the step to the finest goes back on the one before."""
    coarse, middle, fine = values[np.argsort(-share)]
    return float(np.vdot(middle - coarse, fine - middle)) < 0


def _fit(share: Floats, values: Floats, order: float) -> tuple[Floats, Floats]:
    """a (m,), at the judged size, and what is left (n, m) of f0 + a share^order."""
    x = share**order
    x = x - x.mean()
    about = values - values.mean(axis=0)
    a = x @ about / (x @ x)
    return a, about - np.outer(x, a)


def _order(share: Floats, values: Floats, formal: float) -> float:
    """The order that leaves least: the best of a grid, then of one between its neighbours."""
    about = values - values.mean(axis=0)
    gram = about @ about.T

    def explained(p: float) -> float:
        x = share**p - np.mean(share**p)
        return float(x @ gram @ x / (x @ x))

    low, high = _SLOWEST, formal + _ABOVE
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
        raise ComparisonError(f"{len(answers)} answers at sizes {list(h)}: two and more, rising")
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
