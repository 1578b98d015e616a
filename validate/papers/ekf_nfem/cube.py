"""What the bodies of paper 003 share: the law at large strain, and the ramp of a force."""

from dataclasses import dataclass
from typing import Literal

from validate.parameters import quantity
from validate.scene.material import LawName, Material

SIDE = 0.1  # m, of the cube


@dataclass(frozen=True)
class LargeStrain:
    E: float = quantity(30e3, "Pa", "Young's modulus of the models")
    nu: float = quantity(0.49, "1", "Poisson ratio of the models")
    rho: float = quantity(1000.0, "kg/m3", "density")
    mass_damping: float = quantity(0.0, "1/s", "C = mass_damping M (eq 18); the paper drops it")
    law: LawName = quantity("svk", "1", "svk as printed, or neo_hooke")

    @property
    def material(self) -> Material:
        return Material(self.E, self.nu, self.law, self.rho, self.mass_damping)


@dataclass(frozen=True)
class Ramp:
    force: float = quantity(0.5, "N", "at the end of the ramp")
    reading: Literal["consistent", "nodal", "per_node"] = quantity(
        "consistent", "1", "the printed force as a total (consistent, nodal) or on every node"
    )
