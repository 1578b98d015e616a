"""Bounded least squares of an expensive residual in a search box, and profile likelihood.

The Jacobian is taken by differences once and then follows the steps (Broyden 1965); where the
optimiser stops it is taken anew, and what that promises decides whether the end is one.

Whitening of residuals: r -> C^(-1/2) r, C = sd^2 I + s^2 1 1^T.

What all points of one component share (registration, a clock) is one number of covariance s^2
between any two of them: many points do not average it out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, lsq_linear
from scipy.special import chdtri

from validate.arrays import Floats
from validate.errors import ComparisonError, UsageError, ValidateError

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
        # Points (n, p), one in each n-th of every axis; those of `scipy.stats.qmc`, whose import
        # costs more than most fits.
        n = count - 1
        draw = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
        within = draw.uniform(size=(n, p))
        parts = np.tile(np.arange(1, n + 1), (p, 1))
        for row in parts:
            draw.shuffle(row)
        return np.vstack([np.full((1, p), 0.5), np.asarray((parts.T - within) / max(n, 1))])


Residual = Callable[[Floats], Floats]  # x (p,) from 0 to 1 -> (m,), independent, of variance one
At = Callable[[Floats], Floats]  # coordinates that move -> all of them

STEP = 5e-4  # of the searched range, for differences
PROMISE = 1e-2  # a fall of chi-square, over its mean per freedom, that is none
ROUNDS = 6  # of the optimiser, each from a Jacobian taken anew
EVALUATIONS = 200  # of the residual, then it has not converged
_OFTEN = 1e3  # how many times the first rms a point counts that could not be evaluated
INSIDE = 1e-9  # of the range: the optimiser begins off the bounds


@dataclass(frozen=True)
class Fit:
    """Where one start ended: x (p,), chi-square over `count` residuals, J^T J (p, p) there.

    `why` says what kept it from converging, or "". `count` is 0 where nothing could be simulated,
    `evaluations` counts calls of the residual.
    """

    start: Floats
    x: Floats
    chi_square: float
    count: int
    normal: Floats
    evaluations: int
    converged: bool
    why: str = ""

    @property
    def freedom(self) -> int:
        return self.count - len(self.x)


class CalledOnce:
    """A residual that is called once a point; where it raises, it is far off."""

    def __init__(self, residual: Residual) -> None:
        self._residual = residual
        self._known: dict[bytes, Floats] = {}
        self._penalty: Floats | None = None
        self.calls = 0
        self.failure = ""

    def __call__(self, x: Floats) -> Floats:
        """Raises what the first point raises; later ones that raise are only bad."""
        key = np.asarray(x, dtype=np.float64).tobytes()
        if key in self._known:
            return self._known[key]
        self.calls += 1
        try:
            found = self._residual(x)
        except ValidateError as error:
            if self._penalty is None:
                raise
            self.failure = " ".join(str(error).split())
            found = self._penalty
        if self._penalty is None:
            if len(found) == 0:
                raise ComparisonError(
                    "0 matched samples, so nothing can be identified; check "
                    "the clocks of the recording"
                )
            far = _OFTEN * max(1.0, float(np.sqrt(np.mean(found**2))))
            self._penalty = np.full(len(found), far)
        elif len(found) != len(self._penalty):
            raise ComparisonError(
                f"{len(self._penalty)} residuals at the start, {len(found)} later: the "
                "compared data must not depend on the identified parameters"
            )
        self._known[key] = found
        return found


class Following:
    """A Jacobian (m, q) in the directions `free` that follows the steps of an optimiser."""

    def __init__(
        self, r: CalledOnce, at: Callable[[Floats], Floats], J: Floats | None = None
    ) -> None:
        self._r, self._at = r, at
        self._J = J
        self._last: tuple[Floats, Floats] | None = None

    def residual(self, y: Floats) -> Floats:
        return self._r(self._at(y))

    def fresh(self, y: Floats) -> Floats:
        """By forward differences, into the box."""
        base = self.residual(y)
        columns = []
        for i in range(len(y)):
            h = STEP if y[i] + STEP <= 1 else -STEP
            moved = y.copy()
            moved[i] += h
            columns.append((self.residual(moved) - base) / h)
        self._J, self._last = np.stack(columns, axis=1), (y.copy(), base)
        return self._J

    def walked(self, y: Floats) -> Floats:
        """Where scipy's trust region ends."""
        found = least_squares(
            self.residual, np.clip(y, INSIDE, 1 - INSIDE), jac=self, bounds=(0.0, 1.0),
            ftol=1e-3, xtol=1e-7, gtol=1e-12, max_nfev=25,
        )  # fmt: skip
        return np.asarray(found.x)

    def __call__(self, y: Floats) -> Floats:
        r = self.residual(y)
        if self._J is None:
            return self.fresh(y)
        if self._last is not None:
            s, d = y - self._last[0], r - self._last[1]
            length = float(s @ s)
            if length > 0:
                self._J = self._J + np.outer(d - self._J @ s, s) / length
        self._last = (y.copy(), r)
        return self._J


