"""Sensor errors (gain, delay, bias, pose) as small parameters that can be identified.

An experiment takes one into its parameters and applies it where it registers a recording:
`cell = parameters.cell.of(cell)`. Their defaults change nothing; one that is None stands open.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial.transform import Rotation

from validate.errors import UsageError
from validate.parameters import known, quantity
from validate.plugins import Registry, settings_faults
from validate.register.markers.markers import MarkerObservation
from validate.register.signals import SignalObservation

_LEAST = 1e-6  # of a gain: below it a sensor reads nothing


@dataclass(frozen=True)
class Sensing:
    """A sensor that reads gain times what is there, `delay` s late.

    Raises `UsageError` for a gain that is not above 0.
    """

    gain: float | None = quantity(1.0, "1", "ratio of reading to true value")
    delay: float | None = quantity(0.0, "s", "delay of its clock relative to the drive's clock")

    def __post_init__(self) -> None:
        if self.gain is not None and not self.gain > _LEAST:
            raise UsageError(f"gain {self.gain:g} of a sensor: expected above 0; 1 is exact")

    @property
    def offset(self) -> float:
        """Reading at zero, in its own unit."""
        return 0.0

    def of(self, seen: SignalObservation) -> SignalObservation:
        """Return the true values at the times of the samples: (y(t + delay) - offset) / gain.

        Linear between samples, and held before the first and after the last, so that as many are
        compared whatever the delay.
        """
        gain, late = known(self.gain, "gain"), seen.t + known(self.delay, "delay")
        y = np.stack([np.interp(late, seen.t, column) for column in seen.y.T], axis=1)
        return replace(seen, y=(y - self.offset) / gain, sd=seen.sd / gain)


@dataclass(frozen=True)
class ForceSensing(Sensing):
    """Gain, delay (s) and bias (N) of a load cell; raises as `Sensing`."""

    bias: float | None = quantity(0.0, "N", "reading at zero")

    @property
    def offset(self) -> float:
        return known(self.bias, "bias of a sensor")


@dataclass(frozen=True)
class PressureSensing(Sensing):
    """Gain, delay (s) and bias (Pa) of a pressure sensor; raises as `Sensing`."""

    bias: float | None = quantity(0.0, "Pa", "reading at zero")

    @property
    def offset(self) -> float:
        return known(self.bias, "bias of a sensor")


@dataclass(frozen=True)
class LengthSensing(Sensing):
    """Gain, delay (s) and bias (m) of a displacement sensor; raises as `Sensing`."""

    bias: float | None = quantity(0.0, "m", "reading at zero")

    @property
    def offset(self) -> float:
        return known(self.bias, "bias of a sensor")


@dataclass(frozen=True)
class PoseShift:
    """By how far a camera's frame is off the scene's, beside what registration found.

    Moves markers by a rotation vector about the middle of those at rest, then a translation.
    """

    x: float | None = quantity(0.0, "m", "shift along x")
    y: float | None = quantity(0.0, "m", "shift along y")
    z: float | None = quantity(0.0, "m", "shift along z")
    turn_x: float | None = quantity(0.0, "rad", "turn about x")
    turn_y: float | None = quantity(0.0, "rad", "turn about y")
    turn_z: float | None = quantity(0.0, "rad", "turn about z")
    delay: float | None = quantity(0.0, "s", "delay of its clock relative to the drive's clock")

    def of(self, seen: MarkerObservation) -> MarkerObservation:
        """Return the markers where they were, at the times of the samples; between samples linear,
        and a marker that is not seen at one of them is not seen.

        A motion of the rest with the rest leaves displacements as they are but for their direction.
        Raises `UsageError` for markers in a plane.
        """
        if self == PoseShift():
            return seen
        d = seen.x.shape[2]
        if d != 3:
            raise UsageError(f"markers in {d} dimensions: a pose has three")
        x, y, z, *turn = (known(getattr(self, f.name), f.name) for f in fields(self))
        R = Rotation.from_rotvec(turn[:3]).as_matrix()
        centre, by, delay = seen.rest.mean(axis=0), np.array([x, y, z]), turn[3]
        flat = seen.x.reshape(len(seen.t), -1)
        # y (nt,) at t + delay s, NaN = not seen: where one of two samples is not, nor is what
        # lies between.
        late = np.stack(
            [
                column if delay == 0 else np.interp(seen.t + delay, seen.t, column)
                for column in flat.T
            ],
            axis=1,
        )
        moved = (late.reshape(seen.x.shape) - centre) @ R.T + centre + by
        return replace(seen, x=moved)


SENSORS: Registry[type[Sensing] | type[PoseShift]] = Registry(
    "sensors",
    (ForceSensing, PressureSensing, LengthSensing, PoseShift),
    lambda sensing: sensing.__name__,
    lambda part: settings_faults(part, "of"),
)
