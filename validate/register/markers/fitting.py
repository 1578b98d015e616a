"""Settings of the fit of markers to their layout."""

from dataclasses import dataclass
from typing import Literal

from validate.parameters import quantity

Method = Literal["rigid", "similarity", "two_step", "two_step_scaled"]


@dataclass(frozen=True)
class MarkerFit:
    """Fitted once, on the rest state. What is left out of the fit is compared like any other."""

    method: Method = quantity("rigid", "1", "marker registration, on the rest state only")
    sd: tuple[float, ...] = quantity(
        (), "m", "noise of a marker along each axis of the tracker's frame; none: as recorded"
    )
    exclude: tuple[str, ...] = quantity((), "1", "markers left out of the fit, still compared")
    robust: bool = quantity(False, "1", "leave outliers out of the fit, still compared")

    def noise(self, recorded: float) -> float | tuple[float, ...]:
        """Return the noise m that is used: one for all axes, or one for each."""
        return self.sd if len(self.sd) > 1 else (*self.sd, recorded)[0]
