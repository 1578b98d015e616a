"""A scene without a mesh: one material point, stretched homogeneously."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Cavity, Drive, Load, Probe, Scene, Support, Weight

StretchMode = Literal["uniaxial", "equibiaxial", "pure_shear", "biaxial"]


@dataclass(frozen=True)
class MaterialPoint:
    """A point whose input is the stretch (1 at rest); the third direction is free of stress.

    "uniaxial": the second direction is free as well; "equibiaxial": it has the same stretch;
    "pure_shear" (planar tension): it keeps its length; "biaxial": its stretch is an input of its
    own.
    """

    material: Material
    mode: StretchMode

    @property
    def materials(self) -> tuple[Material, ...]:
        return (self.material,)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what a step is given: as `Scene.inputs`."""
        return ("stretch", "second") if self.mode == "biaxial" else ("stretch",)

    # What a report, a score or a probe asks of any scene: a point has none of it.

    @property
    def mesh(self) -> Mesh:
        """No nodes and no cells."""
        return _NO_MESH

    @property
    def probes(self) -> tuple[Probe, ...]:
        return ()

    @property
    def drives(self) -> tuple[Drive, ...]:
        return ()

    @property
    def loads(self) -> tuple[Load | Weight, ...]:
        return ()

    @property
    def cavities(self) -> tuple[Cavity, ...]:
        return ()

    @property
    def regions(self) -> tuple[Region, ...]:
        return ()

    @property
    def supports(self) -> tuple[Support, ...]:
        return ()

    @property
    def copies(self) -> int:
        return 1


AnyScene = Scene | MaterialPoint
_NO_MESH = Mesh(np.zeros((0, 2)), np.zeros((0, 3), dtype=np.int64), "tri3", {})
