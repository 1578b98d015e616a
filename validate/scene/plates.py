"""A block with a cavity, compressed between plates."""

from dataclasses import dataclass
from typing import Literal

from validate.errors import SceneError
from validate.scene.mesh import Mesh
from validate.scene.scene import (
    Cavity,
    Dilatation,
    Drive,
    Foundation,
    Material,
    Membrane,
    Pin,
    Scene,
    Support,
)

Contact = Literal["slip", "partial", "bonded"]


@dataclass(frozen=True)
class Plates:
    """Which faces of a block ("x0" to "z1") touch a fixed plate, the moving one and the floor."""

    fixed: str
    moving: str
    floor: str

    def __post_init__(self) -> None:
        if self.fixed[0] != self.moving[0] or self.floor[0] == self.fixed[0]:
            raise SceneError(
                f"plates at {self.fixed} and {self.moving}, floor {self.floor}: two opposite "
                "faces and one beside them"
            )

    @property
    def axes(self) -> tuple[int, int, int]:
        """The axes along which the plates press, the floor holds, and neither."""
        press, stand = ("xyz".index(face[0]) for face in (self.fixed, self.floor))
        return press, stand, 3 - press - stand

    @property
    def inward(self) -> tuple[float, float, float]:
        """The direction in which the moving plate presses."""
        sign = -1.0 if self.moving[1] == "1" else 1.0
        x, y, z = (sign if axis == self.axes[0] else 0.0 for axis in range(3))
        return x, y, z


def between_plates(
    mesh: Mesh,
    plates: Plates,
    material: Material,
    contact: Contact,
    dilatation: Dilatation = "pointwise",
    *,
    friction: float = 0.0,
    membrane: tuple[Membrane, ...] = (),
) -> Scene:
    """The plates hold what they press along, the floor its own axis, one node the third; bonded
    plates hold every component.

    Partial contact is a tangential spring of `friction` N/m^3 on both plates, the linear picture of
    a plate that holds until it slides. The drive "stage" is the moving plate's way inward, the
    cavity is "inclusion". The mesh has the facet sets of `block_with_inclusion`.
    """
    press, stand, third = plates.axes
    held = (0, 1, 2) if contact == "bonded" else (press,)
    along = tuple(sorted((stand, third)))
    supports = [Support(plates.fixed, held), Support(plates.floor, (stand,))]
    if contact == "bonded":
        supports.append(Support(plates.moving, along))
    rubbing = (plates.fixed, plates.moving) if contact == "partial" else ()
    return Scene(
        mesh,
        material,
        tuple(supports),
        (Pin(_on_the_edge(mesh, plates), (third,)),),
        (Drive("stage", plates.moving, plates.inward),),
        (Cavity("inclusion", "cavity"),),
        dilatation,
        foundations=tuple(Foundation(face, along, friction) for face in rubbing),
        membranes=membrane,
    )


def _on_the_edge(mesh: Mesh, plates: Plates) -> tuple[float, float, float]:
    """Where the fixed plate meets the floor, half-way along."""
    ends = (mesh.nodes.min(axis=0), mesh.nodes.max(axis=0))
    x = (ends[0] + ends[1]) / 2
    for face in (plates.fixed, plates.floor):
        axis = "xyz".index(face[0])
        x[axis] = ends[int(face[1])][axis]
    return float(x[0]), float(x[1]), float(x[2])
