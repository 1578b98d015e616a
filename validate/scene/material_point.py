"""A scene without a mesh: one material point, stretched homogeneously."""

from dataclasses import dataclass
from typing import Literal

from validate.errors import SceneError
from validate.parameters import quantity
from validate.scene.material import Material
from validate.scene.meshless import Meshless

StretchMode = Literal["uniaxial", "equibiaxial", "pure_shear", "biaxial"]


@dataclass(frozen=True)
class MaterialPoint(Meshless):
    """A point whose input is the stretch (1 at rest); the third direction is free of stress.

    "uniaxial": the second direction is free as well; "equibiaxial": it has the same stretch;
    "pure_shear" (planar tension): it keeps its length; "biaxial": its stretch is an input of its
    own.
    """

    material: Material
    mode: StretchMode = quantity("uniaxial", "1", "how it is stretched")

    def __post_init__(self) -> None:
        if self.material.incompressible:
            raise SceneError("nu = 0.5 at a material point: expected nu < 0.5; use nu <= 0.49999")

    @property
    def materials(self) -> tuple[Material, ...]:
        return (self.material,)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what a step is given: as `Scene.inputs`."""
        return ("stretch", "second") if self.mode == "biaxial" else ("stretch",)
