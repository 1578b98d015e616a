"""Pressure of a fluid in linear elastic cavities, from its relation to their volumes.

All work on the response columns: u = sum_a z_a u_a with z = (drives, pressures), so a cavity's
volume is a cubic polynomial in z (fixed normals: exact, not a series) and needs no facets. A fluid
whose volume is V/V0 = ratio - softness P leaves one polynomial root per cavity, found by Newton.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses, System
from validate.fem.system import responses as responses_of
from validate.parameters import quantity
from validate.solve.candidates import Asked, Rival, StillBody
from validate.solve.fluid.pressure_curve import NEWTON_STEPS, ROUNDING, cubic, least_slope, root_of
from validate.solve.handles import GLUED, Handles, require_handled
from validate.solve.static.quasi_static import LinearStepper, condensed
from validate.solve.types import Ending, State, Stepper

FLUID = Handles(("linear",), inertia=False, cavities=True, loads=False, contact=GLUED)


@dataclass(frozen=True)
class NoFluid:
    """The cavity is empty: gauge pressure zero, its volume changes freely."""

    handles: ClassVar[Handles] = FLUID

    @staticmethod
    def candidates(asked: Asked) -> tuple[Rival, ...]:
        if not (isinstance(asked, StillBody) and asked.cavities):
            return ()
        return (
            Rival("superposition, cavity empty", "static superposition", lambda dt: NoFluid(),
                   stepped=False, lacks="the fluid and its pressure"),
        )  # fmt: skip

    def prepare(self, system: System) -> Stepper:
        require_handled(system.scene, self)
        return self.on(responses_of(system))

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
    def candidates(asked: Asked) -> tuple[Rival, ...]:
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
        return self.on(responses_of(system))

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
        return self.on(responses_of(system))

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
