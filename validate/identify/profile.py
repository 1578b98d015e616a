"""Profile likelihood: chi-square with one parameter fixed and all others refitted.

Where it has risen by the 95 % point of chi-square with one degree of freedom (3.84, times the
misfit where the model does not fit) lies the end of the interval: the likelihood ratio's. It is
found from the best point outwards, each point starting from the one before.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from validate.arrays import Floats
from validate.identify.least_squares import CalledOnce, Fit, Residual, followed

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
        step = _next(np.array(at), np.array(rise), wanted, reach, room)
    end, is_open = _end(np.array(at), np.array(rise), wanted, room)
    order = np.argsort(at)
    return Side(
        i, sign, best.x[i] + sign * np.array(at)[order], np.array(rise)[order],
        float(best.x[i] + sign * end), is_open, walk.lowest[1], walk.lowest[0],
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


def _next(at: Floats, rise: Floats, wanted: float, reach: float, room: float) -> float:
    """The next distance: sqrt(rise) is nearly straight; between those that hold the end, if two."""
    z, target = np.sqrt(np.maximum(rise, 0.0)), np.sqrt(wanted)
    below, above = at[rise < wanted], at[rise >= wanted]
    if len(above) == 0:
        far = at.max()
        last = z[at == far][0]
        ahead = far * target / last if last > 0 else 2 * far
        return float(min(max(ahead, far + 0.1 * reach), 3 * far, room))
    a = below[below < above.min()].max()
    b = above.min()
    za, zb = z[at == a][0], z[at == b][0]
    straight = zb > za and len(at) <= _STRAIGHT
    share = (target - za) / (zb - za) if straight else 0.5
    return float(a + min(max(share, 0.05), 0.95) * (b - a))


def _end(at: Floats, rise: Floats, wanted: float, room: float) -> tuple[float, bool]:
    """Distance to the interval's end, on the line of sqrt(rise) through the two points nearest to
    it, and whether it is only the bound. At a jump, the points on both sides."""
    z, target = np.sqrt(np.maximum(rise, 0.0)), float(np.sqrt(wanted))
    if rise.max() < (1 - _WITHIN) * wanted:
        return room, True
    b = int(np.argmin(np.abs(rise - wanted)))
    others = [k for k in range(len(at)) if z[k] != z[b]]
    if abs(rise[b] - wanted) > _WITHIN * wanted:  # a jump, as where nothing can be simulated
        b = min(np.flatnonzero(rise >= wanted).tolist(), key=lambda k: at[k])
        others = [k for k in range(len(at)) if rise[k] < wanted and at[k] < at[b]]
    a = min(others, key=lambda k: abs(at[k] - at[b]))
    end = at[b] + (target - z[b]) * (at[b] - at[a]) / (z[b] - z[a])
    return float(min(end, room)), bool(end > room)
