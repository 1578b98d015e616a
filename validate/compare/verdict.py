"""Verdicts after ASME V&V 20: is the error within the uncertainty of the comparison?

E = simulation - measurement, u_val^2 = u_D^2 + u_num^2 + u_input^2 (standard uncertainties).
|E| > 2 u_val: differs; else 2 u_val above the accepted limit: cannot decide; else agrees.

An rms over many noisy points is not zero for a perfect model. E is then the part that noise does
not explain, sqrt(rms^2 - noise^2), and u_D half of the smallest such part that noise alone reaches
in 5 % of repetitions (chi-square with one degree of freedom per number compared).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import rms
from validate.compare.numerical import Numerical
from validate.compare.residual import Residual
from validate.estimate.consistency import chi_square_quantile

Verdict = Literal["agrees", "differs", "cannot decide"]

# The name of the part of u_val that a filter itself claims.
OWN_COVARIANCE = "the filter's own covariance"
_OTHERWISE = {
    OWN_COVARIANCE: "a filter that is surer of its estimate",
    "mesh": "a finer mesh",
    "time step": "a shorter time step",
}


@dataclass(frozen=True)
class Accept:
    """A quantity the accepted methods must predict to `limit` (SI), at `loads` (none: all)."""

    quantity: str
    limit: float
    source: str
    loads: tuple[str, ...] = ()


@dataclass(frozen=True)
class Check:
    """A verdict: error `value`, `limit`, `u_val` and its parts, in `unit`; points compared.

    u_num and u_val are infinite where nothing bounds them; `numerical` says how u_num was found.
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
    numerical: str = ""

    @property
    def holds(self) -> bool:
        return self.verdict == "agrees"


@dataclass(frozen=True)
class Sensitivity:
    """What one input does to a residual: `change`, times `scale` one standard uncertainty."""

    name: str
    change: Residual
    scale: float


def judge(
    residual: Residual,
    limit: float,
    numerical: Numerical,
    inputs: Sequence[Sensitivity],
) -> Check:
    """The verdict on one residual; where nothing bounds u_num it cannot be decided."""
    E, u_D = error_and_noise(residual)
    u_num = numerical.u
    parts = {s.name: abs(s.scale) * rms(s.change.values) for s in inputs}
    u_input = float(np.sqrt(sum(p**2 for p in parts.values())))
    u_val = float(np.sqrt(u_D**2 + u_num**2 + u_input**2))
    named = {"measurement": u_D} | dict(numerical.parts) | parts
    verdict, why = _verdict(E, u_val, limit, named, numerical.words)
    name = residual.name if _scalar(residual) else f"{residual.quantity}.rms@{residual.load}"
    return Check(
        name, E, limit, u_val, u_D, u_num, u_input, residual.unit, residual.count, verdict, why,
        numerical.words,
    )  # fmt: skip


def error_and_noise(residual: Residual) -> tuple[float, float]:
    """E and u_D of a residual; see the module's head for E of many points."""
    k, c = residual.values.shape
    if k == 1 and c == 1:
        return float(residual.values[0, 0]), float(np.hypot(residual.sd, residual.systematic))
    noise = c * residual.sd**2
    E = np.sqrt(max(rms(residual.values) ** 2 - noise, 0.0))
    reach = np.sqrt(max(noise * (float(chi_square_quantile(0.95, k * c)) / (k * c) - 1), 0.0))
    return float(E), float(np.hypot(reach / 2, np.sqrt(c) * residual.systematic))


def _verdict(
    E: float, u_val: float, limit: float, parts: dict[str, float], numerical: str
) -> tuple[Verdict, str]:
    if math.isinf(u_val):
        return "cannot decide", numerical
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
