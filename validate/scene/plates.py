"""A block on a floor, compressed between two plates."""

from dataclasses import dataclass

import numpy as np

from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import (
    Cavity,
    Dilatation,
    Drive,
    Foundation,
    Membrane,
    Pin,
    Scene,
    Support,
)
from validate.scene.scene import (
    Contact as Contact,
)

_HALF = 4.0  # of E over the plates' distance: the stiffness at a share of one half (ours)


def plates_of_share(share: float, E: float, apart: float) -> tuple[Contact, float]:
    """Contact and tangential stiffness N/m^3 of plates `apart` m that rub by a `share` 0..1.

    0 slips, 1 bonds, between them springs of k = 4 E/apart share/(1 - share): the one definition of
    how much plates rub, for what is identified and for what is uncertain (Pa, m).
    """
    if share in (0.0, 1.0):
        return ("slip" if share == 0 else "bonded"), 0.0
    return "partial", _HALF * E / apart * share / (1 - share)


def rubbing_share(contact: str, friction: float, E: float, apart: float) -> float:
    """The share 0..1 of that contact with springs of `friction` N/m^3; see `plates_of_share`."""
    if contact != "partial":
        return float(contact == "bonded")
    return friction / (friction + _HALF * E / apart)


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
