"""filterpy's filters as methods of an experiment, with checks of their array shapes.

filterpy accepts a P of the wrong size, and a 1-D z with a column x turns x into a matrix. The
checks here refuse both, before the first step and after every step.
"""

import copy
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, UsageError
from validate.estimate.gating import (
    Care,
    NoiseSettings,
    care_of,
    clock_setting,
    gate_setting,
    gated_out,
)
from validate.estimate.kalman.formulas import Innovation, best_gain, innovation, nothing
from validate.estimate.measurements import Measurements
from validate.estimate.reduced.reduced_kf import (
    CoreStepper,
    LinearModel,
    LoadDoubt,
    ReducedModel,
    dense_covariance,
    reduced_model,
    require_symmetric,
)
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
    from validate.estimate.filterpy.classes import KalmanFilter  # filterpy takes 0.6 s

    kf = KalmanFilter(model.size, len(model.H), model.B.shape[1])
    kf.F, kf.B, kf.H = model.F.copy(), model.B.copy(), model.H.copy()
    return _filled(kf, model)


def unscented(model: LinearModel) -> Any:
    """filterpy's `UnscentedKalmanFilter`; its roots are symmetric ones, since P0 may be singular.

    Its f takes the loads as keyword `u` of `predict`.
    """
    from validate.estimate.filterpy.classes import MerweScaledSigmaPoints, UnscentedKalmanFilter

    points = MerweScaledSigmaPoints(model.size, 1.0, 2.0, 0.0, sqrt_method=_root)

    def f(x: Floats, _: float, u: Floats) -> Floats:
        return model.F @ x + model.B @ u

    m = len(model.H)
    return _filled(
        UnscentedKalmanFilter(model.size, m, 1.0, lambda x: model.H @ x, f, points), model
    )


def ensemble(model: LinearModel) -> Any:
    """filterpy's `EnsembleKalmanFilter` with 50 members, whose `predict` takes the loads."""
    from validate.estimate.filterpy.classes import Ensemble

    enkf = Ensemble(model)
    enkf.Q, enkf.R = model.Q.copy(), model.R.copy()
    return enkf


FILTERPY_FILTERS: dict[str, Make] = {
    "KalmanFilter": kalman,
    "UnscentedKalmanFilter": unscented,
    "EnsembleKalmanFilter": ensemble,
}


def _filled(filter_: Any, model: LinearModel) -> Any:
    filter_.x, filter_.P = model.x0.copy(), model.P0.copy()
    filter_.Q, filter_.R = model.Q.copy(), model.R.copy()
    return filter_


def _root(P: Floats) -> Floats:
    """U (n, n) with U^T U = P, also where P is singular."""
    values, vectors = np.linalg.eigh((P + P.T) / 2)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


@dataclass(frozen=True)
class FilterpyFilter:
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
        """Raise `SceneError` as `ReducedKf`, `ComparisonError` for a filter that is none, or whose
        shapes are not the model's, `UsageError` for smoothing one whose covariances are its own."""
        require_handled(system.scene, self)
        doubt = LoadDoubt(self.load_start, self.load_walk, self.load_jitter)
        R = measurements.variances(self.R)
        reduced = reduced_model(system, measurements, self.dt, self.modes, doubt, R)
        make = self.make
        if isinstance(make, str):
            if make not in FILTERPY_FILTERS:
                raise ComparisonError(
                    f"no external filter '{make}'; expected one of {', '.join(FILTERPY_FILTERS)}, "
                    "or a function"
                )
            make = FILTERPY_FILTERS[make]
        with seeded(self.seed):
            first = make(reduced.model)
        require_shapes(first, reduced.model)
        if self.smooth:
            require_exact_covariances(first)
        care = care_of(measurements, self.gate, self.clock, self.dt)
        core = FilterpyCore(reduced, first, self.seed, care)
        table = measurements.timetable(self.dt)
        return CoreStepper(system, core, measurements, table, care, self.smooth)


