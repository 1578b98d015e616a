"""Rates of haptic and visual feedback."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import UsageError

DEVICE_HZ = 512.0  # of paper 000's haptic device (section 5.2)


@dataclass(frozen=True)
class RealTime:
    """Steps of dt s done at rate_hz 1/s; critical_dt s is the limit of stability.

    A rate says nothing without its dt: `factor` is simulated over elapsed time, `ratio` how much
    of the stable step dt uses. Raises `UsageError` for numbers that are not positive.
    """

    #: Force updates a second that a stiff contact needs to feel steady (paper 003, 3.5).
    haptic_hz: ClassVar[float] = 1000.0

    rate_hz: float
    dt: float
    critical_dt: float

    def __post_init__(self) -> None:
        if not all(x > 0 for x in (self.rate_hz, self.dt, self.critical_dt)):
            raise UsageError(
                f"rate {self.rate_hz:g} Hz, dt {self.dt:g} s, critical step {self.critical_dt:g} "
                "s: all must be positive"
            )

    @property
    def factor(self) -> float:
        """Seconds simulated per second; real time needs at least 1."""
        return self.rate_hz * self.dt

    @property
    def ratio(self) -> float:
        """dt over the critical step; a sound explicit run needs less than 1."""
        return self.dt / self.critical_dt


@dataclass(frozen=True)
class TickTimes:
    """`seconds` (n,) from when a tick was due, or begun, until its force was there."""

    shares: ClassVar[tuple[float, ...]] = (0.5, 0.9, 0.99, 0.999)  # of the ticks, for quantiles

    seconds: Floats

    def __post_init__(self) -> None:
        given = checked(self.seconds, "tick times [s]", (None,), error=UsageError)
        if not len(given):
            raise UsageError("tick times: 0 ticks, so there is nothing to report")
        object.__setattr__(self, "seconds", given)

    def missed(self, deadline: float) -> int:
        """Number of ticks that took longer than `deadline` s."""
        return int((self.seconds > deadline).sum())

    @property
    def quantiles(self) -> tuple[float, ...]:
        """Seconds within which these `shares` of the ticks were done, then the longest."""
        return (*np.quantile(self.seconds, self.shares).tolist(), float(self.seconds.max()))
