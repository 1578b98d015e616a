"""Upright cylinders: hexahedra, or tetrahedra from mirror images of a quarter."""

from dataclasses import replace

import numpy as np

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
    part = np.where(i >= j, j, i)
    angle = np.pi / 4 * np.asarray(np.divide(part, ring, out=np.zeros(part.shape), where=ring > 0))
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


def _outside(radial: float) -> float:
    """Corner radius over circle radius where polygon and circle have one area.

    A polygon of n corners on a circle has n sin(2 pi / n) / (2 pi) of its area.
    """
    share = 4 * radial / np.pi * np.sin(np.pi / (4 * radial))
    return float(1 / np.sqrt(share))


def hexahedral_cylinder(diameter: float, height: float, radial: int, axial: int) -> Mesh:
    """Linear hexahedra of the whole cylinder about z, `radial` of them from axis to rim.

    A square core of `radial` cells a side lies inside rings of 4 `radial` cells; the rim has the
    circle's area, as that of `quarter_cylinder`. Sets "lower_plate", "upper_plate" and "rim".
    Raises `SceneError` for sizes or counts that are not positive.
    """
    if min(diameter, height) <= 0 or min(radial, axial) < 1:
        raise SceneError(
            f"cylinder {1e3 * diameter:g} x {1e3 * height:g} mm with {radial} x {axial} "
            "hexahedra: all must be positive"
        )
    # Nodes (k, 2) and quadrilaterals (q, 4) of a unit disc: n x n core cells in n / 2 rings.
    count = (radial + 1) // 2
    half = 1 / (2 * count / radial + 1.1)
    line = np.linspace(-1.0, 1.0, radial + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    number = np.arange((radial + 1) ** 2).reshape(radial + 1, radial + 1)
    core = half * np.stack([x, y], axis=-1).reshape(-1, 2)
    around = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
    angle = 5 * np.pi / 4 + np.arange(4 * radial) * np.pi / (2 * radial)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    shares = np.arange(1, count + 1)[:, None, None] / count
    rings = (1 - shares) * core[around] + shares * rim
    loops = np.vstack([around, len(core) + np.arange(rings.size // 2).reshape(-1, 4 * radial)])
    nodes = np.vstack([core, rings.reshape(-1, 2)])
    inner, outer = loops[:-1], loops[1:]
    ahead = [np.roll(loop, -1, axis=1) for loop in (inner, outer)]
    faces = [
        np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1),
        np.stack([inner, outer, ahead[1], ahead[0]], axis=-1),
    ]
    disc, squares = nodes, np.vstack([f.reshape(-1, 4) for f in faces])
    radius = diameter / 2 * _outside(radial / 2)
    per, levels = len(disc), np.linspace(0.0, height, axial + 1)
    require_nodes((per, axial + 1))
    nodes = np.hstack([np.tile(radius * disc, (axial + 1, 1)), np.repeat(levels, per)[:, None]])
    layers = (squares + per * np.arange(axial)[:, None, None]).reshape(-1, 4)
    cells = np.hstack([layers, layers + per])
    outside = boundary_facets(cells, 3)
    middles = nodes[outside].mean(axis=1)
    low, high = (np.isclose(middles[:, 2], z, atol=1e-9 * height) for z in (0.0, height))
    sets = {"lower_plate": low, "upper_plate": high, "rim": ~(low | high)}
    mesh = Mesh(nodes, cells, "hex8", {name: outside[on] for name, on in sets.items()})
    require_positive_cells(mesh)
    return mesh


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


# --- A quarter of an upright truncated cone, for compression between plates.

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
