"""Scores and metrics: statistics with unit, count and definition.

Type of a metric: name, formula, unit, inputs and definition.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

from validate.arrays import Floats, rms

if TYPE_CHECKING:
    from validate.compare.residual import Residual
    from validate.solve.types import Run


@dataclass(frozen=True)
class Score:
    """A number with its SI unit, number of points, reference and definition."""

    name: str
    value: float
    unit: str
    count: int
    against: str
    definition: str


def mean_length(values: Floats) -> float:
    """Mean length of the rows (k, c)."""
    return float(np.linalg.norm(values, axis=1).mean())


def max_length(values: Floats) -> float:
    """Largest length of the rows (k, c)."""
    return float(np.linalg.norm(values, axis=1).max())


def bias(values: Floats) -> float:
    """Length of the mean row of (k, c); the signed mean when c = 1."""
    mean = values.mean(axis=0)
    return float(mean[0]) if len(mean) == 1 else float(np.linalg.norm(mean))


METRICS: tuple[tuple[str, Callable[[Floats], float], str], ...] = (
    ("rms", rms, "root mean square over the points"),
    ("mean", mean_length, "mean absolute distance over the points"),
    ("max", max_length, "largest distance over the points"),
    ("bias", bias, "mean over the points, with its sign"),
)


def scores_of(residual: Residual, against: str) -> tuple[Score, ...]:
    """Scores named `<quantity>.<statistic>@<load>`; a scalar gives error, simulated, measured."""
    if residual.count == 1 and residual.values.shape[1] == 1:
        q, load = residual.quantity, residual.load
        rows = [
            (f"{q}@{load}", float(residual.values[0, 0]), "simulated minus measured"),
            (f"{q}.simulated@{load}", residual.simulated, "simulated"),
            (f"{q}.measured@{load}", residual.measured, "measured (or reference)"),
        ]
        return tuple(
            Score(name, value, residual.unit, 1, against, f"{residual.definition}; {words}")
            for name, value, words in rows
            if value is not None
        )
    return tuple(
        Score(
            f"{residual.quantity}.{name}@{residual.load}",
            statistic(residual.values),
            residual.unit,
            residual.count,
            against,
            f"{residual.definition}; {words}",
        )
        for name, statistic, words in METRICS
    )


def run_scores(run: Run) -> tuple[Score, ...]:
    """Return the cost of a run: step times, set-up time, largest number of pressure updates."""
    rows: list[tuple[str, float, str, int, str]] = [
        ("setup", run.setup_s, "s", 1, "mesh, assembly, factorisation and response columns"),
    ]
    if run.step_s is not None and len(run.t):  # a refusal has no rate
        n = run.step_s.n
        rows += [
            ("step.p50", run.step_s.p50, "s", n, "median time of one step"),
            ("step.p99", run.step_s.p99, "s", n, "99 % quantile of the time of one step"),
        ]
    updates = run.traces["updates"].y
    if len(updates):
        words = "most pressure updates of one step"
        rows.append(("updates.max", float(updates.max()), "1", len(updates), words))
    return tuple(Score(name, v, unit, n, "none", words) for name, v, unit, n, words in rows)


class Compared(Protocol):
    """What a metric is taken of: a run beside its reference."""

    @property
    def against(self) -> str:
        """Name of the reference."""
        ...

    @property
    def where(self) -> str:
        """On what the two are compared, in words."""
        ...

    @property
    def units(self) -> Mapping[str, object]:
        """What stands for the names in braces of a metric's unit."""
        ...


C_contra = TypeVar("C_contra", bound=Compared, contravariant=True)


@dataclass(frozen=True)
class Counted(Generic[C_contra]):
    """`number` of things of a kind `of` that a metric rests on."""

    of: str
    number: Callable[[C_contra], int]


@dataclass(frozen=True)
class Metric(Generic[C_contra]):
    """`value(compared)` in `unit`, as "m", or "m^{dimension}" filled in by what is compared.

    `symmetric`: the same when run and reference change places. `value` raises `ComparisonError`
    where the metric does not exist (0/0, a crossing boundary), with the reason.
    """

    name: str
    value: Callable[[C_contra], float]
    unit: str
    definition: str
    counted: Counted[C_contra]
    symmetric: bool = False

    def unit_of(self, compared: C_contra) -> str:
        return self.unit.format(**compared.units)

    def score(self, compared: C_contra, prefix: str = "") -> Score:
        """Return the score `<prefix><name>` against the reference."""
        words = f"{self.definition}; {compared.where}; counted: {self.counted.of}"
        value, count = self.value(compared), self.counted.number(compared)
        unit = self.unit_of(compared)
        return Score(prefix + self.name, value, unit, count, compared.against, words)
