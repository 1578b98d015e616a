"""A block on a floor, compressed between two plates."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

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
    """The drive `press` moves one facet set towards the set `still`; the block lies on `floor`."""

    press: Drive
    still: str
    floor: Support


def between_plates(
    mesh: Mesh,
    material: Material,
    contact: Contact,
    plates: Plates,
    dilatation: Dilatation = "pointwise",
    *,
    cavities: tuple[Cavity, ...] = (),
    friction: float = 0.0,
    membrane: tuple[Membrane, ...] = (),
) -> Scene:
    """A 3-D block from the origin between its plates.

    The plates hold the direction of the drive, the floor what it declares, one node in the middle
    the third direction; bonded plates hold every component. Partial contact is a tangential spring
    of `friction` N/m^3 on both plates, the linear picture of a plate that holds until it slides.
    """
    press, still, floor = plates.press, plates.still, plates.floor
    along = int(np.flatnonzero(press.direction)[0])
    across = tuple(c for c in range(3) if c != along)
    aside = next(c for c in across if c not in floor.components)
    supports = [Support(still, (0, 1, 2) if contact == "bonded" else (along,)), floor]
    if contact == "bonded":
        supports.append(Support(press.facets, across))
    middle = np.zeros(3)
    middle[aside] = float(mesh.nodes[:, aside].max()) / 2
    rubbing = (still, press.facets) if contact == "partial" else ()
    return Scene(
        mesh,
        material,
        tuple(supports),
        (Pin(tuple(middle.tolist()), (aside,)),),
        (press,),
        cavities,
        dilatation,
        foundations=tuple(Foundation(f, across, friction) for f in rubbing),
        membranes=membrane,
    )
