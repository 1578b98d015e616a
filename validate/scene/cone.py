"""A quarter of an upright truncated cone, for compression between plates."""

from validate.errors import SceneError
from validate.scene.cylinder import quarter_cylinder
from validate.scene.mesh import Mesh, require_positive_cells

_NAMES = {"lower_plate": "bottom", "upper_plate": "top", "rim": "side"}


def quarter_cone(
    bottom: float, top: float, height: float, radial: int, axial: int, grading: float = 1.0
) -> Mesh:
    """Linear tetrahedra of x, y >= 0, axis z; diameters `bottom` (z = 0) and `top` (z = height) m.

    The quarter cylinder, narrowed linearly along its axis; `radial`, `axial` count elements and
    `grading` above 1 shrinks them towards the side and the plates. Facet sets: "bottom", "top",
    "side", "symmetry_x", "symmetry_y". A scene of it has `copies=4`. Raises `SceneError` for sizes
    and counts that are not positive.
    """
    if min(bottom, top) <= 0:
        raise SceneError(
            f"cone of diameters {1e3 * bottom:g} and {1e3 * top:g} mm: both must be positive"
        )
    upright = quarter_cylinder(bottom, height, radial, axial, grading, inscribed=True)
    nodes = upright.nodes.copy()
    nodes[:, :2] *= (1 + (top / bottom - 1) * nodes[:, 2] / height)[:, None]
    facets = {_NAMES.get(name, name): f for name, f in upright.facets.items()}
    mesh = Mesh(nodes, upright.cells, "tet4", facets)
    require_positive_cells(mesh)
    return mesh
