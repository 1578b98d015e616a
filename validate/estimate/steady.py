"""Kalman filter on few modes with a load bias, its gains precomputed or the steady one.

The gains of a linear filter need no data, so a step costs what the model's step costs and one small
product. The steady gain comes from the discrete Riccati equation.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.estimate.core_stepper import CoreStepper, require_loads
from validate.estimate.covariance import Claim, Dense, Gain, best_gain, claimed
from validate.estimate.gains import Claims, Seen, gain_sequence, schedule
from validate.estimate.innovation import Innovation, innovation, nothing
from validate.estimate.linear_model import LinearModel
from validate.estimate.measured import Measurements, Timetable, timetable
from validate.estimate.reduced_linear import LoadDoubt, ReducedModel, reduced_model
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.dynamic import reactions, require_linear
from validate.solve.types import Stepper

_SIZING = 50  # steps after which sizes of states are taken: orders of magnitude are enough


@dataclass(frozen=True)
class ReducedKf:
    """`modes` lowest modes; how unsure every load is (see `LoadDoubt`): `load_start` N,
    `load_walk` N per sqrt(s), `load_jitter` N; R m^2 (None: the measurements' own sd squared).

    `gains`: "sequence" is the exact filter, "steady" uses from the start the gain that it settles
    at: sub-optimal at first, cheapest to prepare for long runs.
    """

    dt: float = quantity(0.002, "s", "time step")
    modes: int = quantity(20, "1", "lowest modes kept")
    load_start: float = quantity(0.1, "N", "sd of every load's bias at the start")
    load_walk: float = quantity(0.1, "N/s^0.5", "random walk of every load's bias")
    load_jitter: float = quantity(0.0, "N", "sd of a force of each step on its own")
    R: float | None = quantity(None, "m2", "variance of a measurement; none: declared")
    settled: float = quantity(1e-6, "1", "change of the gain, of itself, at which it is frozen")
    gains: Literal["sequence", "steady"] = quantity("sequence", "1", "exact, or where it settles")

    def prepare(self, system: System, measurements: Measurements) -> Stepper:
        """Raises `SceneError` for scenes with drives, large strain, or coupled damping, and
        `ComparisonError` for measurements off the steps, or a steady gain of irregular ones."""
        require_linear(system)
        require_loads(system)
        R = measurements.sd**2 if self.R is None else np.full(len(measurements.sd), self.R)
        doubt = LoadDoubt(self.load_start, self.load_walk, self.load_jitter)
        model = reduced_model(system, measurements, self.dt, self.modes, doubt, R)
        table = timetable(measurements, self.dt)
        core = (
            _steady(model, table) if self.gains == "steady" else _exact(model, table, self.settled)
        )
        return CoreStepper(system, reactions(system), core, measurements.names, table)


def dense_covariance(model: LinearModel) -> Dense:
    """The recursion of a small model."""
    return Dense(model.F, model.Q, model.H, np.diag(model.R).copy(), model.P0)


def steady_claim(model: LinearModel, every: int = 1) -> Claim:
    """P- of the steady filter that measures everything at every `every`-th step.

    Raises `ComparisonError` where there is none: part of the state is neither seen nor stable.
    """
    F, Q = np.eye(model.size), np.zeros_like(model.Q)
    for _ in range(every):
        F, Q = model.F @ F, model.F @ Q @ model.F.T + model.Q
    size, sd = _sizes(F, Q, model.P0), np.sqrt(np.diag(model.R))
    A, H = size[:, None] * F.T / size, size[:, None] * model.H.T / sd
    try:
        P = solve_discrete_are(A, H, Q / np.outer(size, size), model.R / np.outer(sd, sd))
    except (LinAlgError, ValueError) as none:
        raise ComparisonError(
            f"no steady gain of {model.size} states measured every {every} steps ({none}); give "
            "the load a walk, or use the sequence of gains"
        ) from none
    P = np.outer(size, size) * (P + P.T) / 2
    return claimed(P, P @ model.H.T)


def _sizes(F: Floats, Q: Floats, P: Floats) -> Floats:
    """Sizes (n,) of the states after some steps: within them Riccati's entries are comparable."""
    for _ in range(_SIZING):
        P = F @ P @ F.T + Q
    sd = np.sqrt(np.maximum(np.diag(P), 0.0))
    return np.where(sd > 0, sd, 1.0)


@dataclass(frozen=True)
class Amplitudes:
    """x (n,) after step k."""

    x: Floats
    k: int


@dataclass(frozen=True)
class GainCore:
    """A linear model with gains by step; what is claimed is recomputed where it is asked for."""

    reduced: ReducedModel
    covariance: Dense
    gains: Mapping[int, Gain]
    claims: Claims | None
    steady: Floats

    def start(self) -> Amplitudes:
        return Amplitudes(self.reduced.model.x0, 0)

    def step(
        self, inner: Amplitudes, k: int, loads: Floats, z: Floats | None
    ) -> tuple[Amplitudes, Innovation]:
        m = self.reduced.model
        prior, gain = m.F @ inner.x + m.B @ loads, self.gains.get(k)
        if z is None or gain is None:
            return Amplitudes(prior, k), nothing(len(m.H))
        seen = innovation(z, m.H @ prior, gain.S_yy)
        x = prior + gain.G @ seen.y[list(gain.seen)]
        return Amplitudes(x, k), seen

    def free(self, inner: Amplitudes) -> Floats:
        return self.reduced.lift @ inner.x

    def variances(self, inner: Amplitudes) -> Floats:
        """Of the steady filter its steady ones, from the first step on."""
        P = self.steady if self.claims is None else self.covariance.matrix(self.claims.at(inner.k))
        lift = self.reduced.lift
        return np.asarray(np.einsum("ij,ij->i", lift @ P, lift))

    def numbers(self, inner: Amplitudes) -> dict[str, tuple[float, str]]:
        biases = inner.x[len(inner.x) - self.reduced.loads :]
        return {f"load_bias.{j}": (float(b), "N") for j, b in enumerate(biases)}


def _exact(reduced: ReducedModel, table: Timetable, settled: float) -> GainCore:
    when, covariance = schedule(table), dense_covariance(reduced.model)
    gains = gain_sequence(covariance, when, settled).gains
    claims = Claims(covariance, when, settled)
    return GainCore(reduced, covariance, gains, claims, reduced.model.P0)


def _steady(reduced: ReducedModel, table: Timetable) -> GainCore:
    when, model = schedule(table), reduced.model
    covariance, claim = dense_covariance(model), steady_claim(model, _interval(when))
    every = {seen: best_gain(claim.PHt, model.H, covariance.R, seen) for seen in {*when.values()}}
    _, after = covariance.update(claim, (True,) * len(model.H))
    by_step = {step: every[seen] for step, seen in when.items()}
    return GainCore(reduced, covariance, by_step, None, after.P)


def _interval(when: Mapping[int, Seen]) -> int:
    """Steps between measurements; where some are missing, the usual one."""
    return int(np.median(np.diff([0, *when]))) if when else 1
