"""Proportional pressure control of paper 000 and its variants, with the cost of each update.

P <- P + G (1 - V/V0) until |1 - V/V0| <= tolerance (paper 000, eqs 9 and 10). They differ in G:

- proportional: the line through the pressure-volume curve of the cavity alone (section 3.3);
- retuned: the same line with the tool where it is now;
- piecewise: the chord of that curve (section 3.3's other proposal) over the stretch of it that the
  error spans;
- secant: the slope between the last two pressures, the first one by the line;
- newton: the exact slope at the pressure, a matrix for several cavities.

golden: section 3.3's line search instead, on |1 - V/V0| of one cavity, within 30 % of volume.
For several cavities the gains of the first are each cavity's own, one common, or a matrix.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses, System
from validate.parameters import quantity
from validate.solve.fluid.cavities import FLUID, Settling
from validate.solve.fluid.pressure_curve import (
    RATIOS,
    ROUNDING,
    pressure_at_volume,
    slopes,
    still,
    tuned_gain,
)
from validate.solve.handles import Handles, require_handled
from validate.solve.static.quasi_static import condensed
from validate.solve.study_entries import Rival, StillBody, StudyBody
from validate.solve.types import State, Stepper

UpdateName = Literal["proportional", "retuned", "piecewise", "secant", "newton", "golden"]
_GOLDEN = (np.sqrt(5.0) - 1) / 2
_REACH = 0.3  # of volume: how far to either side a line search looks
_FLAT = 1e-12  # of V/V0: two volumes that say nothing about a slope


@dataclass(frozen=True)
class PressureLoop:
    """Pressure updates until the volume is kept to a tolerance; see the module's head.

    Source: paper 000, eqs 9 and 10, section 5.2. `gain` Pa; None tunes it as section 3.3 does.
    `warm_start` begins each step at the last pressure, as the haptic loop does.
    """

    handles: ClassVar[Handles] = FLUID

    gain: float | None = quantity(None, "Pa", "Kp; none: tuned to the response of the volume")
    tolerance: float = quantity(0.01, "1", "|1 - V/V0| at which it stops")
    max_updates: int = quantity(100, "1", "of the pressure in a step")
    warm_start: bool = quantity(True, "1", "start from the pressure of the last step")
    update: UpdateName = quantity("proportional", "1", "method for the next pressure")
    gains: Literal["own", "common", "matrix"] = quantity(
        "own", "1", "several cavities: one gain each, their mean, or coupled"
    )

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not (isinstance(asked, StillBody) and asked.cavities):
            return ()
        name = "condensed, paper's loop at 1 %"
        return (Rival(name, "condensed", lambda dt: PressureLoop(), stepped=False),)

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for a line search on several cavities."""
        require_handled(system.scene, self)
        return self.on(Responses.of(system))

    def on(self, responses: Responses) -> Stepper:
        """Return the scheme on columns that are there already."""
        count = len(responses.volumes)
        if self.update in ("golden", "piecewise") and count > 1:
            raise SceneError(
                f"update '{self.update}' supports one cavity, the scene has {count}; use newton"
            )
        curve = pressure_at_volume(responses, RATIOS) if self.update == "piecewise" else RATIOS
        gains = gain_matrix(responses, self)
        return LoopStepper(responses, condensed(responses), gains, self, curve)

    def spectral_radius(self, responses: Responses, z: Floats) -> float:
        """Return that of I - (dV/dP / V0) G at amounts (1, z) of the columns: what an update leaves
        of a small volume error. Below 1 the loop converges there."""
        left = np.eye(len(responses.volumes)) - slopes(responses, z) @ gain_matrix(responses, self)
        return float(np.abs(np.linalg.eigvals(left)).max(initial=0.0))


def gain_matrix(responses: Responses, settings: PressureLoop) -> Floats:
    """G (c, c) Pa: what the pressures change by, per volume error of each cavity."""
    count = len(responses.volumes)
    if settings.gains == "matrix" and settings.gain is None:
        return np.asarray(np.linalg.inv(slopes(responses, still(responses))))
    own = [tuned_gain(responses, i) if settings.gain is None else settings.gain
           for i in range(count)]  # fmt: skip
    common = settings.gains == "common" and count > 0
    return np.diag(np.full(count, np.mean(own)) if common else np.array(own))


