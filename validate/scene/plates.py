"""A block compressed between plates, as in paper 000, section 4.4."""

from typing import Literal

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


def between_plates(
    mesh: Mesh,
    material: Material,
    contact: Contact,
    dilatation: Dilatation = "pointwise",
    *,
    friction: float = 0.0,
    membrane: tuple[Membrane, ...] = (),
) -> Scene:
    """The plates hold x, the floor y, one node z; bonded plates hold every component.

    The paper does not say whether its plates slip: an explicit choice here. Partial contact is a
    tangential spring of `friction` N/m^3 on both plates, the linear picture of a plate that holds
    until it slides. The mesh needs the facet sets of `block_with_inclusion`.
    """
    held = (0, 1, 2) if contact == "bonded" else (0,)
    supports = [Support("probe_plate", held), Support("bottom", (1,))]
    if contact == "bonded":
        supports.append(Support("stage_plate", (1, 2)))
    rubbing = ("probe_plate", "stage_plate") if contact == "partial" else ()
    middle = float(mesh.nodes[:, 2].max()) / 2
    return Scene(
        mesh,
        material,
        tuple(supports),
        (Pin((0.0, 0.0, middle), (2,)),),
        (Drive("stage", "stage_plate", (-1.0, 0.0, 0.0)),),
        (Cavity("inclusion", "cavity"),),
        dilatation,
        foundations=tuple(Foundation(f, (1, 2), friction) for f in rubbing),
        membranes=membrane,
    )
