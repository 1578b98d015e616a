"""Verdict of a check: does the error differ from zero, and is it good enough?

E = simulation - measurement, u_val^2 = u_D^2 + u_num^2 + u_input^2 (standard uncertainties).

*Validation* (ASME V&V 20-2009): the model error lies in E +- 2 u_val. It **differs** from zero, or
it is **not distinguishable** from zero.

*Acceptance* (ASME V&V 10-2019, V&V 40-2018): the interval against a requirement, [-limit, limit]:
**good enough** (wholly inside), **not good enough** (wholly outside), **undecided** (it straddles a
limit). A limit without a written reason is no requirement; then only validation is answered.

One number is signed. Of many points or times every one is held against the limit, and the worst
decides: the E and u_val shown are those of the point where |E| + 2 u_val is largest. All points are
good enough where each one is (an intersection-union test needs no correction, Berger 1982).
"Differs" and "not good enough" hold where one point alone is beyond what noise shows somewhere
among that many: the distribution of the largest of as many as are independent, with what all share.

Where the requirement is an rms, E = sqrt(rms^2 - noise^2) estimates the rms of the model error
itself, and u_D is half of the wider side of its 95 % interval, from the noncentral chi-square
distribution of the squared rms: noise is counted once.

Data that calibrated the model are *fitted*, and a recording of the judged model itself is the *same
model*: neither is evidence.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.polynomial.hermite_e import hermegauss
from scipy.special import chdtri, chndtr, chndtrinc, ndtr

from validate.arrays import Floats, rms
from validate.compare.bias import Size, kind_of, size_of
from validate.compare.convergence import Numerical
from validate.compare.residual import Residual
from validate.errors import ComparisonError
from validate.numbers import text, with_unit

NO_EVIDENCE = ("fitted", "same model")
Validation = Literal[
    "differs", "not distinguishable", "no answer", "nothing compared", "fitted", "same model"
]
Acceptance = Literal[
    "good enough", "not good enough", "undecided", "no requirement", "nothing compared", "fitted",
    "same model",
]  # fmt: skip
Statistic = Literal["every", "rms", "mean"]
Origin = Literal["ours", "source"]

_DROWNED = 30.0  # a shift so many times the noise: then it alone decides
ALPHA = 2 * float(ndtr(-2.0))  # 4.6 %: two standard uncertainties of a normal law to both sides
# The name of the part of u_val that a filter itself claims.
OWN_COVARIANCE = "the covariance of the filter"
_SMALLER = {
    OWN_COVARIANCE: "a filter with a smaller covariance",
    "mesh": "a finer mesh",
    "time step": "a shorter time step",
}
_STATISTICS: Mapping[Statistic, str] = {"every": "max", "rms": "rms", "mean": "mean"}


@dataclass(frozen=True)
class Accept:
    """A quantity that the accepted methods must predict to `limit` (SI), at `loads` (none: all).

    `reason` says why this limit: without one, or without a limit, nothing is required and only
    validation is answered. `origin` tells a cited reason from our own choice. `statistic` says what
    is judged of many points or times: every one, their rms, or their mean.

    Raises `ComparisonError` for a limit that is not a positive number, and for a requirement
    without a quantity.
    """

    quantity: str
    limit: float | None = None
    reason: str = ""
    loads: tuple[str, ...] = ()
    statistic: Statistic = "every"
    origin: Origin = "ours"

    def __post_init__(self) -> None:
        if self.limit is not None and not 0 < self.limit < math.inf:
            raise ComparisonError(
                f"accept '{self.quantity}': limit {self.limit:g}: expected a positive number"
            )
        if self.statistic not in _STATISTICS:
            raise ComparisonError(
                f"accept '{self.quantity}': statistic '{self.statistic}'; expected one of "
                f"{', '.join(_STATISTICS)}"
            )

    @property
    def required(self) -> float | None:
        """The limit, where a reason is written for it."""
        return self.limit if self.reason.strip() else None

    @property
    def why(self) -> str:
        """The reason with its origin; what is missing where there is none."""
        if self.required is not None:
            return f"{self.origin}: {self.reason}"
        return (
            "no requirement: the limit has no reason; give one"
            if self.limit
            else ("no requirement")
        )


@dataclass(frozen=True)
class Check:
    """Both answers about one quantity: E is `value`, with `u_val` and its parts, in `unit`.

    `limit` is None without a requirement; `requirement` says why this limit. `margin` is what is
    left of the limit beyond |E| + 2 u_val. `ratio` is the largest |E| over what noise and
    uncertainties reach by chance in 4.6 % of repetitions, of all points that were compared; of one
    number it is |E| / (2 u_val). u_num and u_val are infinite where nothing bounds them.
    `raw` is the rms as it is, `noise` what the measurement's noise alone explains of it;
    `numerical` says how u_num was found. `kind` is what was measured, and `size` how large it was,
    measured and simulated; None: of nothing that has a zero.
    """

    name: str
    value: float
    limit: float | None
    u_val: float
    u_D: float
    u_num: float
    u_input: float
    unit: str
    count: int
    validation: Validation
    acceptance: Acceptance
    why: str
    ratio: float = 0.0
    requirement: str = ""
    raw: float = 0.0
    noise: float = 0.0
    numerical: str = ""
    kind: str = ""
    size: Size | None = None

    @property
    def verdict(self) -> Validation | Acceptance:
        """The answer that decides: acceptance where something is required, else validation."""
        return self.validation if self.acceptance == "no requirement" else self.acceptance

    @property
    def evidence(self) -> bool:
        """Whether it decides anything about the model."""
        return self.verdict in ("good enough", "not good enough", "differs", "not distinguishable")

    @property
    def margin(self) -> float | None:
        """The limit less |E| + 2 u_val, in `unit`; positive where good enough."""
        if self.limit is None or not self.count or not math.isfinite(self.u_val):
            return None
        return self.limit - abs(self.value) - 2 * self.u_val

    @property
    def p_value(self) -> float:
        """How often a perfect model would show an error as large, by a normal law of u_val."""
        return 2 * float(ndtr(-2 * self.ratio))


def nothing_compared(accept: Accept, name: str, unit: str, why: str) -> Check:
    """Return the check of a quantity that was compared with nothing: it has failed."""
    none: Acceptance = "no requirement" if accept.required is None else "nothing compared"
    return Check(
        name, 0.0, accept.required, 0.0, 0.0, 0.0, 0.0, unit, 0, "nothing compared", none,
        f"compared nothing: {why}", requirement=accept.why,
    )  # fmt: skip


def as_fitted(check: Check, by: str) -> Check:
    """Return the check as fitted: its data calibrated the model, so that it is no evidence."""
    if not check.count:
        return check
    acceptance = check.acceptance if check.limit is None else "fitted"
    why = f"{by}: no evidence; {check.why}"
    return replace(check, validation="fitted", acceptance=acceptance, why=why)


def as_same_model(check: Check, why: str) -> Check:
    """Return the check as of the same model: its own recording cannot confirm it; its error
    stays."""
    known = check.verdict in ("good enough", "not distinguishable")
    if not known:
        return check
    acceptance = check.acceptance if check.limit is None else "same model"
    validation: Validation = "differs" if check.validation == "differs" else "same model"
    return replace(
        check, validation=validation, acceptance=acceptance, why=f"{why}: no evidence; {check.why}"
    )


@dataclass(frozen=True)
class Sensitivity:
    """Change of a residual by one standard uncertainty of an input."""

    name: str
    change: Residual


@dataclass(frozen=True)
class PointErrors:
    """Errors of what is judged (n,) with the measurement's standard uncertainty of each (n,).

    `sd` is the noise of every of its `components`, independent in so many `rows`; `systematic` the
    standard uncertainty that all points share. `raw` is the rms as it is, `noise` the rms that
    noise alone would have.
    """

    E: Floats
    u_D: Floats
    sd: float
    components: int
    rows: float
    systematic: float
    raw: float
    noise: float

    def reach(self, others: Floats) -> Floats:
        """Return the |E| (n,) that chance shows somewhere among all in 4.6 % of repetitions, where
        `others` (n,) is the standard uncertainty that a point has besides the measurement's."""
        shared = np.hypot(self.systematic, others)
        return _reach(self.sd, shared, self.components, self.rows)

    def worst(self, shared: Floats) -> int:
        """Return the index of the largest |E| + 2 u_val, `shared` (n,) being the rest of u_val."""
        return int(np.argmax(np.abs(self.E) + 2 * np.hypot(self.u_D, shared)))


