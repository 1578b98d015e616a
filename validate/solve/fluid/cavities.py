"""Pressure of a fluid in linear elastic cavities: from volumes, or prescribed.

All work on the response columns: u = sum_a z_a u_a with z = (drives, pressures), so a cavity's
volume is a cubic polynomial in z (fixed normals: exact, not a series) and needs no facets. A fluid
whose volume is V/V0 = ratio - softness P leaves one polynomial root per cavity, found by Newton.

Prescribed pressures over time: a pulse, or a constant. Beyond paper 000, which only names it. A
pressure that is given needs no iteration: the volume follows. A linear model with fixed normals
holds to some 30 % of volume (paper 000, section 3.3); what lies beyond is counted, not hidden.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses, System
from validate.parameters import quantity
from validate.solve.fluid.pressure_curve import NEWTON_STEPS, ROUNDING, cubic, least_slope, root_of
from validate.solve.handles import GLUED, Handles, require_handled
from validate.solve.static.quasi_static import LinearStepper, condensed
from validate.solve.study_entries import Rival, StillBody, StudyBody
from validate.solve.types import Ending, State, Stepper

FLUID = Handles(("linear",), inertia=False, cavities=True, loads=False, contact=GLUED)


@dataclass(frozen=True)
class NoFluid:
    """The cavity is empty: gauge pressure zero, its volume changes freely."""

    handles: ClassVar[Handles] = FLUID

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not (isinstance(asked, StillBody) and asked.cavities):
            return ()
        return (
            Rival("superposition, cavity empty", "static superposition", lambda dt: NoFluid(),
                   stepped=False, lacks="the fluid and its pressure"),
        )  # fmt: skip

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(Responses.of(system))

    def on(self, responses: Responses) -> Stepper:
        """The scheme on columns that are there already."""
        return DryStepper(responses, condensed(responses))


@dataclass(frozen=True)
class ExactPressure:
    """The root of the volume polynomial: V(drives, P) = volume_ratio (1 - P/bulk_modulus) V0.

    Departures from paper 000: eq 10 is replaced by the root it tends to; no tolerance, no gain.
    """

    handles: ClassVar[Handles] = FLUID

    volume_ratio: float = quantity(1.0, "1", "volume of the fluid over that of the cavity at rest")
    bulk_modulus: float | None = quantity(None, "Pa", "of the fluid; none: incompressible")

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not (isinstance(asked, StillBody) and asked.cavities):
            return ()
        name = "condensed, exact pressure"
        return (Rival(name, "condensed", lambda dt: ExactPressure(), stepped=False),)

    def __post_init__(self) -> None:
        if not self.volume_ratio > 0:
            raise SceneError(
                f"volume ratio {self.volume_ratio:g}: expected a positive fluid volume"
            )
        if self.bulk_modulus is not None and not 0 < self.bulk_modulus < math.inf:
            raise SceneError(
                f"bulk modulus {self.bulk_modulus:g} Pa: expected a positive value; that of "
                "water is 2.2 GPa"
            )

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(Responses.of(system))

    def on(self, responses: Responses) -> Stepper:
        """The scheme on columns that are there already."""
        soft = self.volume_ratio / self.bulk_modulus if self.bulk_modulus else 0.0
        return ExactStepper(responses, condensed(responses), self.volume_ratio, soft)


@dataclass(frozen=True)
class ElasticPressure:
    """P = preset - stiffness (V/V0 - 1): a cavity joined to an elastic reservoir, or a gas.

    A negative stiffness is a pressure that grows with the volume; where it outweighs the body's own
    (-B beyond the slope of the pressure-volume curve) no root is stable, which is an outcome.
    Newton takes 3 to 4 steps where substitution diverges (stiffness beyond that slope). Beyond
    paper 000.
    """

    handles: ClassVar[Handles] = FLUID

    preset: float = quantity(0.0, "Pa", "Pe: gauge pressure at the rest volume")
    stiffness: float = quantity(1e4, "Pa", "B: fall of pressure as the volume doubles")

    def __post_init__(self) -> None:
        if not (math.isfinite(self.preset) and math.isfinite(self.stiffness) and self.stiffness):
            raise SceneError(
                f"preset {self.preset:g} Pa, stiffness {self.stiffness:g} Pa: expected finite "
                "values and a stiffness other than zero (for a constant pressure use "
                "PulsePressure)"
            )

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(Responses.of(system))

    def on(self, responses: Responses) -> Stepper:
        """The scheme on columns that are there already."""
        ratio = 1 + self.preset / self.stiffness
        return ExactStepper(responses, condensed(responses), ratio, 1 / self.stiffness)


@dataclass(frozen=True)
class Settling(LinearStepper):
    """Steppers whose pressures are roots, which have to lie on the branch from P = 0."""

    def _settled(
        self, k: int, z: Floats, updates: int, ratios: Floats | None = None, softness: float = 0.0
    ) -> State:
        """The state of a root z; a failure when it is not on the branch that begins at P = 0."""
        if least_slope(self.responses, z, softness) > 0:
            return self._state(k, z, updates, ratios=ratios)
        found = ", ".join(f"{P:.4g}" for P in z[self.responses.drives + 1 :])
        why = (
            f"pressures {found} Pa are unstable: they rise faster with the volume than the "
            "pressure of the body"
            if softness < 0
            else f"pressures {found} Pa are a spurious root: between zero and this pressure "
            "the volume falls as pressure rises; check the sign of the gain and the load"
        )
        return self._state(k, z, updates, ("not_converged", why), ratios)


@dataclass(frozen=True)
class DryStepper(LinearStepper):
    def step(self, state: State, inputs: Floats) -> State:
        still = np.zeros(len(self.responses.volumes))
        return self._state(state.k + 1, np.concatenate([[1.0], inputs, still]), 0)


@dataclass(frozen=True)
class ExactStepper(Settling):
    """Roots of V/V0 = ratio - softness P, softness in 1/Pa."""

    ratio: float
    softness: float = 0.0

    def step(self, state: State, inputs: Floats) -> State:
        one = len(self.responses.volumes) == 1
        return self._one_cavity(state, inputs) if one else self._cavities(state, inputs)

    def _one_cavity(self, state: State, drives: Floats) -> State:
        """Newton on the scalar cubic in P: with the drives fixed its coefficients are numbers."""
        form, p = self.responses.volumes[0], len(drives) + 1
        z = np.concatenate([[1.0], drives, [0.0]])
        V0 = float(form[0, 0, 0])
        start = float(state.inner.z[p - 1])
        root = root_of(cubic(form, z, p), V0, start, self.ratio, self.softness)
        z[p] = root.P
        why: tuple[Ending, str] = (
            "not_converged",
            f"no pressure keeps the volume constant: {root.failed}",
        )
        ratio = np.array([root.volume / V0])
        return self._state(state.k + 1, z, root.updates, why if root.failed else None, ratio)

    def _cavities(self, state: State, drives: Floats) -> State:
        """Newton on all volumes together; one cavity's pressure changes the others' volumes."""
        forms, k = self.responses.volumes, self.responses.drives
        V0 = self.responses.rest_volumes
        scale = V0 * (max(1.0, abs(self.ratio)) if self.softness else self.ratio)
        z = np.concatenate([[1.0], drives, state.inner.z[k:]])
        for updates in range(NEWTON_STEPS):
            own = forms @ z @ z
            error = own @ z - (self.ratio - self.softness * z[k + 1 :]) * V0
            if np.abs(error / scale).max(initial=0.0) <= ROUNDING:
                return self._settled(state.k + 1, z, updates, softness=self.softness)
            step = np.linalg.solve(3 * own[:, k + 1 :] + np.diag(self.softness * V0), error)
            z[k + 1 :] -= step
            if np.abs(step).max() <= 1e-14 * np.abs(z[k + 1 :]).max():
                return self._settled(state.k + 1, z, updates + 1, softness=self.softness)
        worst = float(np.abs(error / scale).max())
        why = (
            f"no pressure keeps the volume constant: error {worst:.2%} after {NEWTON_STEPS} "
            "Newton steps"
        )
        return self._state(state.k + 1, z, NEWTON_STEPS, ("not_converged", why))


MMHG = 133.322387415  # Pa
LINEAR_TO = 0.3  # of volume, either way: as far as the paper draws its line


@dataclass(frozen=True)
class PulsePressure:
    """P(t) = low + (high - low) (1 - cos(2 pi rate t)) / 2 in every cavity, gauge.

    The default is a pulse of 80 to 120 mmHg, 70 a minute. `high` = `low` is a constant pressure.
    The trace `<cavity>.beyond_linear` is 1 where V/V0 leaves 0.7 to 1.3.
    """

    handles: ClassVar[Handles] = FLUID

    low: float = quantity(80 * MMHG, "Pa", "least gauge pressure")
    high: float = quantity(120 * MMHG, "Pa", "largest gauge pressure")
    rate: float = quantity(70 / 60, "1/s", "pulses a second")
    dt: float = quantity(0.01, "s", "time step")

    def __post_init__(self) -> None:
        numbers = (self.low, self.high, self.rate, self.dt)
        if not all(map(math.isfinite, numbers)) or self.rate < 0 or not self.dt > 0:
            raise SceneError(
                f"pulse of {self.low:g}..{self.high:g} Pa, {self.rate:g} a second, dt "
                f"{self.dt:g} s: expected finite numbers, a rate of 0 or more and a positive "
                "step"
            )

    def at(self, t: float) -> float:
        """Pa at t s."""
        return self.low + (self.high - self.low) * (1 - math.cos(2 * math.pi * self.rate * t)) / 2

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(Responses.of(system))

    def on(self, responses: Responses) -> Stepper:
        """Return the scheme on columns that are there already."""
        return PulseStepper(responses, condensed(responses), self)


@dataclass(frozen=True)
class PulseStepper(LinearStepper):
    """Step k ends at k dt."""

    pulse: PulsePressure

    @cached_property
    def units(self) -> Mapping[str, str]:
        beyond = {f"{c.name}.beyond_linear": "1" for c in self.scene.cavities}
        return {**super().units, **beyond}

    def step(self, state: State, inputs: Floats) -> State:
        P = np.full(len(self.responses.volumes), self.pulse.at((state.k + 1) * self.pulse.dt))
        return self._state(state.k + 1, np.concatenate([[1.0], inputs, P]), 0)

    def _state(self, k: int, z: Floats, updates: int, failure: tuple[Ending, str] | None = None,
               ratios: Floats | None = None) -> State:  # fmt: skip
        found = self.ratios(z) if ratios is None else ratios
        state = super()._state(k, z, updates, failure, found)
        beyond = np.abs(found - 1) > LINEAR_TO
        told = {f"{c.name}.beyond_linear": float(b)
                for c, b in zip(self.scene.cavities, beyond, strict=True)}  # fmt: skip
        return replace(state, numbers={**state.numbers, **told})
