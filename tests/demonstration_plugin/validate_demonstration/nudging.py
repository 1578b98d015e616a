"""Nudging (Newtonian relaxation): the model runs on, and its output follows the measurements.

u = u_model + L b, where b follows the innovation with a constant gain and L (N, m) is the static
displacement that moves the measured components by one unit each.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.sparse.linalg import spsolve

from validate.arrays import Floats
from validate.estimate.gating import NoiseSettings
from validate.estimate.kalman.coordinates import Batch
from validate.estimate.measurements import Measurements, Timetable
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.dynamic.newmark import Newmark
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled
from validate.solve.types import State, Stepper


@dataclass(frozen=True)
class Nudging:
    """`gain`: share of an innovation that one measurement removes."""

    handles: ClassVar[Handles] = LINEAR_DYNAMICS
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings(measurement="")

    dt: float = quantity(0.002, "s", "time step")
    gain: float = quantity(0.2, "1", "share of an innovation that one measurement removes")

    def prepare(self, system: System, measurements: Measurements) -> "NudgedStepper":
        """Raises `SceneError` as `Newmark`, `ComparisonError` for times off the steps."""
        require_handled(system.scene, self)
        free = system.free
        H = measurements.H[:, free].toarray()
        reached = spsolve(system.K[free][:, free].tocsc(), H.T).reshape(H.T.shape)
        L = np.zeros((system.K.shape[0], len(H)))
        L[free] = np.linalg.solve((H @ reached).T, reached.T).T
        table = measurements.timetable(self.dt)
        return NudgedStepper(Newmark(self.dt).prepare(system), measurements, table, L, self.gain)


@dataclass(frozen=True)
class NudgedStepper:
    """The prepared filter; a state holds the model's and the offset b (m,) m."""

    model: Stepper
    offered: Measurements
    table: Timetable
    shapes: Floats
    gain: float

    @property
    def scene(self) -> Scene:
        return self.model.scene

    @property
    def units(self) -> Mapping[str, str]:
        return {f"innovation.{name}": "m" for name in self.offered.names}

    def rest(self) -> State:
        inner = (self.model.rest(), np.zeros(len(self.offered.names)))
        return State(0, inner, numbers=dict.fromkeys(self.units, 0.0))

    def step(self, state: State, inputs: Floats) -> State:
        before, offset = state.inner
        after = self.model.step(before, inputs)
        innovation, z = np.zeros(len(offset)), self.table.at(state.k + 1)
        if z is not None:
            seen = self.offered.H @ self.model.field(after).ravel() + offset
            innovation = np.where(np.isfinite(z), z - seen, 0.0)
        numbers = dict(zip(self.units, map(float, innovation), strict=True))
        inner = (after, offset + self.gain * innovation)
        return State(state.k + 1, inner, after.failure, numbers=numbers)

    def field(self, state: State) -> Floats:
        after, offset = state.inner
        u = self.model.field(after)
        return u + (self.shapes @ offset).reshape(u.shape)

    def batch(self, inputs: Floats, z: Floats, rows: Floats) -> Batch | None:
        return None
