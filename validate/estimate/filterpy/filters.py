"""filterpy's filters as guests: any of them runs in an experiment, behind our shape checks.

filterpy accepts a P of the wrong size, and a 1-D z beside a column x turns x into a matrix: both
are refused here, before the first step and after every one.
"""

import copy
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, UsageError
from validate.estimate.care import (
    Care,
    NoiseSettings,
    care_of,
    clock_setting,
    gate_setting,
    gated_out,
)
from validate.estimate.filterpy.linear_model import LinearModel, require_symmetric
from validate.estimate.kalman.formulas import Innovation, best_gain, innovation, nothing
from validate.estimate.measurements import Measurements, timetable
from validate.estimate.reduced.linear_system import LoadDoubt, ReducedModel, reduced_model
from validate.estimate.reduced.reduced_kf import dense_covariance
from validate.estimate.reduced.small_state import CoreStepper
from validate.estimate.smoother import Look, Note, Transition, look_of, smooth_setting
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled

Make = Callable[[LinearModel], Any]


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """numpy's global generator, seeded for a step and then as it was."""
    before = np.random.get_state()  # noqa: NPY002 - filterpy draws from this one
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002


def kalman(model: LinearModel) -> Any:
    """filterpy's `KalmanFilter` of a model."""
    from validate.estimate.filterpy.names import KalmanFilter  # filterpy takes 0.6 s

    guest = KalmanFilter(model.size, len(model.H), model.B.shape[1])
    guest.F, guest.B, guest.H = model.F.copy(), model.B.copy(), model.H.copy()
    return _filled(guest, model)


def unscented(model: LinearModel) -> Any:
    """filterpy's `UnscentedKalmanFilter`; its roots are symmetric ones, since P0 may be singular.

    Its f takes the loads as keyword `u` of `predict`.
    """
    from validate.estimate.filterpy.names import MerweScaledSigmaPoints, UnscentedKalmanFilter

    points = MerweScaledSigmaPoints(model.size, 1.0, 2.0, 0.0, sqrt_method=_root)

    def f(x: Floats, _: float, u: Floats) -> Floats:
        return model.F @ x + model.B @ u

    m = len(model.H)
    return _filled(
        UnscentedKalmanFilter(model.size, m, 1.0, lambda x: model.H @ x, f, points), model
    )


def ensemble(model: LinearModel) -> Any:
    """filterpy's `EnsembleKalmanFilter` with 50 members, whose `predict` takes the loads."""
    from validate.estimate.filterpy.ensemble import Ensemble

    guest = Ensemble(model)
    guest.Q, guest.R = model.Q.copy(), model.R.copy()
    return guest


GUESTS: dict[str, Make] = {
    "KalmanFilter": kalman,
    "UnscentedKalmanFilter": unscented,
    "EnsembleKalmanFilter": ensemble,
}


def _filled(guest: Any, model: LinearModel) -> Any:
    guest.x, guest.P = model.x0.copy(), model.P0.copy()
    guest.Q, guest.R = model.Q.copy(), model.R.copy()
    return guest


def _root(P: Floats) -> Floats:
    """U (n, n) with U^T U = P, also where P is singular."""
    values, vectors = np.linalg.eigh((P + P.T) / 2)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


@dataclass(frozen=True)
class FilterpyGuest:
    """A filterpy filter of the reduced model (`reduced_linear`), named or made by `make`.

    `make` takes the `LinearModel` and gives a filter with x (n,), P, Q, R set, whose `predict`
    takes the loads (l,) N as `u` and whose `update` takes z (m,). Everything must have been
    measured or nothing: steps with some components missing are predicted only. `seed` is that of
    filters which draw from numpy's global generator.
    """

    handles: ClassVar[Handles] = replace(LINEAR_DYNAMICS, drives=False)
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("load_walk", "R", "load_start")

    make: Make | str = quantity("KalmanFilter", "1", "name, or a function that takes the model")
    dt: float = quantity(0.002, "s", "time step")
    modes: int = quantity(5, "1", "lowest modes kept")
    load_start: float = quantity(0.1, "N", "sd of every load's bias at the start")
    load_walk: float = quantity(0.1, "N/s^0.5", "random walk of every load's bias")
    load_jitter: float = quantity(0.0, "N", "sd of an independent force at each step")
    R: float | None = quantity(None, "m2", "variance of a measurement; none: declared")
    seed: int = quantity(0, "1", "of filters with random draws")
    gate: float | None = gate_setting()
    clock: float | None = clock_setting()
    smooth: bool = smooth_setting()

    def prepare(self, system: System, measurements: Measurements) -> CoreStepper:
        """Raises `SceneError` as `ReducedKf`, `ComparisonError` for a filter that is none, or whose
        shapes are not the model's, `UsageError` for smoothing one whose covariances are its own."""
        require_handled(system.scene, self)
        doubt = LoadDoubt(self.load_start, self.load_walk, self.load_jitter)
        R = measurements.variances(self.R)
        reduced = reduced_model(system, measurements, self.dt, self.modes, doubt, R)
        with seeded(self.seed):
            first = _made(self.make)(reduced.model)
        require_shapes(first, reduced.model)
        if self.smooth:
            require_exact_covariances(first)
        care = care_of(measurements, self.gate, self.clock, self.dt)
        core = GuestCore(reduced, first, self.seed, care)
        table = timetable(measurements, self.dt)
        return CoreStepper(system, core, measurements, table, care, self.smooth)


