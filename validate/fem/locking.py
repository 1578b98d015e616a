"""The warning that linear elements lock near incompressibility."""

from validate.scene.material_point import AnyScene, MaterialPoint

LOCKING_FROM = 0.49  # P1 / P2 displacement of a pulled cube: .91 at nu .45, .82 at .49, .63 at .499
_SHAPES = {
    "tri3": "triangles",
    "tet4": "tetrahedra",
    "quad4": "quadrilaterals",
    "hex8": "hexahedra",
}


def locking_warning(scene: AnyScene) -> str | None:
    """One line where pointwise linear cells have nu of .49 or more; None where they do not lock.

    In plane stress nothing locks: the thickness gives way; a material point has no cells.
    """
    if isinstance(scene, MaterialPoint):
        return None
    nu = float(scene.per_cell(lambda m: m.nu).max())
    if nu < LOCKING_FROM or scene.mesh.order != 1 or scene.dilatation != "pointwise":
        return None
    if scene.plane == "stress":
        return None
    instead = "a mixed reference" if scene.mesh.bricks else "order 2 or nodal mean dilatation"
    return (
        f"nu = {nu:g}: linear {_SHAPES[scene.mesh.kind]} lock near incompressibility and are too "
        f"stiff, silently; compare with {instead}"
    )
