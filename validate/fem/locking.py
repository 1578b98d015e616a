"""The warning that linear elements lock near incompressibility."""

from validate.scene.scene import Scene

LOCKING_FROM = 0.49  # P1 / P2 displacement of a pulled cube: .91 at nu .45, .82 at .49, .63 at .499


def locking_warning(scene: Scene) -> str | None:
    """One line where pointwise linear cells have nu of .49 or more; None where they do not lock."""
    nu = float(scene.per_cell(lambda m: m.nu).max())
    if nu < LOCKING_FROM or scene.mesh.order != 1 or scene.dilatation != "pointwise":
        return None
    shape = "triangles" if scene.mesh.dimension == 2 else "tetrahedra"
    return (
        f"nu = {nu:g}: linear {shape} lock near incompressibility and are too stiff, silently; "
        "compare with order 2 or nodal mean dilatation"
    )
