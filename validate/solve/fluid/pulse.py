"""Prescribed pressures over time: a pulse, or a constant. Beyond paper 000, which only names it.

A pressure that is given needs no iteration: the volume follows. A linear model with fixed normals
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
from validate.fem.system import responses as responses_of
from validate.parameters import quantity
from validate.solve.fluid.cavities import FLUID
from validate.solve.handles import Handles, require_handled
from validate.solve.static.quasi_static import LinearStepper, condensed
from validate.solve.types import Ending, State, Stepper

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
        return self.on(responses_of(system))

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