def errors_of(residual: Residual, statistic: Statistic = "every") -> PointErrors:
    """Return the errors that are judged of a residual (k, c): of every row, of their rms, or their
    mean.

    A row of one component is signed; the length of a row of more components is not.
    """
    d, (k, c), sd = residual.values, residual.values.shape, residual.sd
    raw, noise = rms(d), math.sqrt(c) * sd
    m, common = residual.freedom or k * c, residual.systematic
    if k > 1 and statistic == "rms":
        own, u_noise = _noise_free(raw, noise, m)
        spread = math.sqrt(c) * common
        one = np.array([math.hypot(u_noise, spread)])
        return PointErrors(np.array([own]), one, u_noise, 1, 1.0, spread, raw, noise)
    rows = max(m / c, 1.0)
    if k > 1 and statistic == "mean":
        d, sd, rows = d.mean(axis=0)[None, :], sd / math.sqrt(rows), 1.0
    E: Floats = d[:, 0] if c == 1 else np.linalg.norm(d, axis=1)
    u_D = np.full(len(E), math.hypot(sd, common))
    # A length that a shared shift alone shows reaches further than two standard deviations.
    shift = common * math.sqrt(chdtri(c, ALPHA)) / 2
    return PointErrors(E, u_D, sd, c, rows, shift, raw, noise)


