"""Mesh of a measured body: of its declared geometry, and how many unknowns it has."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import ceil, prod
from pathlib import Path
from typing import Any

from validate.errors import SceneError, UsageError
from validate.files import modified
from validate.replay.cost import NODAL_MEAN
from validate.replay.tree import Tree
from validate.scene.geometry import Box, Cylinder, Geometry, MeshFile
from validate.scene.indented import IndentedBlock, IndentedCylinder
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import Scene

_BODIES = (Box, Cylinder, MeshFile, IndentedBlock, IndentedCylinder)


def mesh_of(p: Tree, folder: Path) -> Mesh:
    """The body with the facet set "surface" of all of it.

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
    """The places that hold and move a declared body, in words."""
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
    return float((quadratic(mesh) if order == 2 and not mesh.bricks else mesh).nodes.size)


def costs_of(p: Tree, order: int, folder: Path) -> float:
    """The unknowns that a solution costs: those of nodal mean dilatation count more."""
    N = unknowns_of(p, order, folder)
    filed = isinstance(p.scene.body, MeshFile)
    return N * NODAL_MEAN if filed and order == 1 and not mesh_of(p, folder).bricks else N


def is_round(body: Geometry) -> bool:
    return isinstance(body, Cylinder | IndentedCylinder)
