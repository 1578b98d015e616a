"""Mesh of a measured body from its declared geometry, and its number of unknowns."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import ceil, pi, prod, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from validate.errors import SceneError, UsageError
from validate.files import modified
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.cost import NODAL_MEAN
from validate.scene.geometries.indented_bodies import IndentedBlock, IndentedCylinder
from validate.scene.geometries.specification import Box, Cylinder, Geometry, MeshFile
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

# --- Height and diameter of equal area of a specimen's mesh file, between its plates.

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
    area = float(np.abs(mesh.cell_volumes()).sum()) / height
    return {DIAMETER: 2 * sqrt(area / pi), HEIGHT: height}


# -------------------------------------------------------------------------------------------------

_BODIES = (Box, Cylinder, MeshFile, IndentedBlock, IndentedCylinder)


def mesh_of(p: Tree, folder: Path) -> Mesh:
    """Return the body with the facet set "surface" of all of it.

    The places of a mesh file are chosen on the mesh as it is, and halved with it: smaller facets
    beside a box would enter it, and the nearest one of a point is a quarter as large. Raises
    `UsageError` for another geometry, `SceneError` for a mesh of 2-D cells.
    """
    body = p.scene.body
    if not isinstance(body, _BODIES):
        raise UsageError(
            f"body: expected one of {', '.join(kind.__name__ for kind in _BODIES)}, not "
            f"{type(body).__name__}"
        )
    file = body.file if isinstance(body, MeshFile) else ""
    places = named_places(p.scene) if file else ()
    changed = modified(folder / file) if file else 0
    return _meshed(body, folder.resolve(), places, changed)


@lru_cache(maxsize=8)
def _meshed(body: Geometry, folder: Path, places: tuple[str, ...], changed: int) -> Mesh:
    """A file is read again where it has `changed`."""
    mesh = body.placed(folder, places) if isinstance(body, MeshFile) else body.resolved(folder)
    if mesh.dimension != 3:
        raise SceneError(f"cells of {mesh.kind}; a measured body needs 3-D cells")
    return replace(mesh, facets={**mesh.facets, "surface": mesh.surface})


def named_places(scene: Scene) -> tuple[str, ...]:
    """Return the places that hold and move a declared body, in words."""
    parts: tuple[Any, ...] = (
        *scene.supports, *scene.drives, *scene.contacts, *scene.tracked, *scene.loads
    )  # fmt: skip
    places = (getattr(part, "facets", None) for part in parts)
    return tuple(dict.fromkeys(text for text in places if isinstance(text, str)))


def even_axes(scene: Scene) -> tuple[bool, ...]:
    """Axes of a block along which every grid has a middle: in the plane of a place that it rests
    on, whose middle stays. A cylinder has an axis."""
    rests = [support for support in scene.supports if support.rests]
    if not rests or not isinstance(scene.body, Box):
        return ()
    return tuple(c not in rests[0].components for c in range(3))


def grid_unknowns(cells: Sequence[float], *, round_: bool) -> float:
    """Those of quadratic hexahedra: of a disc in squares, a core and rings about it."""
    if round_:
        n = cells[0]
        return 3 * (4 * n**2 + 4 * n + 1 + 16 * n * ceil(n / 2)) * (2 * cells[1] + 1)
    return 3 * prod(2 * n + 1 for n in cells)


def unknowns_of(p: Tree, order: int, folder: Path) -> float:
    """Return the unknowns of a mesh file in elements of this order; of a grid, quadratic ones."""
    body = p.scene.body
    if not isinstance(body, MeshFile):
        return grid_unknowns(body.cells, round_=is_round(body))
    mesh = mesh_of(p.with_scene(body=replace(body, element="linear")), folder)
    return float((mesh.quadratic() if order == 2 and not mesh.bricks else mesh).nodes.size)


def costs_of(p: Tree, order: int, folder: Path) -> float:
    """Return the unknowns that a solution costs: those of nodal mean dilatation count more."""
    N = unknowns_of(p, order, folder)
    filed = isinstance(p.scene.body, MeshFile)
    return N * NODAL_MEAN if filed and order == 1 and not mesh_of(p, folder).bricks else N


def is_round(body: Geometry) -> bool:
    return isinstance(body, Cylinder | IndentedCylinder)
