"""Closed form of an identification: one parameter that the residual is linear in.

Chi-square is then a parabola in the parameter, with one minimum: no other start can find another,
and the ends of the profile interval follow from its curvature. Linearity is checked, not assumed:
three evaluations across the range lie on a line, and a fourth at the minimum on the same.
"""

import numpy as np

from validate.errors import ValidateError
from validate.identify.least_squares import Fit, Residual
from validate.identify.profile import RISE, Side
from validate.identify.space import Space

_AT = (0.25, 0.5, 0.75)  # coordinates
_LINE = 1e-4  # relative, of what the parameter changes: solvers converge to less
_MINIMUM = 1e-3  # of the residual's length, which is one or more
_POINTS = 8  # of a side that charts show


def linear_fit(residual: Residual, space: Space) -> Fit:
    """The minimum of a residual that is linear in the one parameter of a space.

    One that is not linear, that cannot be evaluated across the range, or whose minimum lies outside
    of it has not converged, and `why` says so.
    """
    middle, calls = np.array([0.5]), 0
    if len(space.ranges) != 1:
        return _none(middle, calls, "several parameters")
    try:
        values = [space.value(0, x) for x in _AT]
        found = [np.asarray(residual(np.array([x]))) for x in _AT]
        calls = len(_AT)
        if len({len(r) for r in found}) > 1:
            return _none(middle, calls, "the compared data depend on it")
        slope = (found[2] - found[0]) / (values[2] - values[0])
        square = float(slope @ slope)
        off = found[1] - found[0] - slope * (values[1] - values[0])
        if square == 0 or np.linalg.norm(off) > _LINE * np.sqrt(square) * abs(values[1]):
            return _none(middle, calls, "the residual is not linear in it")
        best = values[1] - float(slope @ found[1]) / square
        r = space.ranges[0]
        if not r.low < best < r.high:
            return _none(middle, calls, "the minimum lies outside the range")
        x = space.coordinates([best])
        ended = np.asarray(residual(x))
    except ValidateError as error:
        return _none(middle, calls, " ".join(str(error).split()))
    line = found[1] + slope * (best - values[1])
    length = max(1.0, float(np.linalg.norm(ended)))
    if np.linalg.norm(ended - line) > _MINIMUM * length:
        return _none(middle, calls + 1, "the residual is not linear in it")
    normal = np.array([[square * space.slope(0, float(x[0])) ** 2]])
    return Fit(x, x, float(ended @ ended), len(ended), normal, calls + 1, True)


def _none(x: np.ndarray[tuple[int], np.dtype[np.float64]], calls: int, why: str) -> Fit:
    return Fit(x, x, 0.0, 0, np.zeros((1, 1)), calls, False, why)


def linear_side(best: Fit, space: Space, sign: int, scale: float) -> Side:
    """One side of the profile about the minimum of a linear residual."""
    r, value = space.ranges[0], space.value(0, float(best.x[0]))
    square = float(best.normal[0, 0]) / space.slope(0, float(best.x[0])) ** 2
    reach = float(np.sqrt(RISE * scale / square))
    bound = r.high if sign > 0 else r.low
    room = abs(bound - value)
    way = np.linspace(0.0, min(reach, room), _POINTS)
    at = np.array([space.coordinates([value + sign * w])[0] for w in way])
    end = float(at[-1]) if reach < room else (1.0 if sign > 0 else 0.0)
    return Side(0, sign, at, square * way**2, end, reach > room, best.x, 0.0)