def minimised(r: CalledOnce, at: At, y: Floats) -> tuple[Floats, Floats, bool]:
    """Where |r(at(y))|^2 is least for y (q,) in the box: y, the Jacobian there, whether it is one.

    Converged is what a Jacobian taken anew at the end promises no fall from.
    """
    follow = Following(r, at)
    for _ in range(ROUNDS):
        y = follow.walked(y)
        J = follow.fresh(y)
        ended = settled(follow.residual(y), J, y)
        if ended or r.calls > EVALUATIONS:
            break
    return y, J, ended


def followed(r: CalledOnce, at: At, y: Floats, J: Floats | None) -> tuple[Floats, Floats]:
    """As `minimised`, from near the minimum, by a Jacobian that only follows the steps: cheap."""
    follow = Following(r, at, J)
    J = follow(y)
    if not settled(follow.residual(y), J, y):
        y = follow.walked(y)
        J = follow(y)
    return y, J


def settled(r: Floats, J: Floats, y: Floats) -> bool:
    """Return whether a full step would lower |r|^2 by next to nothing, for its size."""
    spread = max(1.0, float(r @ r) / max(1, len(r) - len(y)))
    return promised(r, J, y) <= PROMISE * spread


def promised(r: Floats, J: Floats, y: Floats) -> float:
    """By how much the best step within the box would lower |r|^2, were r linear."""
    found = lsq_linear(J, -r, (np.minimum(-y, -INSIDE), np.maximum(1 - y, INSIDE)), method="bvls")
    return float(r @ r) - 2 * float(found.cost)


def fit(residual: Residual, start: Floats) -> Fit:
    """Return the minimum that one start (p,) leads to; a start where nothing can be simulated is
    none."""
    r = CalledOnce(residual)
    try:
        x, J, converged = minimised(r, lambda y: y, np.asarray(start, dtype=np.float64))
    except ValidateError as error:
        p = len(start)
        why = " ".join(str(error).split())
        return Fit(start, start, 0.0, 0, np.zeros((p, p)), r.calls, False, why)
    found = r(x)
    why = "" if converged else r.failure or f"still falling after {r.calls} evaluations"
    return Fit(start, x, float(found @ found), len(found), J.T @ J, r.calls, converged, why)


def whitened(
    values: Floats, sd: float, systematic: float, freedom: int | None = None, name: str = "residual"
) -> Floats:
    """Of values (k, c): k c numbers, component by component.

    C^(-1/2) is 1/sd across the mean of a component and 1/sqrt(sd^2 + k s^2) along it. `freedom`
    below k c counts the independent numbers: sd then grows so that they weigh no more than these.
    A sensor whose noise is not stated (`sd` 0) is taken to differ between points by as much as they
    share, which widens and never narrows. Raises `ComparisonError` where both are 0.
    """
    k, c = values.shape
    sd = systematic if sd == 0 and k > 1 else sd
    if freedom is not None and 0 < freedom < k * c:
        sd = sd * float(np.sqrt(k * c / freedom))
    along = float(np.sqrt(sd**2 + k * systematic**2))
    if along == 0:
        raise ComparisonError(
            f"{name}: {k} values with a standard deviation of {sd:g} have infinite weight; "
            "declare the noise of the sensor"
        )
    mean = values.mean(axis=0)
    across = (values - mean) / sd if k > 1 else np.zeros_like(values)
    return np.asarray((across + mean / along).ravel(order="F"))


# --- profile likelihood: chi-square with one parameter fixed and all others refitted -------------

RISE = float(chdtri(1, 0.05))  # 3.84
_WITHIN = 0.1  # of the rise: the end of an interval is found, a straight line away
_POINTS = 14  # of a side at most
_STRAIGHT = 5  # of them by straight lines, then by halves
_HALF = 0.5  # of the way, in sqrt(rise), to the first point
_LEAST = 1e-7  # of the range: no step is shorter


@dataclass(frozen=True)
class Side:
    """One side of one parameter's profile: coordinates and rises of chi-square, outwards.

    `end` is the coordinate where the interval ends; `open` where the bound was reached before.
    `x` (p,) is the lowest point seen, `lowest` its rise: below 0 where the best was none.
    """

    parameter: int
    sign: int
    at: Floats
    rise: Floats
    end: float
    open: bool
    x: Floats
    lowest: float


