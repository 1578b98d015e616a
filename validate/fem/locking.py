"""The warnings that linear elements lock: near incompressibility, and in bending."""

from collections.abc import Iterable

import numpy as np

from validate.scene.mesh import Mesh
from validate.scene.meshless import AnyScene, Meshless
from validate.scene.scene import Scene

# P1 / P2 displacement of a held cube that is pulled, 4 boxes an edge: .98 at nu .3, .96 at .4, .92
# at .45, .82 at .49, .67 at .4999.
LOCKING_FROM = 0.45
# Nodal mean dilatation: force of a 50 x 30 mm cylinder between bonded plates over that of quadratic
# cells, 8 across: 1.77 with 2 across at nu .49, 32 at .4999; 1.16 and 1.30 with 4. Quadratic cells
# have 1.12 and 1.22 with 2, 1.03 and 1.04 with 4: no warning of them.
_MEAN_FROM, _MEAN_ACROSS = 0.49, 5.0
_SLENDER, _ACROSS = 4.0, 4.0  # bending: length over thickness from, and cells across below
_SHAPES = {
    "tri3": ("triangles", 2),
    "tet4": ("tetrahedra", 6),
    "quad4": ("quadrilaterals", 1),
    "hex8": ("hexahedra", 1),
}  # and how many of them make a box


def locking_warning(scene: AnyScene) -> str | None:
    """One line where linear cells lock; None where they do not.

    Pointwise ones lock from nu of .45 (in plane stress not: the thickness gives way), those of
    nodal mean dilatation from .49 where fewer than five lie across the body, all of them where few
    lie across a slender one. A material point has no cells.
    """
    if isinstance(scene, Meshless) or scene.mesh.order != 1:
        return None
    cells = f"linear {_SHAPES[scene.mesh.kind][0]}"
    found = [
        words
        for words in (_volume(scene, cells), _mean(scene, cells), _bending(scene.mesh, cells))
        if words
    ]
    return "; ".join(found) or None


def locking_notes(scenes: Iterable[tuple[str, AnyScene]]) -> tuple[str, ...]:
    """Each warning once, with the labels of the methods it is of."""
    found: dict[str, list[str]] = {}
    for label, scene in scenes:
        warning = locking_warning(scene)
        if warning:
            found.setdefault(warning, []).append(label)
    return tuple(f"{warning} ({'; '.join(labels)})" for warning, labels in found.items())


def _volume(scene: Scene, cells: str) -> str | None:
    nu = float(scene.per_cell(lambda m: m.nu).max())
    if nu < LOCKING_FROM or scene.dilatation != "pointwise" or scene.plane == "stress":
        return None
    instead = "mixed dilatation" if scene.mesh.bricks else "order 2 or nodal mean dilatation"
    return (
        f"nu = {nu:g}: {cells} lock near incompressibility and are too stiff, silently; compare "
        f"with {instead}"
    )


def _mean(scene: Scene, cells: str) -> str | None:
    nu, across = float(scene.per_cell(lambda m: m.nu).max()), _across(scene.mesh)
    few = round(across, 1) < _MEAN_ACROSS
    if scene.dilatation != "nodal_mean" or nu < _MEAN_FROM or not few or scene.plane == "stress":
        return None
    return (
        f"nu = {nu:g}: {across:.1f} {cells} of nodal mean dilatation across a body are too stiff "
        "where plates hold it; compare with order 2 or a finer mesh"
    )


def _across(mesh: Mesh) -> float:
    """How many boxes of cells lie across the thinnest side."""
    sides = np.ptp(mesh.nodes, axis=0)
    boxes = len(mesh.cells) / _SHAPES[mesh.kind][1]
    return float(sides.min() / (np.prod(sides) / boxes) ** (1 / len(sides)))


def _bending(mesh: Mesh, cells: str) -> str | None:
    sides = np.ptp(mesh.nodes, axis=0)
    across = _across(mesh)
    if sides.max() < _SLENDER * sides.min() or round(across, 1) >= _ACROSS:
        return None
    return (
        f"{across:.1f} {cells} across a body {sides.max() / sides.min():.0f} times as long lock in "
        "bending; compare with order 2 or a finer mesh"
    )
