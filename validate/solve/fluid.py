"""The pressure of an incompressible fluid in linear elastic cavities, three ways.

All work on the response columns: u = sum_a z_a u_a with z = (drives, pressures), so a cavity's
volume is a cubic polynomial in z (fixed normals: exact, not a series) and needs no facets.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses, System
from validate.fem.system import responses as responses_of
from validate.parameters import quantity
from validate.solve.handles import GLUED, Handles, require_handled
from validate.solve.linear import LinearStepper, condensed
from validate.solve.types import Ending, State, Stepper

_COLUMNS = Handles(("linear",), inertia=False, cavities=True, loads=False, contact=GLUED)
_NEWTON_STEPS = 30
_ROUNDING = 4e-15  # relative volume error that rounding alone leaves


@dataclass(frozen=True)
class NoFluid:
    """The cavity is empty: gauge pressure zero, its volume changes freely."""

    handles: ClassVar[Handles] = _COLUMNS

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(responses_of(system))

    def on(self, responses: Responses) -> Stepper:
        """The scheme on columns that are there already."""
        return DryStepper(responses, condensed(responses))


@dataclass(frozen=True)
class ExactPressure:
    """The root of the volume polynomial: V(drives, P) = volume_ratio V0, by Newton.

    Departures from paper 000: eq 10 is replaced by the root it tends to; no tolerance, no gain.
    """

    handles: ClassVar[Handles] = _COLUMNS

    volume_ratio: float = quantity(1.0, "1", "volume of the fluid over that of the cavity at rest")

    def __post_init__(self) -> None:
        if not self.volume_ratio > 0:
            raise SceneError(f"volume ratio {self.volume_ratio:g}: a fluid volume must be positive")

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(responses_of(system))

    def on(self, responses: Responses) -> Stepper:
        """The scheme on columns that are there already."""
        return ExactStepper(responses, condensed(responses), self.volume_ratio)


@dataclass(frozen=True)
class PressureLoop:
    """The paper's proportional law, P <- P + Kp (1 - V/V0) until |1 - V/V0| <= tolerance.

    Source: paper 000, eqs 9 and 10, section 5.2. `gain` Pa; None tunes it as section 3.3 does.
    `warm_start` begins each step at the last pressure, as the haptic loop does.
    """

    handles: ClassVar[Handles] = _COLUMNS

    gain: float | None = quantity(None, "Pa", "Kp; none: tuned on the volume's response")
    tolerance: float = quantity(0.01, "1", "|1 - V/V0| at which it stops")
    max_updates: int = quantity(100, "1", "of the pressure in a step")
    warm_start: bool = quantity(True, "1", "begin at the last step's pressure")

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(responses_of(system))

    def on(self, responses: Responses) -> Stepper:
        """The scheme on columns that are there already."""
        cavities = range(len(responses.volumes))
        gains = [tuned_gain(responses, i) if self.gain is None else self.gain for i in cavities]
        return LoopStepper(responses, condensed(responses), np.array(gains), self)


def tuned_gain(responses: Responses, cavity: int = 0) -> float:
    """Kp Pa: least-squares slope of P over V/V0, 61 points uniform in V/V0 from 0.7 to 1.3."""
    ratios = np.linspace(0.7, 1.3, 61)
    pressures = pressure_at_volume(responses, ratios, cavity)
    return float(np.polyfit(ratios, pressures, 1)[0])


def pressure_at_volume(responses: Responses, ratios: Floats, cavity: int = 0) -> Floats:
    """P (k,) Pa that gives V/V0 = ratios (k,) with drives and other cavities at zero (Fig. 4a).

    Raises `SceneError` when no pressure does: a ratio of zero or less, or below the smallest.
    """
    form = responses.volumes[cavity]
    p = responses.drives + 1 + cavity
    cubic = np.array([form[p, p, p], 3 * form[0, p, p], 3 * form[0, 0, p], form[0, 0, 0]])
    return np.array([_cubic_root(cubic, float(ratio)) for ratio in ratios])


def _cubic_root(cubic: Floats, ratio: float) -> float:
    """The root on the branch through zero: no turning point of the cubic lies in between."""
    shifted = cubic.copy()
    shifted[3] -= ratio * cubic[3]
    turns = _real_roots(np.asarray(np.polyder(cubic), dtype=np.float64))
    roots = [
        p for p in _real_roots(shifted) if not ((turns > min(p, 0.0)) & (turns < max(p, 0.0))).any()
    ]
    if ratio <= 0 or not roots:
        raise SceneError(f"no pressure gives V/V0 = {ratio:g}; ask for a ratio nearer to 1")
    return float(min(roots, key=abs))


def _real_roots(polynomial: Floats) -> Floats:
    roots = np.roots(polynomial)
    return np.asarray(roots.real[np.abs(roots.imag) <= 1e-9 * (1 + np.abs(roots.real))])


@dataclass(frozen=True)
class _Settling(LinearStepper):
    def _settled(self, k: int, z: Floats, updates: int, ratios: Floats | None = None) -> State:
        """The state of a root z; a failure when it is not on the branch that begins at P = 0."""
        drives = self.responses.drives
        if _least_slope(self.responses.volumes, z, drives) > 0:
            return self._state(k, z, updates, ratios=ratios)
        why = (
            f"pressures {z[drives + 1 :].tolist()} Pa are a spurious root: between zero and there "
            "the volume falls as pressure grows; check the gain's sign and the load"
        )
        return self._state(k, z, updates, ("not_converged", why), ratios)


def _rises(a: float, b: float, c: float, P: float) -> bool:
    """Whether a P^3 + b P^2 + c P + d grows with P all the way from 0 to P."""
    turn = -b / (3 * a) if a else 0.0
    places = [0.0, P, *([turn] if min(P, 0.0) < turn < max(P, 0.0) else [])]
    return all((3 * a * x + 2 * b) * x + c > 0 for x in places)


def _least_slope(forms: Floats, z: Floats, drives: int) -> float:
    """The least dV_i/dP_i of any cavity on the way t P, 0 <= t <= 1: a quadratic in t, exactly."""
    empty = z.copy()
    empty[drives + 1 :] = 0
    least = np.inf
    for i, form in enumerate(forms):
        own = form[drives + 1 + i]
        start, middle, end = (float(y @ own @ y) for y in (empty, (empty + z) / 2, z))
        b, c = 4 * middle - 3 * start - end, 2 * (start + end) - 4 * middle
        t = min(max(-b / (2 * c), 0.0), 1.0) if c > 0 else 0.0
        least = min(least, start, end, start + t * (b + t * c))
    return least


@dataclass(frozen=True)
class DryStepper(LinearStepper):
    def step(self, state: State, inputs: Floats) -> State:
        still = np.zeros(len(self.responses.volumes))
        return self._state(state.k + 1, np.concatenate([[1.0], inputs, still]), 0)


@dataclass(frozen=True)
class ExactStepper(_Settling):
    volume_ratio: float

    def step(self, state: State, inputs: Floats) -> State:
        one = len(self.responses.volumes) == 1
        return self._one_cavity(state, inputs) if one else self._cavities(state, inputs)

    def _one_cavity(self, state: State, drives: Floats) -> State:
        """Newton on the scalar cubic in P: with the drives fixed its coefficients are numbers."""
        form, p = self.responses.volumes[0], len(drives) + 1
        z = np.concatenate([[1.0], drives, [0.0]])
        W = form @ z
        y = W @ z
        V0 = float(form[0, 0, 0])
        target = self.volume_ratio * V0
        a, b, c = float(form[p, p, p]), 3 * float(W[p, p]), 3 * float(y[p])
        d = float(y @ z) - target
        P, failed = float(state.inner.z[p - 1]), ""
        for updates in range(_NEWTON_STEPS):
            error = ((a * P + b) * P + c) * P + d
            slope = (3 * a * P + 2 * b) * P + c
            if abs(error) <= _ROUNDING * target or slope == 0:
                break
            step = error / slope
            P -= step
            if abs(step) <= 1e-14 * abs(P):
                updates += 1
                break
        z[p] = P
        if abs(error) > 1e-9 * target:
            failed = f"error {error / target:.2%} after {updates} Newton steps"
        elif not _rises(a, b, c, P):
            failed = f"P = {P:.4g} Pa is a spurious root: volume falls as pressure grows before it"
        ratio = np.array([(((a * P + b) * P + c) * P + d + target) / V0])
        why: tuple[Ending, str] = ("not_converged", f"no pressure keeps the volume: {failed}")
        return self._state(state.k + 1, z, updates, why if failed else None, ratio)

    def _cavities(self, state: State, drives: Floats) -> State:
        """Newton on all volumes together; one cavity's pressure changes the others' volumes."""
        forms, k = self.responses.volumes, self.responses.drives
        target = self.volume_ratio * self.responses.rest_volumes
        z = np.concatenate([[1.0], drives, state.inner.z[k:]])
        for updates in range(_NEWTON_STEPS):
            slopes = forms @ z @ z
            error = slopes @ z - target
            if np.abs(error / target).max(initial=0.0) <= _ROUNDING:
                return self._settled(state.k + 1, z, updates)
            step = np.linalg.solve(3 * slopes[:, k + 1 :], error)
            z[k + 1 :] -= step
            if np.abs(step).max() <= 1e-14 * np.abs(z[k + 1 :]).max():
                return self._settled(state.k + 1, z, updates + 1)
        worst = float(np.abs(error / target).max())
        why = f"no pressure keeps the volume: error {worst:.2%} after {_NEWTON_STEPS} Newton steps"
        return self._state(state.k + 1, z, _NEWTON_STEPS, ("not_converged", why))


@dataclass(frozen=True)
class LoopStepper(_Settling):
    gains: Floats
    settings: PressureLoop

    def step(self, state: State, inputs: Floats) -> State:
        volumes, V0 = self.responses.volumes, self.responses.rest_volumes
        k, last = self.responses.drives, np.inf
        start = state.inner.z[k:] if self.settings.warm_start else np.zeros(len(self.gains))
        z = np.concatenate([[1.0], inputs, start])
        for updates in range(self.settings.max_updates + 1):
            ratios = (volumes @ z @ z @ z) / V0
            error = 1 - ratios
            worst = float(np.abs(error).max(initial=0.0))
            if worst <= self.settings.tolerance or last <= worst <= _ROUNDING:
                return self._settled(state.k + 1, z, updates, ratios)
            if not worst < 1e3:
                why = f"volume error {worst:.1e} after {updates} updates, gain too large"
                return replace(state, updates=updates, failure=("diverged", why))
            z[k + 1 :] += self.gains * error
            last = worst
        why = (
            f"volume error {worst:.2%} after {self.settings.max_updates} updates, tolerance "
            f"{self.settings.tolerance:.2%}, gain {self.gains.tolist()} Pa"
        )
        return self._state(state.k + 1, z, self.settings.max_updates, ("not_converged", why))