def require_shapes(filter_: Any, model: LinearModel) -> None:
    """Raise `ComparisonError` unless the filter's arrays fit the model and each other."""
    n, m, kind = model.size, len(model.H), type(filter_).__name__
    wanted = {"x": (n,), "P": (n, n), "Q": (n, n), "R": (m, m), "F": (n, n), "H": (m, n)}
    for name, shape in wanted.items():
        value = getattr(filter_, name, None)
        if value is None and name in ("F", "H"):
            continue  # filters with functions have none
        got = np.shape(value) if value is not None else None
        if got != shape:
            raise ComparisonError(
                f"external filter {kind}.{name}: shape {got}, expected "
                f"{shape}; filterpy would accept it without an error"
            )
        if not np.isfinite(np.asarray(value, dtype=float)).all():
            raise ComparisonError(f"external filter {kind}.{name}: not finite")
    for name in ("P", "Q", "R"):
        require_symmetric(np.asarray(getattr(filter_, name)), f"external filter {kind}.{name}")
    for name in ("predict", "update"):
        if not callable(getattr(filter_, name, None)):
            raise ComparisonError(f"external filter {kind} has no `{name}`: not a filter")


def require_exact_covariances(filter_: Any) -> None:
    """Raise `UsageError` unless P and gain of the filter are those of the linear model.

    filterpy's unscented filter computes its gain from points without the step's noise."""
    from validate.estimate.filterpy.classes import KalmanFilter

    if not isinstance(filter_, KalmanFilter) or filter_.alpha != 1.0:
        raise UsageError(
            "smooth needs the covariances and gains of the model, which "
            f"{type(filter_).__name__} does not have: take make='KalmanFilter' (alpha = 1), or "
            "smooth=false"
        )


@dataclass(frozen=True)
class Visit:
    """A filterpy filter after a step, and its measurement `look`.

    The smoother adds `more` (n,) to the mean, and at output frames subtracts `less` (n, n) from
    the covariance.
    """

    filter: Any
    look: Look | None = None
    more: Floats | float = 0.0
    less: Floats | float = 0.0


@dataclass(frozen=True)
class FilterpyCore:
    """Steps of a filterpy filter. Each step changes a copy, never the given state."""

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
        filter_, model = copy.deepcopy(inner.filter), self.reduced.model
        with seeded(self.seed + k):
            filter_.predict(u=loads)
            if z is None or not np.isfinite(z).all():
                return Visit(filter_), nothing(len(model.H))
            look, found = self._update(filter_, z, model.H @ (filter_.x - inner.filter.x))
        require_shapes(filter_, model)
        return Visit(filter_, look), found

    def _update(self, filter_: Any, z: Floats, moved: Floats) -> tuple[Look | None, Innovation]:
        """Update the filter, unless a gate rejects part of z (m,) m."""
        H, R, gated = self.reduced.model.H, self.reduced.model.R, None
        PHt, shown, offered = filter_.P @ H.T, H @ filter_.x, z
        if self.care is not None:
            R = R + self.care.together(moved)
            z, gated = self.care.passed(z, shown, H @ PHt + R)
        if not np.isfinite(z).all():
            return None, gated_out(nothing(len(H)), offered, shown, gated)
        gain = best_gain(PHt, H @ PHt + R)
        filter_.update(z, R=R) if self.care else filter_.update(z)
        found = gated_out(innovation(z, shown, gain), offered, shown, gated)
        return look_of(gain, found), found

    def free(self, inner: Visit) -> Floats:
        return np.asarray(self.reduced.lift @ (inner.filter.x + inner.more))

    def variances(self, inner: Visit) -> Floats:
        lift = self.reduced.lift
        return np.asarray(np.einsum("ij,ij->i", lift @ (inner.filter.P - inner.less), lift))

    def note(self, inner: Visit, framed: bool) -> Note:
        return Note(inner.look, framed)

    def transition(self) -> Transition:
        return dense_covariance(self.reduced.model)

    def corrected(self, inner: Visit, e: Floats, W: Floats | None) -> Visit:
        if W is None:
            return replace(inner, more=e)
        PW = inner.filter.P @ W
        return replace(inner, more=e, less=PW @ PW.T)

    def numbers(self, inner: Visit) -> Mapping[str, float]:
        return {}
