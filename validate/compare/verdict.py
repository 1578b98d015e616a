"""Verdicts after ASME V&V 20: is the error within the uncertainty of the comparison?

E = simulation - measurement, u_val^2 = u_D^2 + u_num^2 + u_input^2 (standard uncertainties).
|E| > 2 u_val: differs; else 2 u_val above the accepted limit: cannot decide; else agrees. A limit
as wide as all that was measured decides nothing either.

An rms over many noisy points is not zero for a perfect model. E is then the part that noise does
not explain, sqrt(rms^2 - noise^2), and u_D half of the smallest such part that noise alone reaches
in 5 % of repetitions (chi-square with a degree of freedom per independent number). It has the sign
of the mean where points have one component, and none where they have more.

Only what validates is evidence: data that calibrated the model are "fitted" and a model judged by
its own recording "repeats itself"; neither agrees, whatever its error.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import ndtr

from validate.arrays import rms
from validate.compare.convergence import Numerical
from validate.compare.residual import Residual
from validate.compare.sizes import Size, kind_of, size_of
from validate.errors import ComparisonError
from validate.estimate.consistency import chi_square_quantile

Verdict = Literal["agrees", "differs", "cannot decide", "fitted", "repeats itself"]

# The name of the part of u_val that a filter itself claims.
OWN_COVARIANCE = "the filter's own covariance"
_OTHERWISE = {
    OWN_COVARIANCE: "a filter that is surer of its estimate",
    "mesh": "a finer mesh",
    "time step": "a shorter time step",
}


@dataclass(frozen=True)
class Accept:
    """A quantity the accepted methods must predict to `limit` (SI), at `loads` (none: all).

    Raises `ComparisonError` for a limit that is not a positive number.
    """

    quantity: str
    limit: float
    source: str
    loads: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.limit < math.inf:
            raise ComparisonError(
                f"accept '{self.quantity}': limit {self.limit:g} is not a positive number"
            )


@dataclass(frozen=True)
class Check:
    """A verdict: error `value`, `limit`, `u_val` and its parts, in `unit`; points compared.

    u_num and u_val are infinite where nothing bounds them; `numerical` says how u_num was found.
    `raw` is the rms as it is, `noise` what the measurement's noise alone explains of it. `kind` is
    what was measured, and `size` how large it was, measured and simulated; None: of nothing that
    has a zero.
    """

    name: str
    value: float
    limit: float
    u_val: float
    u_D: float
    u_num: float
    u_input: float
    unit: str
    count: int
    verdict: Verdict
    why: str
    raw: float = 0.0
    noise: float = 0.0
    numerical: str = ""
    kind: str = ""
    size: Size | None = None

    @property
    def evidence(self) -> bool:
        """Whether it decides anything about the model."""
        return self.verdict in ("agrees", "differs")

    @property
    def p_value(self) -> float:
        """How often a perfect model would show an error as large, by a normal law of u_val."""
        if self.u_val == 0:
            return 1.0 if self.value == 0 else 0.0
        return 2 * float(ndtr(-abs(self.value) / self.u_val))


def as_fitted(check: Check, by: str) -> Check:
    """A check on data that calibrated the model counts for nothing, whatever its error."""
    if not check.count:
        return check
    return replace(check, verdict="fitted", why=f"{by}: no evidence; {check.why}")


def as_repeated(check: Check, why: str) -> Check:
    """A model judged by its own recording cannot agree; an error or a doubt of it stays."""
    if check.verdict != "agrees":
        return check
    return replace(check, verdict="repeats itself", why=f"{why}: no evidence; {check.why}")


@dataclass(frozen=True)
class Sensitivity:
    """What one standard uncertainty of an input does to a residual."""

    name: str
    change: Residual


def judge(
    residual: Residual,
    limit: float,
    numerical: Numerical,
    inputs: Sequence[Sensitivity],
) -> Check:
    """The verdict on one residual; where nothing bounds u_num it cannot be decided."""
    seen = error_of(residual)
    E, u_D = seen.E, seen.u_D
    u_num = numerical.u
    parts = {s.name: rms(s.change.values) for s in inputs}
    u_input = float(np.sqrt(sum(p**2 for p in parts.values())))
    u_val = float(np.sqrt(u_D**2 + u_num**2 + u_input**2))
    named = {"measurement": u_D} | dict(numerical.parts) | parts
    verdict, why = _verdict(E, u_val, limit, named, numerical)
    if verdict == "agrees" and residual.scale is not None and limit >= residual.scale:
        verdict, why = (
            "cannot decide",
            (
                f"the limit {limit:.3g} is as wide as the largest that was measured, "
                f"{residual.scale:.3g}: nothing could fail it; accept a tighter one"
            ),
        )
    name = residual.name if _scalar(residual) else f"{residual.quantity}.rms@{residual.load}"
    return Check(
        name, E, limit, u_val, u_D, u_num, u_input, residual.unit, residual.count, verdict, why,
        seen.raw, seen.noise, numerical.words, kind_of(residual.quantity, residual.unit),
        size_of(residual),
    )  # fmt: skip


@dataclass(frozen=True)
class Error:
    """E and u_D of a residual, its rms as it is, and the rms that its noise alone would have."""

    E: float
    u_D: float
    raw: float
    noise: float


def error_of(residual: Residual) -> Error:
    """The error of a residual; see the module's head for E of many points."""
    k, c = residual.values.shape
    raw, noise = rms(residual.values), float(np.sqrt(c) * residual.sd)
    if k == 1 and c == 1:
        u_D = float(np.hypot(residual.sd, residual.systematic))
        return Error(float(residual.values[0, 0]), u_D, raw, noise)
    sign = np.copysign(1.0, residual.values.mean()) if c == 1 else 1.0
    E = sign * np.sqrt(max(raw**2 - noise**2, 0.0))
    m = residual.freedom or k * c
    reach = noise * np.sqrt(max(float(chi_square_quantile(0.95, m)) / m - 1, 0.0))
    u_D = float(np.hypot(reach / 2, np.sqrt(c) * residual.systematic))
    return Error(float(E) + 0.0, u_D, raw, noise)  # no -0


def _verdict(
    E: float, u_val: float, limit: float, parts: dict[str, float], numerical: Numerical
) -> tuple[Verdict, str]:
    if math.isinf(numerical.u):
        return "cannot decide", numerical.words
    holes = [name for name, u in {"E": E, "limit": limit, **parts}.items() if not math.isfinite(u)]
    if holes or not math.isfinite(u_val):
        return "cannot decide", f"not a finite number: {', '.join(holes) or 'u_val'}"
    largest = max(parts, key=lambda name: parts[name])
    if abs(E) > 2 * u_val:
        return "differs", f"|E| is {abs(E) / u_val:.1f} u_val" if u_val else "u_val is zero"
    if 2 * u_val > limit:
        return "cannot decide", (
            f"2 u_val = {2 * u_val:.3g} exceeds the limit {limit:.3g}; {_better(largest)} would "
            "decide"
        )
    if u_val == 0:
        return "agrees", "the error is exactly zero, and so is u_val"
    blunt = abs(E) / parts["measurement"] if parts["measurement"] else 0.0
    beyond = f" but {blunt:.0f} times u_D" if blunt > 5 else ""
    return "agrees", f"|E| is {abs(E) / u_val:.1f} u_val{beyond}; largest part: {largest}"


def _better(part: str) -> str:
    """What would make a part of u_val smaller."""
    return _OTHERWISE.get(part, f"a better measurement of '{part}'")


def _scalar(residual: Residual) -> bool:
    return residual.values.shape == (1, 1)
