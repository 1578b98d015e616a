"""Closed-form fit of a modulus: scale of a law's unit curve, and the start of its load.

A law whose force is proportional to its modulus needs one solution with a unit modulus: the
modulus is the scale that fits the measured force, a linear least-squares problem. Where the load
begins is a second parameter of a testing-machine log (the toe), found by Gauss-Newton.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, sqrt

import numpy as np
from scipy.interpolate import CubicSpline

from validate.arrays import Floats
from validate.errors import ComparisonError, ValidateError
from validate.identify.budget import dependence
from validate.identify.least_squares import RISE, Fit, Residual, Side, Space

# --- Closed form of an identification: one parameter that the residual is linear in.
#
# Chi-square is then a parabola in the parameter, with one minimum: no other start can find
# another, and the ends of the profile interval follow from its curvature. Linearity is checked,
# not assumed: three evaluations across the range lie on a line, and a fourth at the minimum on
# the same.

_AT = (0.25, 0.5, 0.75)  # coordinates
_LINE = 1e-4  # relative, of what the parameter changes: solvers converge to less
_MINIMUM = 1e-3  # of the residual's length, which is one or more
_POINTS = 8  # of a side that charts show


def linear_fit(residual: Residual, space: Space) -> Fit:
    """Return the minimum of a residual that is linear in the one parameter of a space.

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


# -------------------------------------------------------------------------------------------------

_STEPS = 50  # of Gauss-Newton, or of a law that is not proportional
_HALVINGS = 12
_CONVERGED = 1e-10  # relative
PROPORTIONAL = 1e-6  # relative difference of two curves over their moduli


@dataclass(frozen=True)
class UnitCurve:
    """Force (n,) N at displacements d (n,) m, from (0, 0), over the modulus `E` Pa it was solved
    with; a cubic spline between and beyond, and nothing before the load begins."""

    d: Floats
    force: Floats
    E: float = 1.0

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.d, self.force / self.E)

    def __call__(self, d: Floats) -> Floats:
        return np.asarray(self._spline(np.maximum(d, 0.0)))

    def slope(self, d: Floats) -> Floats:
        return np.where(d > 0, self._spline(d, 1), 0.0)

    def scaled(self, force: float = 1.0, displacement: float = 1.0) -> "UnitCurve":
        """Return the curve with both axes stretched."""
        return replace(self, d=displacement * self.d, force=force * self.force)

    @property
    def coarser(self) -> "UnitCurve | None":
        """Every second point, for the error of interpolation; None for fewer than seven."""
        return replace(self, d=self.d[::2], force=self.force[::2]) if len(self.d) >= 7 else None


@dataclass(frozen=True)
class ScaledFit:
    """force = scale * curve(d - shift) + residual.

    `noise` is the sd of one sample, `dependence` how many samples count as one. `covariance` (2, 2)
    of scale and shift; its second row is zero where no shift was fitted.
    """

    scale: float
    shift: float
    covariance: Floats
    residual: Floats
    noise: float
    dependence: float
    freedom: float

    @property
    def sd(self) -> float:
        """Of the scale, with the shift free."""
        return sqrt(self.covariance[0, 0])

    @property
    def along_shift(self) -> float:
        """How the scale moves with one sd of the shift; its unit."""
        sd = self.shift_sd
        return float(self.covariance[0, 1]) / sd if sd else 0.0

    @property
    def shift_sd(self) -> float:
        return sqrt(self.covariance[1, 1])

    @property
    def alone(self) -> float:
        """The sd of the scale at a known shift."""
        return sqrt(max(float(self.covariance[0, 0]) - self.along_shift**2, 0.0))


