"""Few modes with an unknown load: the state-space model and its Kalman filter.

The gains of a linear filter need no data, so a step costs what the model's step costs and one small
product. The steady gain comes from the discrete Riccati equation.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from validate.arrays import Floats, checked
from validate.errors import ComparisonError, SceneError
from validate.estimate.gating import (
    Care,
    NoiseSettings,
    care_of,
    clock_setting,
    gate_numbers,
    gate_setting,
    gate_units,
)
from validate.estimate.kalman.coordinates import OneAtATime
from validate.estimate.kalman.covariance import (
    Claim,
    Claims,
    Dense,
    Recursion,
    Steady,
    claimed,
    gain_sequence,
    schedule,
)
from validate.estimate.kalman.formulas import (
    Gain,
    Innovation,
    Seen,
    innovation,
    innovation_units,
    nothing,
    propagated,
)
from validate.estimate.measurements import Measurements, Timetable
from validate.estimate.smoother import (
    Look,
    Note,
    Transition,
    look_of,
    require_exact,
    smooth_setting,
    smoothed,
)
from validate.fem.critical import Modes
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.dynamic.linear import spread
from validate.solve.dynamic.modal import exact_walk, left_out
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled
from validate.solve.types import State

# --- stepper of filters with a small state, with an exchangeable core ----------------------------


class Core(Protocol):
    """A small filter: its state is opaque, `loads` (l,) are the forces in N at the step's end."""

    @property
    def units(self) -> Mapping[str, str]:
        """Of what else it estimates, by trace name."""
        ...

    def start(self) -> Any: ...

    def step(self, inner: Any, k: int, loads: Floats, z: Floats | None) -> tuple[Any, Innovation]:
        """Step k = 1, 2, ... with what was measured there (m,), NaN = missing; None: predict."""
        ...

    def free(self, inner: Any) -> Floats:
        """Estimated displacements (m,) m of the free unknowns."""
        ...

    def variances(self, inner: Any) -> Floats:
        """Their claimed variances (m,) m^2."""
        ...

    def numbers(self, inner: Any) -> Mapping[str, float]: ...


@runtime_checkable
class SmoothCore(Core, Protocol):
    """A core whose states can be smoothed."""

    def note(self, inner: Any, framed: bool) -> Note:
        """Of the last step."""
        ...

    def transition(self) -> Transition: ...

    def corrected(self, inner: Any, e: Floats, W: Floats | None) -> Any:
        """Return the state with e (n,) added, and at output frames P_s = P - (P W)(P W)^T."""
        ...


