"""Scene without a mesh: one material point, stretched homogeneously."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import SceneError
from validate.parameters import quantity
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Cavity, Drive, Load, Pressure, Probe, Scene, Support, Weight

# --- What scenes without a mesh have in common: nothing of what a mesh carries.


class Meshless:
    """What a report, a score or a probe asks of any scene, and finds none of here."""

    @property
    def materials(self) -> tuple[Material, ...]:
        return ()

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
    def loads(self) -> tuple[Load | Weight | Pressure, ...]:
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


AnyScene = Scene | Meshless
_NO_MESH = Mesh(np.zeros((0, 2)), np.zeros((0, 3), dtype=np.int64), "tri3", {})


# --- A scene that does not deform: named points of a rigid body, placed by its pose.

POSE = 6  # numbers of a pose: a rotation vector (rad), then a translation (m)


@dataclass(frozen=True)
class RigidBody(Meshless):
    """points (k, 3) m by `names` in the body's own frame; a step is given T_frame_from_body."""

    names: tuple[str, ...]
    points: Floats

    def __post_init__(self) -> None:
        k = len(self.names)
        if not k or len(set(self.names)) != k:
            raise SceneError(f"rigid body: {k} names, {len(set(self.names))} different ones")
        points = checked(self.points, "rigid body [m]", (k, 3), error=SceneError)
        object.__setattr__(self, "points", points)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what a step is given: as `Scene.inputs`."""
        return tuple(f"{part}.{axis}" for part in ("rotation", "translation") for axis in "xyz")


# -------------------------------------------------------------------------------------------------

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