def _reach(sd: float, shared: Floats, components: int, rows: float) -> Floats:
    """T (n,) that the largest length of `rows` vectors of noise `sd` a component, all moved by one
    normal shift of standard deviation `shared` (n,), exceeds with probability `ALPHA`."""
    if sd == 0 or (components == 1 and rows == 1):
        return np.asarray(2 * np.hypot(sd, shared))
    ratio = np.minimum(shared / sd, _DROWNED)
    grid = np.append(0.0, np.geomspace(1e-2, _DROWNED, 40))
    grid = grid[: int(np.searchsorted(grid, ratio.max())) + 1]
    known = np.array([_largest(float(r), components, rows) for r in grid])
    return np.asarray(sd * np.interp(ratio, grid, known) * np.maximum(shared / sd / _DROWNED, 1.0))


@lru_cache(maxsize=4096)
def _largest(ratio: float, components: int, rows: float) -> float:
    """`_reach` for noise of 1 and one shift: bisection, the shift integrated by Gauss-Hermite."""
    z, w = hermegauss(40)
    w = w / w.sum()
    low, high = 0.0, math.sqrt(chdtri(components, ALPHA / rows)) + 4 * ratio
    for _ in range(50):
        T = (low + high) / 2
        below = w @ chndtr(T**2, components, (ratio * z) ** 2) ** rows
        low, high = (low, T) if below > 1 - ALPHA else (T, high)
    return (low + high) / 2


def judge(
    residual: Residual,
    accept: Accept,
    numerical: Numerical,
    inputs: Sequence[Sensitivity],
) -> Check:
    """Both answers about one residual; where nothing bounds u_num neither can be given."""
    statistic: Statistic = accept.statistic if residual.count > 1 else "every"
    found = errors_of(residual, statistic)
    parts = {}  # what every input does to every error (n,); its rms where that is not known by row
    for s in inputs:
        change, n = s.change.values, len(found.E)
        by_row = n == len(change)
        parts[s.name] = np.linalg.norm(change, axis=1) if by_row else np.full(n, rms(change))
    u_input = np.sqrt(sum((p**2 for p in parts.values()), start=np.zeros(len(found.E))))
    others = np.hypot(u_input, numerical.u)
    w = found.worst(others)
    reach = found.reach(others)
    E, u_D, u_val = found.E[w], found.u_D[w], np.hypot(found.u_D, others)[w]
    named = {"measurement": float(u_D)} | dict(numerical.parts) | {
        name: float(part[w]) for name, part in parts.items()
    }  # fmt: skip
    # The largest |E| over what chance reaches; 0 for an exact zero without any uncertainty
    zero = reach == 0
    over = np.where(
        zero, np.where(found.E == 0, 0.0, np.inf), np.abs(found.E) / np.where(zero, 1.0, reach)
    )
    interval = _Interval(
        float(E), float(u_val), float(over.max()), float((np.abs(found.E) - reach).max()),
        accept.required, residual.scale, named, numerical, residual.unit,
        _where(found.E, reach, w) if statistic == "every" else "",
    )  # fmt: skip
    validation, acceptance, why = interval.answers
    return Check(
        name_of(residual, statistic), float(E) + 0.0, accept.required, float(u_val), float(u_D),
        numerical.u, float(u_input[w]), residual.unit, residual.count, validation, acceptance, why,
        interval.ratio, accept.why, found.raw, found.noise, numerical.words,
        kind_of(residual.quantity, residual.unit), size_of(residual),
    )  # fmt: skip