@dataclass(frozen=True)
class CoreStepper(OneAtATime):
    """States carry what the core does."""

    system: System
    core: Core
    offered: Measurements
    table: Timetable
    care: Care | None
    smooth: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return self.offered.names

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """NIS with its degrees, innovations with their sd, and the core's own."""
        return {**innovation_units(self.names), **gate_units(self.care), **self.core.units}

    def unheard(self, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why no measurement reached the estimate; empty where one did."""
        return self.table.unheard(len(numbers), numbers)

    def rest(self) -> State:
        return State(0, self.core.start())

    def step(self, state: State, inputs: Floats) -> State:
        """Return the posterior at the end of a step; `inputs` are those there, loads alone."""
        k = state.k + 1
        inner, seen = self.core.step(state.inner, k, inputs, self.table.at(k))
        if not np.isfinite(self.core.free(inner)).all():
            return State(k, inner, ("diverged", f"the estimate is not finite at step {k}"))
        numbers = {**seen.numbers(self.names), **gate_numbers(self.care, seen)}
        numbers |= self.core.numbers(inner)
        return State(k, inner, numbers=numbers)

    def note(self, state: State, framed: bool) -> Note:
        assert isinstance(self.core, SmoothCore)
        return self.core.note(state.inner, framed)

    def smoother(self, notes: Sequence[Note]) -> Callable[[State], State]:
        """With what else the core estimates."""
        core = self.core
        assert isinstance(core, SmoothCore)
        found = smoothed(core.transition(), notes)

        def shown(state: State) -> State:
            inner = core.corrected(state.inner, found.after(state.k), found.roots.get(state.k))
            return replace(state, inner=inner, numbers={**state.numbers, **core.numbers(inner)})

        return shown

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        return self._nodal(self.core.free(state.inner))

    def sd(self, state: State) -> Floats:
        """Claimed standard deviations (n, d) m; held unknowns have none."""
        return self._nodal(np.sqrt(np.maximum(self.core.variances(state.inner), 0.0)))

    def _nodal(self, free: Floats) -> Floats:
        return spread(self.system, free, np.zeros(0)).reshape(self.scene.mesh.nodes.shape)


# --- linear state-space model of few modes with unknown load -------------------------------------


@dataclass(frozen=True)
class LinearModel:
    """x' = F x + B f + w, z = H x + r with covariances Q of w and R of r; first x0, P0.

    F, Q, P0 (n, n), B (n, l), H (m, n), R (m, m), x0 (n,); f (l,) are the inputs of the step's
    end in N. Letters are filterpy's: F is the transition here. Raises `ComparisonError` for shapes
    that do not fit each other, and for covariances that are not symmetric.
    """

    F: Floats
    B: Floats
    H: Floats
    Q: Floats
    R: Floats
    x0: Floats
    P0: Floats

    def __post_init__(self) -> None:
        n, m = len(self.F), len(self.H)
        shapes = {"F": (n, n), "B": (n, None), "H": (m, n), "Q": (n, n), "R": (m, m)}
        for name, shape in (shapes | {"x0": (n,), "P0": (n, n)}).items():
            value = checked(getattr(self, name), f"model {name}", shape, error=ComparisonError)
            object.__setattr__(self, name, value)
        for name in ("Q", "R", "P0"):
            require_symmetric(getattr(self, name), f"model {name}")

    @property
    def size(self) -> int:
        return len(self.F)


def require_symmetric(P: Floats, name: str) -> None:
    """Raise `ComparisonError` when P differs from its transpose by more than rounding."""
    off, scale = float(np.abs(P - P.T).max()), float(np.abs(P).max())
    if off > 1e-9 * scale:
        raise ComparisonError(f"{name}: differs from its transpose by {off:.1e} of {scale:.1e}")


@dataclass(frozen=True)
class LoadDoubt:
    """Uncertainty of the loads: `start` N (sd) at the first step, `walk` N per sqrt(s) from then.

    `jitter` N (sd) is force noise of each step on its own.
    """

    start: float
    walk: float
    jitter: float = 0.0

    def __post_init__(self) -> None:
        for name in ("start", "walk", "jitter"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise SceneError(
                    f"uncertainty of the load, {name} = {value:g}: expected a number >= 0"
                )


@dataclass(frozen=True)
class ReducedModel:
    """`model` of x (n,); the free unknowns are `lift` (m, n) x; the last `loads` states are biases
    in N."""

    model: LinearModel
    lift: Floats
    loads: int


def reduced_model(
    system: System, measurements: Measurements, dt: float, modes: int, doubt: LoadDoubt, R: Floats
) -> ReducedModel:
    """Return the model of the lowest `modes` modes in steps of dt s, R (m_z,) m^2.

    Raises `SceneError` for damping that couples the modes.
    """
    lowest = Modes.of(system, min(modes, len(system.free)))
    rest = left_out(system, lowest, np.ascontiguousarray(system.loads[system.free]))
    # Share (l,) of the rests that stays over a step: exp(-dt k / c), 0 without damping
    K, C = (X[system.free][:, system.free] for X in (system.K, system.C))
    k, c = (np.einsum("ij,ij->j", rest, X @ rest) for X in (K, C))
    creeps = (c > 0) & (k > 0)
    kept = np.where(creeps, np.exp(-dt * k / np.where(creeps, c, 1.0)), 0.0)
    F, B = _transition(system, lowest, kept, dt)
    l = rest.shape[1]
    lift = np.hstack([lowest.shapes, np.zeros_like(lowest.shapes), rest, np.zeros_like(rest)])
    H, n = measurements.free(system.free) @ lift, lift.shape[1]
    P0 = np.zeros((n, n))
    P0[-l:, -l:] = doubt.start**2 * np.eye(l)
    Q = doubt.jitter**2 * (B @ B.T)
    Q[-l:, -l:] += doubt.walk**2 * dt * np.eye(l)
    return ReducedModel(LinearModel(F, B, H, Q, np.diag(R), np.zeros(n), P0), lift, l)


def _transition(system: System, modes: Modes, kept: Floats, dt: float) -> tuple[Floats, Floats]:
    """F (n, n) and B (n, l): modes exact for a force held in the step, rests, biases."""
    walk = exact_walk(modes, dt, "constant")
    assert walk.rate is not None
    (qq, qv, _, _, qf), (vq, vv, _, _, vf) = walk.q, walk.rate
    forces = modes.shapes.T @ system.loads[system.free]
    r, l = forces.shape
    B = np.vstack([qf[:, None] * forces, vf[:, None] * forces, np.diag(1 - kept), np.zeros((l, l))])
    F = np.zeros((len(B), len(B)))
    F[: 2 * r, : 2 * r] = np.block([[np.diag(qq), np.diag(qv)], [np.diag(vq), np.diag(vv)]])
    F[2 * r : 2 * r + l, 2 * r : 2 * r + l] = np.diag(kept)
    F[:, -l:] = B  # a bias is a load
    F[-l:, -l:] = np.eye(l)
    return F, B


# --- Kalman filter on few modes with a load bias; gains precomputed or steady --------------------

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
        table = measurements.timetable(self.dt)
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