def _made(make: Make | str) -> Make:
    if not isinstance(make, str):
        return make
    if make not in GUESTS:
        raise ComparisonError(
            f"no external filter '{make}'; expected one of {', '.join(GUESTS)}, or a function"
        )
    return GUESTS[make]


def require_shapes(guest: Any, model: LinearModel) -> None:
    """Raises `ComparisonError` unless the guest's arrays fit the model and each other."""
    n, m = model.size, len(model.H)
    wanted = {"x": (n,), "P": (n, n), "Q": (n, n), "R": (m, m), "F": (n, n), "H": (m, n)}
    for name, shape in wanted.items():
        value = getattr(guest, name, None)
        if value is None and name in ("F", "H"):
            continue  # filters with functions have none
        got = np.shape(value) if value is not None else None
        if got != shape:
            raise ComparisonError(
                f"external filter {type(guest).__name__}.{name}: shape {got}, expected "
                f"{shape}; filterpy would accept it without an error"
            )
        if not np.isfinite(np.asarray(value, dtype=float)).all():
            raise ComparisonError(f"external filter {type(guest).__name__}.{name}: not finite")
    for name in ("P", "Q", "R"):
        require_symmetric(np.asarray(getattr(guest, name)), f"guest {name}")
    for name in ("predict", "update"):
        if not callable(getattr(guest, name, None)):
            raise ComparisonError(
                f"external filter {type(guest).__name__} has no `{name}`: not a filter"
            )


def require_exact_covariances(guest: Any) -> None:
    """Raises `UsageError` unless the guest's P and gain are those of the linear model. filterpy's
    unscented filter takes its gain from points that were moved without the step's noise."""
    from validate.estimate.filterpy.names import KalmanFilter

    if not isinstance(guest, KalmanFilter) or guest.alpha != 1.0:
        raise UsageError(
            "smooth needs the covariances and gains of the model, which "
            f"{type(guest).__name__} does not have: take make='KalmanFilter' (alpha = 1), or "
            "smooth=false"
        )


@dataclass(frozen=True)
class Visit:
    """A guest after a step, and the look that it took; smoothed, what is added to its mean (n,)
    and at output frames taken off its covariance (n, n)."""

    guest: Any
    look: Look | None = None
    more: Floats | float = 0.0
    less: Floats | float = 0.0


@dataclass(frozen=True)
class GuestCore:
    """Every step works on a copy of the guest: a state is never changed from behind."""

    reduced: ReducedModel
    first: Any
    seed: int
    care: Care | None = None

    @property
    def units(self) -> Mapping[str, str]:
        return {}

    def start(self) -> Visit:
        return Visit(copy.deepcopy(self.first))

    def step(
        self, inner: Visit, k: int, loads: Floats, z: Floats | None
    ) -> tuple[Visit, Innovation]:
        guest, model = copy.deepcopy(inner.guest), self.reduced.model
        with seeded(self.seed + k):
            guest.predict(u=loads)
            if z is None or not np.isfinite(z).all():
                return Visit(guest), nothing(len(model.H))
            look, found = self._update(guest, z, model.H @ (guest.x - inner.guest.x))
        require_shapes(guest, model)
        return Visit(guest, look), found

    def _update(self, guest: Any, z: Floats, moved: Floats) -> tuple[Look | None, Innovation]:
        """Changes the guest, unless a gate rejects part of z (m,) m."""
        H, R, gated = self.reduced.model.H, self.reduced.model.R, None
        PHt, shown, offered = guest.P @ H.T, H @ guest.x, z
        if self.care is not None:
            R = R + self.care.together(moved)
            z, gated = self.care.passed(z, shown, H @ PHt + R)
        if not np.isfinite(z).all():
            return None, gated_out(nothing(len(H)), offered, shown, gated)
        gain = best_gain(PHt, H @ PHt + R)
        guest.update(z, R=R) if self.care else guest.update(z)
        found = gated_out(innovation(z, shown, gain), offered, shown, gated)
        return look_of(gain, found), found

    def free(self, inner: Visit) -> Floats:
        return np.asarray(self.reduced.lift @ (inner.guest.x + inner.more))

    def variances(self, inner: Visit) -> Floats:
        lift = self.reduced.lift
        return np.asarray(np.einsum("ij,ij->i", lift @ (inner.guest.P - inner.less), lift))

    def note(self, inner: Visit, framed: bool) -> Note:
        return Note(inner.look, framed)

    def transition(self) -> Transition:
        return dense_covariance(self.reduced.model)

    def corrected(self, inner: Visit, e: Floats, W: Floats | None) -> Visit:
        if W is None:
            return replace(inner, more=e)
        PW = inner.guest.P @ W
        return replace(inner, more=e, less=PW @ PW.T)

    def numbers(self, inner: Visit) -> Mapping[str, float]:
        return {}
