"""Locking of linear elements: warnings."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from validate.scene.meshless import AnyScene, Meshless
from validate.scene.scene import Pressure, Scene

# P1 / P2 displacement of a held cube that is pulled, 4 boxes an edge: .98 at nu .3, .96 at .4, .92
# at .45, .82 at .49, .67 at .4999.
LOCKING_FROM = 0.45
# Nodal mean dilatation: force of a 50 x 30 mm cylinder between bonded plates over that of quadratic
# cells, 8 across: 1.77 with 2 across at nu .49, 32 at .4999; 1.16 and 1.30 with 4. Quadratic cells
# have 1.12 and 1.22 with 2, 1.03 and 1.04 with 4: no warning of them.
_MEAN_FROM, _MEAN_ACROSS = 0.49, 5.0
_NAMED = 3  # methods in a warning
_SLENDER, _ACROSS = 4.0, 4.0  # bending: length over thickness from, and cells across below
_SHAPES = {
    "tri3": ("triangles", 2),
    "tet4": ("tetrahedra", 6),
    "quad4": ("quadrilaterals", 1),
    "hex8": ("hexahedra", 1),
}  # and how many of them make a box


@dataclass(frozen=True)
class Locking:
    """Why cells of a scene lock: `where`, which differs between scenes, and the `cause`."""

    where: str
    cause: str


def locking_of(scene: AnyScene) -> tuple[Locking, ...]:
    """Why the linear cells of a scene lock; empty where they do not.

    Pointwise ones lock from nu of .45 (in plane stress not: the thickness gives way), those of
    nodal mean dilatation from .49 where fewer than five lie across the body, all of them where few
    lie across a slender one that something bends. A material point has no cells.
    """
    if isinstance(scene, Meshless) or scene.mesh.order != 1:
        return ()
    cells = f"linear {_SHAPES[scene.mesh.kind][0]}"
    # How many boxes of cells lie across the thinnest side
    extent = np.ptp(scene.mesh.nodes, axis=0)
    boxes = len(scene.mesh.cells) / _SHAPES[scene.mesh.kind][1]
    across = float(extent.min() / (np.prod(extent) / boxes) ** (1 / len(extent)))
    nu = float(scene.per_cell(lambda m: m.nu).max())
    found = []
    if scene.plane != "stress" and scene.dilatation == "pointwise" and nu >= LOCKING_FROM:
        instead = "mixed dilatation" if scene.mesh.bricks else "order 2 or nodal mean dilatation"
        cause = f"{cells} lock near incompressibility and are too stiff; compare with {instead}"
        found.append(Locking(f"nu = {nu:g}", cause))
    few = round(across, 1) < _MEAN_ACROSS
    if scene.plane != "stress" and scene.dilatation == "nodal_mean" and nu >= _MEAN_FROM and few:
        where = f"nu = {nu:g}, {across:.1f} across the body"
        cause = (
            f"a mesh of few {cells} with nodal mean dilatation is too stiff where plates hold the "
            "body; compare with order 2 or a finer mesh"
        )
        found.append(Locking(where, cause))
    sides = np.ptp(scene.mesh.nodes, axis=0)
    slender = sides.max() >= _SLENDER * sides.min() and round(across, 1) < _ACROSS
    if slender and _bends(scene, int(sides.argmax())):
        where = f"{across:.1f} across a body {sides.max() / sides.min():.0f} times as long"
        cause = f"a mesh of few {cells} locks in bending; compare with order 2 or a finer mesh"
        found.append(Locking(where, cause))
    return tuple(found)


def locking_notes(scenes: Iterable[tuple[str, AnyScene]]) -> tuple[str, ...]:
    """Each cause once, with where it was found and the labels of the methods it concerns."""
    found: dict[str, dict[str, list[str]]] = {}
    for label, scene in scenes:
        for one in locking_of(scene):
            found.setdefault(one.cause, {}).setdefault(one.where, []).append(label)
    notes = []
    for cause, places in found.items():
        words = []
        for where, labels in places.items():
            more = len(labels) - _NAMED
            rest = f" and {more} more methods" if more > 0 else ""
            words.append(f"{where} ({'; '.join(labels[:_NAMED])}{rest})")
        notes.append(f"{cause}: {', '.join(words)}")
    return tuple(notes)


def _bends(scene: Scene, along: int) -> bool:
    """Whether anything acts across the long axis; drives and loads along it only stretch."""
    if scene.contacts or scene.tracked or scene.tools or scene.cavities:
        return True
    if any(isinstance(load, Pressure) for load in scene.loads):
        return True
    acting = [np.asarray(one.direction) for one in (*scene.drives, *scene.loads)
              if not isinstance(one, Pressure)]  # fmt: skip
    return not acting or any(np.abs(np.delete(d, along)).max(initial=0.0) > 1e-9 for d in acting)