@dataclass(frozen=True)
class LoopStepper(Settling):
    """`gains` (c, c) Pa; `curve` Pa over `RATIOS` of volume, where the update reads one."""

    gains: Floats
    settings: PressureLoop
    curve: Floats

    def step(self, state: State, inputs: Floats) -> State:
        k = self.responses.drives
        start = state.inner.z[k:] if self.settings.warm_start else np.zeros(len(self.gains))
        z = np.concatenate([[1.0], inputs, start])
        if self.settings.update == "golden":
            return self._searched(state, z)
        volumes, V0, last = self.responses.volumes, self.responses.rest_volumes, np.inf
        before: tuple[Floats, Floats] | None = None
        gains = self.gains
        if self.settings.update == "retuned":  # the line of each cavity's curve with these drives
            gains = np.diag([tuned_gain(self.responses, i, z) for i in range(len(self.gains))])
        for updates in range(self.settings.max_updates + 1):
            ratios = (volumes @ z @ z @ z) / V0
            error = 1 - ratios
            worst = float(np.abs(error).max(initial=0.0))
            if worst <= self.settings.tolerance or last <= worst <= ROUNDING:
                return self._settled(state.k + 1, z, updates, ratios)
            if not worst < 1e3:
                why = f"volume error {worst:.1e} after {updates} updates, gain too large"
                return replace(state, updates=updates, failure=("diverged", why))
            if updates == self.settings.max_updates:
                break
            step, before = self._step(z, error, gains, before), (z[k + 1 :].copy(), error)
            z[k + 1 :] += step
            last = worst
        return self._unsettled(state.k + 1, z, worst, self.settings.max_updates)

    def _step(
        self, z: Floats, error: Floats, gains: Floats, before: tuple[Floats, Floats] | None
    ) -> Floats:
        """The change of the pressures (c,) Pa."""
        match self.settings.update:
            case "newton":
                return np.asarray(np.linalg.solve(slopes(self.responses, z), error))
            case "piecewise":
                # Pa between V/V0 = 1 - error and 1 on the cavity's own curve, in pieces of 1 %
                reached = float(np.clip(1 - error[0], RATIOS[0], RATIOS[-1]))
                ends = np.interp([reached, 1.0], RATIOS, self.curve)
                beyond = float(self.gains[0, 0]) * (float(error[0]) - (1 - reached))
                return np.array([float(ends[1] - ends[0]) + beyond])
            case "secant" if before is not None:
                # Each cavity by the slope it has just shown, by the gain where it showed none
                moved, gone = z[self.responses.drives + 1 :] - before[0], before[1] - error
                seen = np.abs(gone) > _FLAT
                found = np.divide(moved, gone, out=np.diag(gains).copy(), where=seen)
                return np.asarray(found * error)
        return np.asarray(gains @ error)

    def _searched(self, state: State, z: Floats) -> State:
        """Golden section on |1 - V/V0| between the pressures that the gain takes for +-30 %."""
        p = self.responses.drives + 1

        def off(P: float) -> float:
            z[p] = P
            return abs(1 - float(self.ratios(z)[0]))

        start, reach = float(z[p]), _REACH * float(self.gains[0, 0])
        worst, updates = off(start), 0
        low, high = start - reach, start + reach
        inner = [high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)]
        errors = [off(inner[0]), off(inner[1])]
        while worst > self.settings.tolerance and updates < self.settings.max_updates:
            updates += 1
            better = int(errors[1] < errors[0])
            worst, best = errors[better], inner[better]
            if better:
                low, inner, errors = inner[0], [inner[1], 0.0], [errors[1], 0.0]
                inner[1] = low + _GOLDEN * (high - low)
                errors[1] = off(inner[1])
            else:
                high, inner, errors = inner[1], [0.0, inner[0]], [0.0, errors[0]]
                inner[0] = high - _GOLDEN * (high - low)
                errors[0] = off(inner[0])
            start = best
        z[p] = start
        if worst <= self.settings.tolerance:
            return self._settled(state.k + 1, z, updates)
        return self._unsettled(state.k + 1, z, worst, updates)

    def _unsettled(self, k: int, z: Floats, worst: float, updates: int) -> State:
        why = (
            f"volume error {worst:.2%} after {updates} updates, tolerance "
            f"{self.settings.tolerance:.2%}, gain {np.diag(self.gains).tolist()} Pa"
        )
        return self._state(k, z, updates, ("not_converged", why))