def fit_scaled(
    curve: UnitCurve,
    d: Floats,
    force: Floats,
    *,
    sd: float = 0.0,
    shifted: bool = False,
    start: float = 0.0,
) -> ScaledFit:
    """Return the scale, and where `shifted` the shift, by least squares over n samples; `start` m
    is where the search for the shift begins.

    The sd of a sample is what the residuals show, or `sd` (N, of the sensor) where that is larger.
    Raises `ComparisonError` for fewer samples than parameters and one, for a curve that is zero,
    and for a scale that is not positive.
    """
    p = 2 if shifted else 1
    if len(d) <= p:
        raise ComparisonError(f"{len(d)} samples of force to fit {p} parameters to; record more")

    def left(at: float) -> tuple[float, float]:
        """Sum of squares and scale at this shift."""
        scale = _scale(curve, d - at, force)
        off = force - scale * curve(d - at)
        return float(off @ off), scale

    # Gauss-Newton with the scale eliminated, steps halved while they worsen.
    shift = start if shifted else 0.0
    square, scale = left(shift)
    for _ in range(_STEPS if shifted else 0):
        J = np.stack([curve(d - shift), -scale * curve.slope(d - shift)], axis=1)
        size = np.linalg.norm(J, axis=0)
        step = float(np.linalg.lstsq(J / size, force - scale * J[:, 0], rcond=None)[0][1] / size[1])
        for _ in range(_HALVINGS):
            there, other = left(shift + step)
            if there <= square:
                break
            step /= 2
        else:
            break
        shift, scale, square = shift + step, other, there
        if abs(step) <= _CONVERGED * np.ptp(d):
            break
    if not scale > 0:
        raise ComparisonError(
            f"the force fitted over {len(d)} samples falls as the load rises (scale {scale:.3g}); "
            "check sign and unit of the force"
        )
    f = curve(d - shift)
    J = np.stack([f, -scale * curve.slope(d - shift)], axis=1)[:, :p]
    return _fitted(J, scale, shift, force - scale * f, sd)


def _fitted(J: Floats, scale: float, shift: float, residual: Floats, sd: float) -> ScaledFit:
    """The fit with its covariance, from the derivatives J (n, p) by what was fitted."""
    n, p = J.shape
    times = dependence(residual)
    freedom = max(n / times - p, 1.0)
    seen = sqrt(float(residual @ residual) / (n - p))
    noise = max(seen, sd)
    covariance = np.zeros((2, 2))
    # Modulus and shift differ by many orders of magnitude: unit columns before the inverse.
    size = np.linalg.norm(J, axis=0)
    covariance[:p, :p] = noise**2 * times * np.linalg.pinv((J / size).T @ (J / size))
    covariance[:p, :p] /= np.outer(size, size)
    return ScaledFit(
        scale, shift, covariance, residual, noise, times, inf if sd > seen else freedom
    )


def fit_proportional(f: Floats, force: Floats, *, sd: float = 0.0) -> ScaledFit:
    """Return the scale of f (n,), the force of a unit modulus, that fits `force` (n,) N.

    Raises what `fit_scaled` does.
    """
    if len(f) < 2:
        raise ComparisonError(f"{len(f)} samples of force to fit a modulus to; record more")
    scale = _scale_of(f, force)
    if not scale > 0:
        raise ComparisonError(
            f"the force fitted over {len(f)} samples falls as the load rises (scale {scale:.3g}); "
            "check sign and unit of the force"
        )
    return _fitted(f[:, None], scale, 0.0, force - scale * f, sd)


def _scale(curve: UnitCurve, d: Floats, force: Floats) -> float:
    return _scale_of(curve(d), force)


def _scale_of(f: Floats, force: Floats) -> float:
    weight = float(f @ f)
    if weight == 0 or not np.isfinite(weight):
        raise ComparisonError(f"the model's force at unit modulus is 0 N over {len(f)} samples")
    return float(f @ force) / weight


def fit_modulus_of(
    curve_of: Callable[[float], UnitCurve],
    fit: Callable[[UnitCurve], ScaledFit],
    E: float,
) -> tuple[UnitCurve, ScaledFit, int]:
    """Return the curve, its fit, and the number of solutions, from a first modulus `E`.

    A second solution at the modulus found checks whether force is proportional to it: then the
    closed form stands. Otherwise the fit is repeated at each modulus found. Raises
    `ComparisonError` where that does not settle.
    """
    curve = curve_of(E)
    found = fit(curve)
    for solutions in range(2, _STEPS):
        again = curve_of(found.scale)
        off = np.abs(again(again.d) - curve(again.d)).max()
        if off <= PROPORTIONAL * np.abs(again.force / again.E).max():
            return curve, found, solutions
        before, curve = found.scale, again
        found = fit(curve)
        if abs(found.scale - before) <= PROPORTIONAL * before:
            return curve, found, solutions
    raise ComparisonError(
        f"the modulus does not converge after {_STEPS} solutions (last {found.scale:.4g} Pa): "
        "the coefficients of the law contribute more force than the modulus; set material.E"
    )
