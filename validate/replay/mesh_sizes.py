"""Height and diameter of equal area of a specimen's mesh file, between its plates."""

from math import pi, sqrt

import numpy as np

from validate.errors import SceneError
from validate.scene.mesh import Mesh, cell_volumes

PLATES = ("lower_plate", "upper_plate")
DIAMETER, HEIGHT = "body.diameter", "body.height"  # paths
_FLAT = 0.02  # of the height: the largest spread of a plate's nodes along z


def sizes_of_mesh(mesh: Mesh, name: str = "mesh") -> dict[str, float]:
    """Return height and diameter m of a mesh by parameter; the area is volume over height.

    Raises `SceneError` for a mesh that a test between plates cannot use: without tetrahedra,
    without one of the facet sets `PLATES`, or with plates that are not flat and normal to z.
    """
    if mesh.dimension != 3 or mesh.bricks:
        raise SceneError(
            f"{name}: cells of {mesh.kind}; expected tetrahedra; for hexahedra answer "
            "experiment = body"
        )
    if absent := [plate for plate in PLATES if plate not in mesh.facets]:
        raise SceneError(
            f"{name}: no facet set {' or '.join(absent)}; there are "
            f"{', '.join(mesh.facets) or 'none'}; name both plates in the file, or answer "
            "experiment = body"
        )
    low, high = (mesh.nodes[mesh.facet_nodes(plate)][:, 2] for plate in PLATES)
    height = float(high.mean() - low.mean())
    uneven = float(max(np.ptp(low), np.ptp(high)))
    if uneven > _FLAT * abs(height):
        raise SceneError(
            f"{name}: plates {1e3 * uneven:.4g} mm out of flat along z and {1e3 * height:.4g} mm "
            "apart; expected flat plates normal to z: turn the mesh so that its axis is z"
        )
    if height <= 0:
        raise SceneError(
            f"{name}: upper_plate is {-1e3 * height:.4g} mm below lower_plate; expected it above: "
            "exchange the two names"
        )
    area = float(np.abs(cell_volumes(mesh)).sum()) / height
    return {DIAMETER: 2 * sqrt(area / pi), HEIGHT: height}