def name_of(residual: Residual, statistic: Statistic) -> str:
    """Return the name of the check: of many points with what of them is judged."""
    if residual.count == 1:
        return residual.name
    return f"{residual.quantity}.{_STATISTICS[statistic]}@{residual.load}"


@dataclass(frozen=True)
class _Interval:
    """E +- 2 u_val (or unbounded) against zero and against the limit."""

    E: float
    u_val: float
    ratio: float
    beyond: float  # the largest |E| less what chance reaches
    limit: float | None
    scale: float | None
    parts: Mapping[str, float]
    numerical: Numerical
    unit: str
    where: str

    @property
    def answers(self) -> tuple[Validation, Acceptance, str]:
        if why := self._unbounded:
            return "no answer", "no requirement" if self.limit is None else "undecided", why
        validation: Validation = "differs" if self.ratio > 1 else "not distinguishable"
        acceptance, decides = self._accepted()
        words = (self._against_zero(validation), decides)
        return validation, acceptance, "; ".join(w for w in words if w)

    @property
    def _unbounded(self) -> str:
        if math.isinf(self.numerical.u):
            return self.numerical.words
        named = {"E": self.E, **self.parts}
        holes = [name for name, u in named.items() if not math.isfinite(u)]
        return f"not a finite number: {', '.join(holes)}" if holes else ""

    def _against_zero(self, validation: Validation) -> str:
        if self.u_val == 0:
            return "E and u_val are exactly zero" if self.E == 0 else "u_val is zero"
        blunt = abs(self.E) / self.parts["measurement"] if self.parts["measurement"] else 0.0
        beyond = f" but {blunt:.0f} times u_D" if blunt > 5 and validation != "differs" else ""
        size = f"|E| is {abs(self.E) / self.u_val:.1f} u_val{beyond}, largest part: {self._largest}"
        return f"{size}{self.where}"

    def _accepted(self) -> tuple[Acceptance, str]:
        limit = self.limit
        if limit is None:
            return "no requirement", ""
        if self.scale is not None and limit >= self.scale:
            return "undecided", (
                f"the limit {self._shown(limit)} is as large as the largest measured value, "
                f"{self._shown(self.scale)}: no model could fail it; set a smaller limit"
            )
        if abs(self.E) + 2 * self.u_val <= limit:
            return "good enough", ""
        if self.beyond > limit:
            return "not good enough", ""
        low, high = abs(self.E) - 2 * self.u_val, abs(self.E) + 2 * self.u_val
        room = abs(limit - abs(self.E)) / 2
        return "undecided", (
            f"{text(max(low, 0.0), self.unit)} to {self._shown(high)} straddles the limit "
            f"{self._shown(limit)}: a u_val below {self._shown(room)} would decide; "
            f"{self._better} reduces it"
        )

    def _shown(self, value: float) -> str:
        return with_unit(value, self.unit)

    @property
    def _largest(self) -> str:
        return max(self.parts, key=lambda name: self.parts[name])

    @property
    def _better(self) -> str:
        part = self._largest
        known = self.numerical.deciding.get(part)
        return known or _SMALLER.get(part, f"a better measurement of '{part}'")


def _noise_free(raw: float, noise: float, m: int) -> tuple[float, float]:
    """The rms of an error itself from an rms with noise of m independent numbers, and half of the
    wider side of its 95 % interval: m raw^2 / noise^2 is noncentral chi-square. An rms below its
    noise says no more than one that equals it."""
    if noise == 0:
        return raw, 0.0
    E = math.sqrt(max(raw**2 - noise**2, 0.0))
    x = m * max(raw / noise, 1.0) ** 2
    low, high = (noise * math.sqrt(float(chndtrinc(x, m, p)) / m) for p in (1 - ALPHA, ALPHA / 2))
    return E, max(E - low, high - E) / 2


def _where(E: Floats, reach: Floats, at: int) -> str:
    """Which of many values is shown, and which one is furthest beyond chance where another is."""
    if len(E) == 1:
        return ""
    words = f"; worst of {len(E)} values: number {at + 1}"
    over = np.abs(E) / np.where(reach == 0, np.finfo(float).tiny, reach)
    most = int(over.argmax())
    if most == at or not over[most] > 1:
        return words
    return f"{words}; number {most + 1} differs, |E| {abs(E[most]):.3g} of {reach[most]:.3g}"
