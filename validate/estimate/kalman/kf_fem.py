"""KF-FEM as in paper 001: the state is the displacement vector of all free unknowns.

The reading that gives the paper's NRMSE .0116: its noise "intensity of 0.001" is a variance in mm^2
(1e-9 m^2) for Q, R and P0 alike, P0 is that at t = 0 and the first measurement comes after one
step; a0 = M^-1 f; v and a follow the prior displacement; the RMSE of u_z is divided by the range of
the reference's u_z over steps 1 to 500. Then .01148 +- .00041 (mean and sample SD of 400 seeds);
.01137 with a0 = 0, .0135 with v and a from the posterior, .01126 divided by the largest value.

Departures: P is kept symmetric. White Q, the printed one, carries a correction to no node that is
not measured; `structure="load"` does.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.estimate.gating import Care, NoiseSettings, care_of, clock_setting, gate_setting
from validate.estimate.kalman.coordinates import (
    Coordinates,
    InModes,
    Nodal,
    excitation_in,
    in_modes,
)
from validate.estimate.kalman.covariance import (
    Covariance,
    Decoupled,
    Dense,
    GainSequence,
    schedule,
    shared_gains,
)
from validate.estimate.kalman.displacement_filter import (
    DisplacementStepper,
    Recursion,
    Sensed,
    Structure,
    load_shapes,
)
from validate.estimate.measurements import Measurements
from validate.estimate.smoother import smooth_setting
from validate.fem.system import System, once
from validate.memory import require_memory
from validate.parameters import quantity
from validate.solve.dynamic.linear import StartName, excitation, reactions
from validate.solve.dynamic.newmark_rule import Rule, RuleName, propagation
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled

_DENSE = 8  # matrices of all unknowns that the printed recursion holds at once

Gains = Literal["every_step", "shared"]


@dataclass(frozen=True)
class DisplacementNoise:
    """Variances m^2 of a step's model error Q, of measurements R (None: their own sd squared) and
    of the start P0.

    `structure`: "white" gives every unknown Q and P0 on its own; "load" gives them to the static
    displacement of each load as a whole, Q where it moves a measured component most.
    """

    handles: ClassVar[Handles] = LINEAR_DYNAMICS
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("Q", "R", "P0")

    dt: float = quantity(0.002, "s", "time step")
    Q: float = quantity(1e-9, "m2", "model error of a step; the paper's .001, taken as mm2")
    R: float | None = quantity(None, "m2", "variance of a measurement; none: declared")
    P0: float = quantity(1e-9, "m2", "variance at the start")
    recursion: Recursion = quantity("prior", "1", "displacement from which v and a are derived")
    structure: Structure = quantity("white", "1", "where the model has its error")
    gains: Gains = quantity("shared", "1", "computed in advance, or at every step")
    rule: RuleName = quantity("average", "1", "Newmark's rule")
    settled: float = quantity(1e-6, "1", "relative change of the gain below which it is frozen")
    a0: StartName = quantity("equilibrium", "1", "acceleration at t = 0, as in `Newmark`")
    gate: float | None = gate_setting()
    clock: float | None = clock_setting()
    smooth: bool = smooth_setting()

    def __post_init__(self) -> None:
        Rule.of(self.rule, self.dt)
        for name, value in (("Q", self.Q), ("P0", self.P0)):
            if not (np.isfinite(value) and value >= 0):
                raise SceneError(
                    f"variance {name} = {value:g} m2: expected a number >= 0 (1 mm2 is 1e-6)"
                )
        if self.R is not None and not (np.isfinite(self.R) and self.R > 0):
            raise SceneError(
                f"variance R = {self.R:g} m2: expected a number above 0 (1 mm2 is 1e-6)"
            )

    def care(self, measurements: Measurements) -> Care | None:
        return care_of(measurements, self.gate, self.clock, self.dt)


@dataclass(frozen=True)
class KfFem(DisplacementNoise):
    """The filter in nodal coordinates.

    `gains`: "every_step" multiplies dense matrices at every step, as printed: a baseline, whose
    cost is of the order n^3. "shared" computes the same gains beforehand (in modal coordinates
    where damping lets it), and a step costs what a step of the finite elements does. With a gate or
    a doubtful clock gains depend on what is measured: both recurse at every step, the latter in
    modes.
    """

    def prepare(self, system: System, measurements: Measurements) -> DisplacementStepper:
        """Raise `SceneError` for what linear schemes refuse, and for a load-shaped Q without a
        load; `ComparisonError` for measurements that land on no step."""
        require_handled(system.scene, self)
        rule = Rule.of(self.rule, self.dt)
        nodal = once(system, ("nodal step", rule), lambda: Nodal(propagation(system, rule)))
        if self.gains == "every_step":
            covariance = self._dense(system, measurements, nodal)
            return stepper_of(self, system, measurements, nodal, covariance, nodal, None)
        claimed: Coordinates = nodal
        try:
            claimed = modes = in_modes(system, nodal.propagation.rule)
        except SceneError:  # damping couples the modes
            covariance = self._dense(system, measurements, nodal)
        else:
            covariance = modal_covariance(self, system, measurements, modes)
        if self.care(measurements):
            return stepper_of(self, system, measurements, nodal, covariance, claimed, None)
        gains = shared_gains(system, covariance, measurements.timetable(self.dt), self.settled)
        in_nodes = gains.mapped(claimed.free)
        return stepper_of(self, system, measurements, nodal, covariance, claimed, in_nodes)

    def _dense(self, system: System, measurements: Measurements, nodal: Nodal) -> Covariance:
        n = len(system.free)
        require_memory(_DENSE * 8 * n**2, f"covariances of {n} unknowns, dense as printed")
        H, R = measurements.free(system.free), measurements.variances(self.R)
        noise = noise_shape(self, system, nodal, H)
        A = nodal.propagation.transition()
        return Dense(A, self.Q * noise, H, R, self.P0 * noise)


def modal_covariance(
    settings: DisplacementNoise, system: System, measurements: Measurements, modes: InModes
) -> Covariance:
    """Return the recursion whose transition is diagonal."""
    H = measurements.free(system.free)
    noise, R = noise_shape(settings, system, modes, H), measurements.variances(settings.R)
    seen = np.ascontiguousarray(H @ modes.shapes)
    return Decoupled(modes.factors[0], settings.Q * noise, seen, R, settings.P0 * noise)


def noise_shape(
    settings: DisplacementNoise, system: System, coordinates: Coordinates, H: Floats
) -> Floats:
    """Return the covariance (n, n) in the coordinates for one m^2 of Q or P0."""
    if settings.structure == "white":
        return coordinates.white if isinstance(coordinates, InModes) else np.eye(len(system.free))
    roots = coordinates.amplitudes(load_shapes(system, H))
    return np.asarray(roots @ roots.T)


def stepper_of(
    settings: DisplacementNoise,
    system: System,
    measurements: Measurements,
    coordinates: Nodal | InModes,
    covariance: Covariance,
    claimed: Coordinates,
    gains: GainSequence | None,
) -> DisplacementStepper:
    """Return the stepper in `coordinates`, its covariance recursed in those of `claimed`."""
    table, H = measurements.timetable(settings.dt), measurements.free(system.free)
    seen = H @ coordinates.shapes if isinstance(coordinates, InModes) else H
    rule, a0 = Rule.of(settings.rule, settings.dt), settings.a0
    excited = once(system, ("excited", rule, a0), lambda: excitation(system, rule, a0=a0))
    return DisplacementStepper(
        system,
        reactions(system),
        coordinates,
        excitation_in(coordinates, excited),
        covariance,
        Sensed(measurements, table, seen, np.asarray(measurements.H @ system.moves)),
        schedule(table),
        gains,
        settings.recursion,
        claimed,
        settings.settled,
        settings.care(measurements),
        settings.smooth,
    )
