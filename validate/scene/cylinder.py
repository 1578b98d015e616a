"""An upright cylinder, or a quarter of it, for compression between plates."""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.mesh import (
    Mesh,
    boundary_facets,
    kuhn_cells,
    require_nodes,
    require_positive_cells,
)


def quarter_cylinder(
    diameter: float,
    height: float,
    radial: int,
    axial: int,
    grading: float = 1.0,
    *,
    inscribed: bool = False,
) -> Mesh:
    """Linear tetrahedra of x, y >= 0, axis z; `radial`, `axial` count elements.

    The rim is a polygon of 8 `radial` sides with the circle's area, so that the mesh carries the
    force of the round body: its corners lie a little outside the circle, on it if `inscribed`, with
    an area that is then too small (2.6 % for two elements).

    A square grid is mapped onto the quarter disc ring by ring (the concentric map); Kuhn's diagonal
    runs from the axis to the rim, so no cell is flat. `grading` above 1 shrinks the cells towards
    the rim and the plates, where bonded plates concentrate the stress. Facet sets: "lower_plate"
    (z = 0), "upper_plate" (z = height), "symmetry_x", "symmetry_y", "rim".
    """
    if min(diameter, height, grading) <= 0 or min(radial, axial) < 1:
        raise SceneError(
            f"cylinder {1e3 * diameter:g} x {1e3 * height:g} mm with {radial} x {axial} elements: "
            "all must be positive"
        )
    require_nodes((radial + 1, radial + 1, axial + 1))
    i, j, k = np.meshgrid(
        np.arange(radial + 1), np.arange(radial + 1), np.arange(axial + 1), indexing="ij"
    )
    ring = np.maximum(i, j)
    angle = np.pi / 4 * _ratio(np.where(i >= j, j, i), ring)
    angle = np.where(i >= j, angle, np.pi / 2 - angle)
    corner = diameter / 2 * (1.0 if inscribed else _outside(radial))
    r = corner * (1 - (1 - ring / radial) ** grading)
    s = 2 * k / axial - 1
    z = height / 2 * (1 + np.sign(s) * (1 - (1 - np.abs(s)) ** grading))
    nodes = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)
    cells = kuhn_cells((radial + 1, radial + 1, axial + 1))
    place = np.stack([i, j, k], axis=-1).reshape(-1, 3)
    outside = boundary_facets(cells, 3)
    on = {
        "lower_plate": place[:, 2] == 0,
        "upper_plate": place[:, 2] == axial,
        "symmetry_x": place[:, 0] == 0,
        "symmetry_y": place[:, 1] == 0,
        "rim": place[:, :2].max(axis=1) == radial,
    }
    facets = {name: outside[nodes_on[outside].all(axis=1)] for name, nodes_on in on.items()}
    mesh = Mesh(nodes.reshape(-1, 3), cells, "tet4", facets)
    require_positive_cells(mesh)
    return mesh


def _outside(radial: int) -> float:
    """Corner radius over circle radius where polygon and circle have one area.

    A polygon of n corners on a circle has n sin(2 pi / n) / (2 pi) of its area.
    """
    share = 4 * radial / np.pi * np.sin(np.pi / (4 * radial))
    return float(1 / np.sqrt(share))


def _ratio(part: Floats, whole: Floats) -> Floats:
    return np.asarray(np.divide(part, whole, out=np.zeros(part.shape), where=whole > 0))


def whole_cylinder(diameter: float, height: float, radial: int, axial: int) -> Mesh:
    """Linear tetrahedra of the whole cylinder: four mirrored quarters, sets "lower_plate",
    "upper_plate" and "rim"."""
    mesh = quarter_cylinder(diameter, height, radial, axial)
    sets = {name: mesh.facets[name] for name in ("lower_plate", "upper_plate", "rim")}
    return _doubled(_doubled(replace(mesh, facets=sets), 0), 1)


def _doubled(mesh: Mesh, axis: int) -> Mesh:
    """The mesh and its mirror image across the plane through the origin, joined there."""
    n, flat = len(mesh.nodes), np.abs(mesh.nodes[:, axis]) < 1e-12
    image = np.where(flat, np.arange(n), n + np.cumsum(~flat) - 1)
    sign = np.where(np.arange(3) == axis, -1.0, 1.0)
    nodes = np.vstack([mesh.nodes, sign * mesh.nodes[~flat]])
    facets = {k: np.vstack([f, image[f[:, [0, 2, 1]]]]) for k, f in mesh.facets.items()}
    return Mesh(nodes, np.vstack([mesh.cells, image[mesh.cells[:, [0, 2, 1, 3]]]]), "tet4", facets)
