"""Mixed hexahedra packed for the compiled loops of `fem.kernels.bricks`."""

from collections.abc import Callable

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import stiffness_points
from validate.fem.kernels.bricks import CORNERS, LANES, POINTS, ROWS
from validate.fem.kernels.explicit import Cells
from validate.scene.material import Material
from validate.scene.scene import Scene

_LAWS = ("neo_hooke", "mooney_rivlin", "yeoh")


# kappa, C10, C01, C20, C30 Pa.
_CARD: tuple[Callable[[Material], float], ...] = (
    lambda m: m.bulk_modulus,
    lambda m: m.shear_modulus / 2 - m.coefficients.C01,
    lambda m: m.coefficients.C01,
    lambda m: m.coefficients.C20,
    lambda m: m.coefficients.C30,
)


def require_bricks(scene: Scene) -> None:
    """Raise `SceneError` for what mixed hexahedra have no explicit form of."""
    if scene.dilatation != "mixed":
        raise SceneError(
            f"explicit hexahedra must be mixed, because {scene.dilatation} ones lock; use "
            "dilatation='mixed'"
        )
    for m in (scene.material, *(r.material for r in scene.regions)):
        form = m.coefficients.volumetric
        if m.law not in _LAWS or form != "split":
            raise SceneError(
                f"explicit hexahedra support the laws {', '.join(_LAWS)} in their split form, "
                f"not '{m.law}' ({form})"
            )


def packed_bricks(scene: Scene) -> tuple[Floats, Cells]:
    """Geometry (blocks, 9, 25, 16) and cells (blocks, 8, 16), the rest without stiffness."""
    mesh, points = scene.mesh, stiffness_points(scene.mesh)
    e = len(mesh.cells)
    blocks = -(-e // LANES)
    rows = np.zeros((blocks * LANES, POINTS + 1, ROWS))
    rows[:e, :POINTS, :24] = np.swapaxes(points.slopes, 2, 3).reshape(e, POINTS, 24)
    rows[:e, :POINTS, 24] = points.weights
    for k, modulus in enumerate(_CARD):
        rows[:e, POINTS, k] = scene.per_cell(modulus)
    rows[:e, POINTS, 5] = 1 / points.weights.sum(axis=1)
    cells = np.zeros((blocks * LANES, CORNERS), np.int32)
    cells[:e] = 3 * mesh.cells
    packed = rows.reshape(blocks, LANES, POINTS + 1, ROWS).transpose(0, 2, 3, 1)
    lanes = cells.reshape(blocks, LANES, CORNERS).swapaxes(1, 2)
    return np.ascontiguousarray(packed), np.ascontiguousarray(lanes)
