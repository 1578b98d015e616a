"""Filter of one amplitude and the scale of a load, for quasi-static scenes.

u = a s with the static displacement s of the load; a follows scale * a_static with the shape's own
time constant, which all modes share under stiffness damping alone, as in paper 001's cube. A wrong
modulus is a wrong scale, which one measured node shows and every node then gains from. No inertia:
where the shape would swing, `prepare` refuses.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.estimate.gating import Care, NoiseSettings, care_of, clock_setting, gate_setting
from validate.estimate.kalman.covariance import Dense
from validate.estimate.kalman.displacement_filter import load_shapes
from validate.estimate.kalman.formulas import (
    Gaussian,
    Innovation,
    kf_predict,
    kf_update,
    nothing,
)
from validate.estimate.measurements import Measurements
from validate.estimate.reduced.reduced_kf import CoreStepper
from validate.estimate.smoother import Look, Note, Transition, look_of, smooth_setting
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled

OVERDAMPED = 2.0  # damping ratio below which inertia shows in the shape's answer


@dataclass(frozen=True)
class LoadScale:
    """`scale_sd` is the initial uncertainty of the scale (1 = none), `walk` its growth per sqrt(s);
    `Q` m^2 the variance that a step adds to the amplitude, R m^2 (None: the measurements' own)."""

    handles: ClassVar[Handles] = replace(LINEAR_DYNAMICS, inertia=False, drives=False)
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("Q", "R", "scale_sd")

    dt: float = quantity(0.002, "s", "time step")
    scale_sd: float = quantity(0.5, "1", "uncertainty of the scale at the start")
    walk: float = quantity(0.0, "1/s^0.5", "random walk of the scale")
    Q: float = quantity(1e-14, "m2", "variance that a step adds to the amplitude")
    R: float | None = quantity(None, "m2", "variance of a measurement; none: declared")
    gate: float | None = gate_setting()
    clock: float | None = clock_setting()
    smooth: bool = smooth_setting()

    def prepare(self, system: System, measurements: Measurements) -> CoreStepper:
        """Raise `SceneError` unless one load moves the scene and the shape creeps, not swings."""
        require_handled(system.scene, self)
        if len(system.scene.loads) != 1:
            raise SceneError(f"{len(system.scene.loads)} loads: one shape needs exactly one load")
        H = measurements.free(system.free)
        shape = load_shapes(system, H)[:, 0]
        care = care_of(measurements, self.gate, self.clock, self.dt)
        free = system.free
        m, c, k = (
            float(shape @ (X[free][:, free] @ shape)) for X in (system.M, system.C, system.K)
        )
        ratio = c / (2 * np.sqrt(m * k))
        if ratio < OVERDAMPED:
            raise SceneError(
                f"the load's shape has damping ratio {ratio:.2g}, so it oscillates: a filter "
                f"without inertia needs {OVERDAMPED:g}; use ReducedKf"
            )
        per_newton = float(shape @ system.loads[free, 0]) / k
        core = ScaleCore(
            self,
            shape,
            H @ shape,
            measurements.variances(self.R),
            float(np.exp(-self.dt * k / c)),
            per_newton,
            care,
        )
        table = measurements.timetable(self.dt)
        return CoreStepper(system, core, measurements, table, care, self.smooth)


@dataclass(frozen=True)
class Scaled:
    """Amplitude and scale after a step, A (2, 2) of that step and the look that it took."""

    x: Gaussian
    A: Floats
    look: Look | None = None


@dataclass(frozen=True)
class ScaleCore:
    """`keep` of the amplitude stays over a step; `per_newton` m/N is its static value."""

    settings: LoadScale
    shape: Floats
    seen: Floats
    R: Floats
    keep: float
    per_newton: float
    care: Care | None = None

    @property
    def units(self) -> Mapping[str, str]:
        return {"load.scale": "1"}

    @property
    def H(self) -> Floats:
        return np.outer(self.seen, [1.0, 0.0])

    @property
    def Q(self) -> Floats:
        s = self.settings
        return np.diag([s.Q, s.walk**2 * s.dt])

    def start(self) -> Scaled:
        doubt = np.diag([0.0, self.settings.scale_sd**2])
        return Scaled(Gaussian(np.array([0.0, 1.0]), doubt), np.eye(2))

    def step(
        self, inner: Scaled, k: int, loads: Floats, z: Floats | None
    ) -> tuple[Scaled, Innovation]:
        static = (1 - self.keep) * self.per_newton * loads[0]
        A = np.array([[self.keep, static], [0.0, 1.0]])
        prior = kf_predict(inner.x, A, self.Q)
        if z is None:
            return Scaled(prior, A), nothing(len(self.seen))
        R, update = np.diag(self.R), None
        if self.care is not None:
            moved = self.seen * (prior.x[0] - inner.x.x[0])
            update, seen = self.care.linear_update(prior, z, self.H, R, moved)
        else:
            update = kf_update(prior, z, self.H, R)
            seen = update.innovation
        if update is None:
            return Scaled(prior, A), seen
        return Scaled(update.posterior, A, look_of(update.gain, seen)), seen

    def free(self, inner: Scaled) -> Floats:
        return np.asarray(self.shape * inner.x.x[0])

    def variances(self, inner: Scaled) -> Floats:
        return np.asarray(self.shape**2 * inner.x.P[0, 0])

    def numbers(self, inner: Scaled) -> Mapping[str, float]:
        return {"load.scale": float(inner.x.x[1])}

    def _across(self, A: Floats) -> Dense:
        return Dense(A, self.Q, self.H, self.R, self.start().x.P)

    def note(self, inner: Scaled, framed: bool) -> Note:
        return Note(inner.look, framed, self._across(inner.A))

    def transition(self) -> Transition:
        return self._across(np.eye(2))

    def corrected(self, inner: Scaled, e: Floats, W: Floats | None) -> Scaled:
        PW = inner.x.P @ W if W is not None else np.zeros((2, 0))
        return replace(inner, x=Gaussian(inner.x.x + e, inner.x.P - PW @ PW.T))
