"""Parameters of a rigid indenter and of the testing machine that moves it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.errors import UsageError
from validate.parameters import quantity

IndenterShape = Literal["none", "plate", "sphere", "cylinder", "punch"]
ROUND = ("sphere", "cylinder", "punch")


@dataclass(frozen=True)
class Indenter:
    """A rigid body that presses on `moved.place` along `moved.along`; none: the place itself is
    moved (glued, gripped)."""

    shape: IndenterShape = quantity("none", "1", "rigid body that presses: plate, sphere, ...")
    radius: float = quantity(0.0, "m", "of a sphere, cylinder, or a punch's flat round end")
    axis: str = quantity("+y", "1", "direction of a cylinder's axis")
    tip: tuple[float, ...] = quantity(
        (), "m", "a point below the indenter's middle; none: the middle of the place"
    )
    gap: float = quantity(
        0.0, "m", "from the first instant to the first touch; below 0: it already presses"
    )
    friction: float = quantity(0.0, "1", "Coulomb's coefficient")
    bonded: bool = quantity(False, "1", "whether touching surfaces stick while pressed")
    reach: float = quantity(
        0.0, "m", "radius of contact at the largest load, for which a block's mesh is graded"
    )

    def __post_init__(self) -> None:
        if self.shape in ROUND and not (np.isfinite(self.radius) and self.radius > 0):
            raise UsageError(
                f"indenter.radius = {self.radius:g} m: a {self.shape} needs a radius above 0, as "
                "--set indenter.radius=5mm"
            )
        if not (np.isfinite(self.friction) and self.friction >= 0):
            raise UsageError(
                f"indenter.friction = {self.friction:g}: expected 0 (frictionless) or a "
                f"coefficient; for sticking contact set indenter.bonded=true"
            )
        if len(self.tip) not in (0, 3) or not self.reach >= 0:
            raise UsageError(
                f"indenter.tip = {self.tip}, indenter.reach = {self.reach:g} m: expected three "
                "lengths (or none), and a radius of 0 or above"
            )

    @property
    def there(self) -> bool:
        return self.shape != "none"


@dataclass(frozen=True)
class Machine:
    """Compliance of frame, load cell and grips: u_specimen = u_recorded - C F."""

    compliance: float | None = quantity(None, "m/N", "of the machine; none: not known, taken as 0")
    sd: float = quantity(0.0, "m/N", "standard uncertainty of a compliance that is given")
    measured: str | None = quantity(
        None, "1", "recording of a rigid block (same topics) that gives compliance and sd"
    )

    def __post_init__(self) -> None:
        given = self.compliance
        if (given is not None and not (np.isfinite(given) and given >= 0)) or not self.sd >= 0:
            raise UsageError(
                f"machine.compliance = {given} m/N, sd {self.sd:g} m/N: both must be 0 or above; a "
                "rigid machine has 0"
            )
        if given is not None and self.measured:
            raise UsageError(
                "machine.compliance and machine.measured are both set: give one of them"
            )
