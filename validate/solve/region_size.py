"""How many layers the primary region has, from the deformation (paper 004, section 5.5).

The paper runs the linear function alone and names the others; both are here.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError

SizeName = Literal["fixed", "linear", "saturating", "threshold"]


@dataclass(frozen=True)
class PrimarySize:
    """Layers between `least` and `most`.

    "linear": the deformation l_d m times `slope`, in layers of `spacing` m (Fig. 5). "saturating":
    least + (most - least) (1 - exp(-slope l_d / (spacing (most - least)))), which begins with that
    slope. "threshold": as far as a node is displaced by more than `moved` m.
    """

    name: SizeName
    least: int
    most: int
    slope: float
    moved: float
    spacing: float

    def __post_init__(self) -> None:
        if not 1 <= self.least <= self.most:
            raise SceneError(
                f"primary region of {self.least} to {self.most} layers: expected at least 1, "
                "and increasing"
            )
        if not (self.slope > 0 and self.moved > 0):
            raise SceneError(
                f"slope {self.slope:g} and threshold {self.moved:g} m of the primary region: "
                "expected values above 0, otherwise it never grows"
            )

    def layers(self, deformation: float, moved: Floats, layer: Ints) -> int:
        """Layers for l_d m at the contact and displacements `moved` (n,) m of nodes in `layer`."""
        if self.name == "fixed":
            return self.least
        if self.name == "threshold":
            far = layer[moved > self.moved]
            wanted = float(far.max()) + 1 if len(far) else 0.0
        else:
            wanted = self.slope * deformation / self.spacing if self.spacing else 0.0
        if self.name == "saturating":
            room = max(self.most - self.least, 1)
            wanted = self.least + room * -np.expm1(-wanted / room)
        return int(np.clip(np.ceil(wanted - 1e-9), self.least, self.most))
