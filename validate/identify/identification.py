"""Identification result: values, 95 % intervals, correlations, unidentifiable parameters.

`identify` asks for fits from seeded starts, then for both sides of every parameter's profile;
whoever evaluates them may do so side by side. "Not identifiable" is a result: an interval wider
than a factor 2 (for what may be 0 or less: than half of the range searched), an optimum at a bound,
or starts that end elsewhere and fit as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Protocol

import numpy as np
from scipy.special import chdtri

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.identify.least_squares import RISE, Fit, Residual, Side, Space, fit, side
from validate.identify.scaled_curve import linear_fit, linear_side

FACTOR = 2.0  # between the ends of an interval: wider is not identified
SHARE = 0.5  # of the range searched, where a factor says nothing
_FITS = 0.99  # of chi-square: a misfit beyond it is no chance
_EDGE = 1e-3  # of the range: an optimum at a bound
_LOWER = 0.05  # of chi-square, times the misfit: a profile that falls by more found a better best
_AGAIN = 3
_UNIFORM = 12.0  # 1 / variance of what is only known to lie in the range searched


class Evaluates(Protocol):
    """The closed form of one parameter, fits from starts (n, p), and sides (parameter, sign) of
    profiles about the best one."""

    def linear(self, space: Space) -> Fit: ...

    def fits(self, starts: Floats) -> Sequence[Fit]: ...

    def sides(
        self, best: Fit, wanted: Sequence[tuple[int, int]], scale: float
    ) -> Sequence[Side]: ...


@dataclass(frozen=True)
class InTurn:
    """Evaluates in this process, one after the other."""

    residual: Residual

    def linear(self, space: Space) -> Fit:
        return linear_fit(self.residual, space)

    def fits(self, starts: Floats) -> Sequence[Fit]:
        return [fit(self.residual, start) for start in starts]

    def sides(self, best: Fit, wanted: Sequence[tuple[int, int]], scale: float) -> Sequence[Side]:
        return [side(self.residual, best, i, sign, scale) for i, sign in wanted]


@dataclass(frozen=True)
class Profiled:
    """A parameter's best `value` and 95 % profile interval, in its own unit; `sd` of its value.

    `low_open`, `high_open`: that end is only the bound searched. `at`, `rise`: its profile, values
    and rises of chi-square over the misfit. `findings` say why it is not identifiable, if so.
    """

    name: str
    value: float
    low: float
    high: float
    sd: float
    low_open: bool
    high_open: bool
    at: tuple[float, ...]
    rise: tuple[float, ...]
    findings: tuple[str, ...]

    @property
    def identified(self) -> bool:
        return not self.findings


@dataclass(frozen=True)
class Identification:
    """The best fit of all starts with its profiles, two sides a parameter.

    `misfit` is chi-square per degree of freedom where that is more than chance, else 1: intervals
    and covariance are wider by its root. `linear`: the residual is linear in the one parameter, so
    that the best fit is known in closed form and no other start is needed.
    """

    space: Space
    fits: tuple[Fit, ...]
    best: Fit
    sides: tuple[Side, ...]
    misfit: float
    linear: bool = False

    @cached_property
    def covariance(self) -> Floats:
        """(p, p) of the coordinates, within the range searched: J^T J and a uniform law of it."""
        return np.asarray(
            np.linalg.inv(self.best.normal / self.misfit + _UNIFORM * np.eye(len(self.best.x)))
        )

    @property
    def correlations(self) -> Floats:
        """(p, p) of the estimates."""
        sd = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(sd, sd))

    @cached_property
    def estimates(self) -> tuple[Profiled, ...]:
        return tuple(self._estimate(i) for i in range(len(self.space.ranges)))

    @property
    def converged(self) -> int:
        return sum(f.converged for f in self.fits)

    @property
    def found_again(self) -> int:
        """Starts that ended as low as the best."""
        return sum(self._as_good(f) for f in self.fits)

    def _as_good(self, f: Fit) -> bool:
        return f.converged and f.chi_square <= self.best.chi_square + RISE * self.misfit

    def _estimate(self, i: int) -> Profiled:
        below, above = (next(s for s in self.sides if (s.parameter, s.sign) == (i, k))
                        for k in (-1, 1))  # fmt: skip
        value, low, high = (self.space.value(i, x) for x in (self.best.x[i], below.end, above.end))
        at, rise = (np.concatenate([getattr(s, part) for s in (below, above)])
                    for part in ("at", "rise"))  # fmt: skip
        at, first = np.unique(at, return_index=True)
        sd = abs(self.space.slope(i, float(self.best.x[i]))) * float(np.sqrt(self.covariance[i, i]))
        bare = Profiled(
            self.space.names[i], value, low, high, sd, below.open, above.open,
            tuple(self.space.value(i, float(x)) for x in at),
            tuple((rise[first] / self.misfit).tolist()), (),
        )  # fmt: skip
        r, x = self.space.ranges[i], self.best.x[i]
        findings = []
        if bare.low_open and bare.high_open:
            findings.append("its 95 % interval is the whole range searched")
        elif r.low > 0:
            if high / low > FACTOR:
                findings.append(f"its 95 % interval spans a factor {high / low:.3g}")
        elif (share := (high - low) / (r.high - r.low)) > SHARE:
            findings.append(f"its 95 % interval spans {100 * share:.0f} % of the range searched")
        if not _EDGE < x < 1 - _EDGE:
            bound = r.low if x <= _EDGE else r.high
            findings.append(f"the optimum lies at a bound, {bound:.6g}")
        others = [
            f for f in self.fits
            if self._as_good(f) and not below.end - _EDGE <= f.x[i] <= above.end + _EDGE
        ]  # fmt: skip
        if others:
            ends = ", ".join(f"{self.space.value(i, float(f.x[i])):.4g}" for f in others[:3])
            findings.append(
                f"{len(others)} of {len(self.fits)} starts end at other values with an equally "
                f"good fit: {ends}"
            )
        return Profiled(**{**vars(bare), "findings": tuple(findings)})


def identify(space: Space, evaluates: Evaluates, starts: int = 10, seed: int = 1) -> Identification:
    """Return the identification from so many seeded starts, with a profile of every parameter; in
    closed form where the residual is linear in the only one.

    Raises `ComparisonError` when no start converges, or fewer residuals than parameters are there.
    """
    if len(space.ranges) == 1 and (found := evaluates.linear(space)).converged:
        scale = misfit(best_of((found,), space))
        sides = tuple(linear_side(found, space, sign, scale) for sign in (-1, 1))
        return Identification(space, (found,), found, sides, scale, linear=True)
    fits = tuple(evaluates.fits(space.starts(starts, seed)))
    best = best_of(fits, space)
    wanted = tuple(product(range(len(space.ranges)), (-1, 1)))
    for _ in range(_AGAIN):
        scale = misfit(best)
        sides = tuple(evaluates.sides(best, wanted, scale))
        lower = min(sides, key=lambda s: s.lowest)
        if lower.lowest >= -_LOWER * scale:
            break
        fits = (*fits, *evaluates.fits(lower.x[None, :]))
        best = best_of(fits, space)
    return Identification(space, fits, best, sides, misfit(best))


def misfit(best: Fit) -> float:
    """Chi-square per degree of freedom where that is hardly chance; else 1."""
    if best.freedom < 1 or best.chi_square <= float(chdtri(best.freedom, 1 - _FITS)):
        return 1.0
    return best.chi_square / best.freedom


def best_of(fits: Sequence[Fit], space: Space) -> Fit:
    """Return the lowest of those that converged; raises `ComparisonError` where none has."""
    ended = [f for f in fits if f.converged]
    if not ended:
        least = min(fits, key=lambda f: (f.count == 0, f.chi_square))
        if least.count == 0:
            raise ComparisonError(least.why)
        raise ComparisonError(
            f"{', '.join(space.names)}: none of {len(fits)} starts converged (lowest "
            f"chi-square {least.chi_square:.4g} over {least.count} residuals; {least.why}); "
            "search narrower bounds, or check whether these residuals depend on them"
        )
    best = min(ended, key=lambda f: f.chi_square)
    if best.count < len(space.ranges):
        raise ComparisonError(
            f"{best.count} residuals for {len(space.ranges)} parameters "
            f"({', '.join(space.names)}): expected at least as many residuals as parameters; "
            "name more quantities or fewer parameters"
        )
    return best