def side(residual: Residual, best: Fit, i: int, sign: int, scale: float = 1.0) -> Side:
    """Of parameter i from the best fit towards one bound, until `RISE` times `scale`."""
    walk = _Outwards(residual, best, i)
    bound, wanted = (1.0 if sign > 0 else 0.0), RISE * scale
    room = abs(bound - best.x[i])
    if room <= _LEAST:
        return Side(i, sign, np.empty(0), np.empty(0), bound, True, best.x, 0.0)
    at, rise = [0.0], [0.0]
    reach = min(max(walk.sd * np.sqrt(wanted), 10 * _LEAST), room)
    step = _HALF * reach
    while len(at) <= _POINTS:
        at.append(step)
        rise.append(walk.rise(best.x[i] + sign * step))
        if abs(rise[-1] - wanted) <= _WITHIN * wanted or (step >= room and rise[-1] < wanted):
            break
        # The next distance: sqrt(rise) is nearly straight; between those that hold the end, if two.
        d, r = np.array(at), np.array(rise)
        z, target = np.sqrt(np.maximum(r, 0.0)), float(np.sqrt(wanted))
        below, above = d[r < wanted], d[r >= wanted]
        if len(above) == 0:
            far, last = d.max(), z[d.argmax()]
            ahead = far * target / last if last > 0 else 2 * far
            step = float(min(max(ahead, far + 0.1 * reach), 3 * far, room))
        else:
            high = above.min()
            low = below[below < high].max()
            z_low, z_high = z[d == low][0], z[d == high][0]
            straight = z_high > z_low and len(d) <= _STRAIGHT
            share = (target - z_low) / (z_high - z_low) if straight else 0.5
            step = float(low + min(max(share, 0.05), 0.95) * (high - low))
    # Distance to the interval's end, on the line of sqrt(rise) through the two points nearest to
    # it, and whether it is only the bound. At a jump, the points on both sides.
    d, r = np.array(at), np.array(rise)
    z, target = np.sqrt(np.maximum(r, 0.0)), float(np.sqrt(wanted))
    if r.max() < (1 - _WITHIN) * wanted:
        end, is_open = room, True
    else:
        b = int(np.argmin(np.abs(r - wanted)))
        others = [k for k in range(len(d)) if z[k] != z[b]]
        if abs(r[b] - wanted) > _WITHIN * wanted:  # a jump, as where nothing can be simulated
            b = min(np.flatnonzero(r >= wanted).tolist(), key=lambda k: d[k])
            others = [k for k in range(len(d)) if r[k] < wanted and d[k] < d[b]]
        a = min(others, key=lambda k: abs(d[k] - d[b]))
        end = d[b] + (target - z[b]) * (d[b] - d[a]) / (z[b] - z[a])
        end, is_open = float(min(end, room)), bool(end > room)
    order = np.argsort(d)
    return Side(
        i, sign, best.x[i] + sign * d[order], r[order], float(best.x[i] + sign * end), is_open,
        walk.lowest[1], walk.lowest[0],
    )  # fmt: skip


class _Outwards:
    """Chi-square over the other parameters, each point starting on the line through the last."""

    def __init__(self, residual: Residual, best: Fit, i: int) -> None:
        self._r, self._best, self._i = CalledOnce(residual), best, i
        p = len(best.x)
        self._others = [j for j in range(p) if j != i]
        C = np.linalg.pinv(best.normal, rcond=1e-12)
        variance = max(float(C[i, i]), 0.0)
        self.sd = float(np.sqrt(variance)) if variance > 0 else 1.0
        slope = C[self._others, i] / variance if variance > 0 else np.zeros(p - 1)
        self._known: list[tuple[float, Floats]] = [(float(best.x[i]), best.x[self._others])]
        self._slope = slope
        self._J: Floats | None = None
        self.lowest: tuple[float, Floats] = (0.0, best.x)

    def rise(self, xi: float) -> float:
        """Of chi-square above the best, with parameter i at xi."""

        def at(y: Floats) -> Floats:
            x = np.empty(len(self._best.x))
            x[self._i], x[self._others] = xi, y
            return x

        # On the line through the nearest two points, at first on the tangent at the best.
        near = sorted(self._known, key=lambda known: abs(known[0] - xi))
        (a, ya) = near[0]
        if len(near) == 1:
            y = np.clip(ya + self._slope * (xi - a), 0.0, 1.0)
        else:
            b, yb = near[1]
            y = np.clip(ya + (yb - ya) * (xi - a) / (b - a), 0.0, 1.0)
        if self._others:
            y, self._J = followed(self._r, at, y, self._J)
        found = self._r(at(y))
        rise = float(found @ found) - self._best.chi_square
        self._known.append((xi, y))
        if rise < self.lowest[0]:
            self.lowest = rise, at(y)
        return rise
