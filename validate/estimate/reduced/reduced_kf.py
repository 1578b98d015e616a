"""Kalman filter on few modes with a load bias; gains precomputed or steady.

The gains of a linear filter need no data, so a step costs what the model's step costs and one small
product. The steady gain comes from the discrete Riccati equation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.estimate.gating import Care, NoiseSettings, care_of, clock_setting, gate_setting
from validate.estimate.kalman.covariance import Claim, Dense, Recursion, Steady, claimed
from validate.estimate.kalman.formulas import (
    Gain,
    Innovation,
    Seen,
    innovation,
    nothing,
    propagated,
)
from validate.estimate.kalman.gains import Claims, gain_sequence, schedule
from validate.estimate.measurements import Measurements, timetable
from validate.estimate.reduced.linear_system import (
    LinearModel,
    LoadDoubt,
    ReducedModel,
    reduced_model,
)
from validate.estimate.reduced.small_state import CoreStepper
from validate.estimate.smoother import (
    Look,
    Note,
    Transition,
    look_of,
    require_exact,
    smooth_setting,
)
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled

_SIZING = 50  # steps after which sizes of states are taken: orders of magnitude are enough
_DIES = 1 - 1e-6  # of an error, from one look to the next: what never dies has no steady gain
_DOUBLINGS, _DOUBLED = 60, 1e-13  # iterations, and the relative change that ends them


@dataclass(frozen=True)
class ReducedKf:
    """`modes` lowest modes; how unsure every load is (see `LoadDoubt`): `load_start` N,
    `load_walk` N per sqrt(s), `load_jitter` N; R m^2 (None: the measurements' own sd squared).

    `gains`: "sequence" is the exact filter, "steady" uses from the start the gain that it settles
    at: sub-optimal at first, cheapest to prepare for long runs.
    """

    handles: ClassVar[Handles] = replace(LINEAR_DYNAMICS, drives=False)
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("load_walk", "R", "load_start")

    dt: float = quantity(0.002, "s", "time step")
    modes: int = quantity(20, "1", "lowest modes kept")
    load_start: float = quantity(0.1, "N", "sd of every load's bias at the start")
    load_walk: float = quantity(0.1, "N/s^0.5", "random walk of every load's bias")
    load_jitter: float = quantity(0.0, "N", "sd of an independent force at each step")
    R: float | None = quantity(None, "m2", "variance of a measurement; none: declared")
    settled: float = quantity(1e-6, "1", "relative change of the gain below which it is frozen")
    gains: Literal["sequence", "steady"] = quantity("sequence", "1", "exact, or the steady one")
    gate: float | None = gate_setting()
    clock: float | None = clock_setting()
    smooth: bool = smooth_setting()

    def prepare(self, system: System, measurements: Measurements) -> CoreStepper:
        """Raise `SceneError` for scenes with drives, large strain, or coupled damping, and
        `ComparisonError` for measurements off the steps, or a steady gain of irregular ones."""
        require_handled(system.scene, self)
        require_exact(self.smooth, self.gains)
        doubt = LoadDoubt(self.load_start, self.load_walk, self.load_jitter)
        R = measurements.variances(self.R)
        model = reduced_model(system, measurements, self.dt, self.modes, doubt, R)
        table = timetable(measurements, self.dt)
        care = care_of(measurements, self.gate, self.clock, self.dt)
        make = _steady if self.gains == "steady" else _exact
        core = make(model, schedule(table), self.settled, care)
        return CoreStepper(system, core, measurements, table, care, self.smooth)


def dense_covariance(model: LinearModel) -> Dense:
    """Return the recursion of a small model."""
    return Dense(model.F, model.Q, model.H, np.diag(model.R).copy(), model.P0)


def steady(covariance: Dense, when: Mapping[int, Seen]) -> Steady:
    """Return the filter that has settled on measuring everything as often as it usually is
    measured.

    Raises `ComparisonError` where there is none: part of the state is neither seen nor stable.
    """
    every = int(np.median(np.diff([0, *when]))) if when else 1
    F, Q = covariance.over(every)
    Q = (Q + Q.T) / 2
    # Sizes (n,) of the states after some steps: within them Riccati's entries are comparable
    P = covariance.P0
    for _ in range(_SIZING):
        P = propagated(P, F, Q)
    sd = np.sqrt(np.maximum(np.diag(P), 0.0))
    size, sd = np.where(sd > 0, sd, 1.0), np.sqrt(covariance.R)
    A, H = size[:, None] * F.T / size, size[:, None] * covariance.H.T / sd
    try:
        P = _riccati(A, H, Q / np.outer(size, size))
    except (LinAlgError, ValueError) as none:
        raise ComparisonError(
            f"no steady gain of {len(F)} states measured every {every} steps ({none}); give "
            "the load a walk, or use the sequence of gains"
        ) from none
    P = np.outer(size, size) * (P + P.T) / 2
    return Steady(covariance, claimed(P, P @ covariance.H.T))


def _riccati(A: Floats, B: Floats, Q: Floats) -> Floats:
    """X = A^T X (I + B B^T X)^-1 A + Q: by Schur's form, and by doubling where rounding keeps that
    from being ordered. Raises `ValueError` or `LinAlgError` where neither finds it."""
    try:
        return np.asarray(solve_discrete_are(A, B, Q, np.eye(B.shape[1])))
    except (LinAlgError, ValueError):
        X = _doubled(A, B @ B.T, Q)
    left = A - B @ np.linalg.solve(np.eye(B.shape[1]) + B.T @ X @ B, B.T @ X @ A)
    radius = float(np.abs(np.linalg.eigvals(left)).max())
    if not radius < _DIES:
        raise ValueError(
            f"an error would not decay: {radius:.7f} of it remains from one measurement to the next"
        )
    return X


def _doubled(A: Floats, G: Floats, X: Floats) -> Floats:
    """Each turn looks twice as far ahead (structure-preserving doubling)."""
    eye = np.eye(len(A))
    for _ in range(_DOUBLINGS):
        with np.errstate(all="ignore"):  # what runs away is refused below
            W = np.linalg.solve(eye + G @ X, np.hstack([A, G]))
            AW, GW = np.split(W, 2, axis=1)
            more = A.T @ X @ AW
            X, G, A = X + (more + more.T) / 2, G + A @ GW @ A.T, A @ AW
        if not np.isfinite(X).all():
            break
        if np.abs(more).max() <= _DOUBLED * np.abs(X).max():
            return X
    raise ValueError(f"the doubling algorithm does not converge within {_DOUBLINGS} iterations")


@dataclass(frozen=True)
class Amplitudes:
    """x (n,) after step k, its look if it had one, and with care what was claimed after the last
    one, at step `at`; smoothed, at output frames, P (n, n)."""

    x: Floats
    k: int
    claim: Claim | None = None
    at: int = 0
    look: Look | None = None
    P: Floats | None = None


@dataclass(frozen=True)
class GainCore:
    """A linear model with gains by step; `claims` gives P (n, n) of any state.

    With `care` there are no gains beforehand: each look has its own, from `recursion`.
    """

    reduced: ReducedModel
    recursion: Recursion
    gains: Mapping[int, Gain]
    claims: Callable[[Amplitudes], Floats]
    care: Care | None

    @property
    def units(self) -> Mapping[str, str]:
        return {f"load_bias.{j}": "N" for j in range(self.reduced.loads)}

    def start(self) -> Amplitudes:
        return Amplitudes(self.reduced.model.x0, 0, self.recursion.start() if self.care else None)

    def step(
        self, inner: Amplitudes, k: int, loads: Floats, z: Floats | None
    ) -> tuple[Amplitudes, Innovation]:
        m = self.reduced.model
        prior, gain = m.F @ inner.x + m.B @ loads, self.gains.get(k)
        if self.care is not None:
            return self._heeded(self.care, inner, prior, k, z)
        if z is None or gain is None:
            return Amplitudes(prior, k), nothing(len(m.H))
        seen = innovation(z, m.H @ prior, gain)
        look = look_of(gain, seen)
        return Amplitudes(prior + gain.G @ look.y, k, look=look), seen

    def _heeded(
        self, care: Care, inner: Amplitudes, prior: Floats, k: int, z: Floats | None
    ) -> tuple[Amplitudes, Innovation]:
        H = self.reduced.model.H
        if z is None:
            return replace(inner, x=prior, k=k, look=None), nothing(len(H))
        claim, shown = claim_of(self.recursion, inner, 1), H @ prior
        gain, claim, seen, _ = care.update(self.recursion, claim, z, shown, shown - H @ inner.x)
        if gain is None:
            return replace(inner, x=prior, k=k, look=None), seen
        look = look_of(gain, seen)
        return Amplitudes(prior + gain.G @ look.y, k, claim, k, look), seen

    def free(self, inner: Amplitudes) -> Floats:
        return self.reduced.lift @ inner.x

    def variances(self, inner: Amplitudes) -> Floats:
        P = self.claims(inner) if inner.P is None else inner.P
        lift = self.reduced.lift
        return np.asarray(np.einsum("ij,ij->i", lift @ P, lift))

    def numbers(self, inner: Amplitudes) -> Mapping[str, float]:
        biases = inner.x[len(inner.x) - self.reduced.loads :]
        return dict(zip(self.units, biases.tolist(), strict=True))

    def note(self, inner: Amplitudes, framed: bool) -> Note:
        return Note(inner.look, framed)

    def transition(self) -> Transition:
        assert isinstance(self.recursion, Dense)
        return self.recursion

    def corrected(self, inner: Amplitudes, e: Floats, W: Floats | None) -> Amplitudes:
        if W is None:
            return replace(inner, x=inner.x + e)
        P = self.claims(inner)
        PW = P @ W
        return replace(inner, x=inner.x + e, P=P - PW @ PW.T)


def claim_of(recursion: Recursion, inner: Amplitudes, ahead: int = 0) -> Claim:
    """What is claimed so many steps after a state that a filter with care is in."""
    assert inner.claim is not None
    steps = inner.k + ahead - inner.at
    return recursion.predict(inner.claim, steps) if steps else inner.claim


def _exact(
    reduced: ReducedModel, when: Mapping[int, Seen], settled: float, care: Care | None
) -> GainCore:
    covariance = dense_covariance(reduced.model)
    if care is not None:
        return GainCore(reduced, covariance, {}, lambda s: claim_of(covariance, s).P, care)
    claims = Claims(covariance, when, settled)
    gains = gain_sequence(covariance, when, settled).gains
    return GainCore(reduced, covariance, gains, lambda s: claims.at(s.k).P, None)


def _steady(
    reduced: ReducedModel, when: Mapping[int, Seen], settled: float, care: Care | None
) -> GainCore:
    """Its variances are the steady ones, from the first step on."""
    recursion = steady(dense_covariance(reduced.model), when)
    _, after = recursion.update(recursion.prior, (True,) * len(recursion.H))
    gains = {} if care else gain_sequence(recursion, when, settled).gains
    return GainCore(reduced, recursion, gains, lambda _: after.P, care)
