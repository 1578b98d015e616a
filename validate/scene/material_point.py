"""A scene without a mesh: one material point, stretched homogeneously."""

from dataclasses import dataclass
from typing import Literal

from validate.scene.scene import Material

StretchMode = Literal["uniaxial", "equibiaxial", "pure_shear"]


@dataclass(frozen=True)
class MaterialPoint:
    """A point whose one input is the stretch (1 at rest); the third direction is free of stress.

    "uniaxial": the second direction is free as well; "equibiaxial": it has the same stretch;
    "pure_shear" (planar tension): it keeps its length.
    """

    material: Material
    mode: StretchMode

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what a step is given: as `Scene.inputs`."""
        return ("stretch",)
