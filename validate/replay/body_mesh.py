"""Mesh of a measured body: a mesh file, or the grid of a block or cylinder near cubes.

A grid belongs to a family of similar ones (`similar_grids`), which u_num is found on.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import ceil, prod
from pathlib import Path
from typing import Any

import numpy as np

from validate.errors import SceneError, UsageError
from validate.files import modified
from validate.replay.measured_cards import MeasuredBody, Solid
from validate.replay.measured_contact import pressed_mesh, spans_of
from validate.scene.box import box, grid
from validate.scene.coarser import coarser
from validate.scene.cylinder import hexahedral_cylinder, whole_cylinder
from validate.scene.material import Material
from validate.scene.mesh import Mesh, quadratic
from validate.scene.mesh_file import read_mesh
from validate.scene.named_place import place_of
from validate.scene.refine import linear, refined
from validate.scene.scene import Scene
from validate.scene.select import facets_of, nodes_of
from validate.scene.similar_grids import divided

_ACROSS = 2  # cells across a slender body
_ASPECT = 2.0  # length of its cells over their thickness
_UNKNOWNS = 10_000  # of a nominal mesh that has more cells than `body.cells` says
_FLAT = 5e-3  # of a sliding place's width
AXES = {"all": (0, 1, 2), "x": (0,), "y": (1,), "z": (2,)}


def mesh_of(p: MeasuredBody, body: Any) -> Mesh:
    """Return the mesh below an indenter, or that of `body`, a `body_of` of one folder."""
    if p.indenter.there and p.body.file is None:
        return pressed_mesh(gridded(p))
    mesh: Mesh = body(gridded(p).body, places=named_places(p), bricks=p.seen.outline is None)
    return mesh


def body_of(
    card: Solid, *, folder: Path, places: tuple[str, ...] = (), bricks: bool = True
) -> Mesh:
    """The body with the facet set "surface" of all of it; of 3-D cells.

    A block or cylinder is of hexahedra, or of tetrahedra, whose facets outlines need.

    The `places` of a mesh file are facet sets by their words, chosen on the mesh as it is and
    halved with it: smaller facets beside a box would enter it, and the nearest one of a point is
    a quarter as large.

    Raises `UsageError` for a card that says none, `SceneError` for a mesh of 2-D cells.
    """
    changed = modified(folder / card.file) if card.file else 0
    mesh = _meshed(card, folder.resolve(), places, bricks, changed)
    if mesh.dimension != 3:
        raise SceneError(f"{card.file}: cells of {mesh.kind}; expected 3-D cells")
    return replace(mesh, facets={**mesh.facets, "surface": mesh.surface})


@lru_cache(maxsize=8)
def _meshed(card: Solid, folder: Path, places: tuple[str, ...], bricks: bool, changed: int) -> Mesh:
    """The body of a card; a file is read again where it has `changed`."""
    if card.file is not None:
        whole = linear(read_mesh(folder / card.file, card.unit))
        scene = Scene(_with_places(whole, places), Material(1.0, 0.3))
        if card.halvings < 0:
            return coarser(scene.mesh, -card.halvings)
        for _ in range(card.halvings):
            scene = refined(scene)
        return scene.mesh
    if card.block:
        make = grid if bricks else box
        return make(card.block, card.divisions or divided(_ideal(card)))
    if card.cylinder:
        diameter, height = card.cylinder
        radial, axial = card.divisions or divided(_ideal(card))
        round_ = hexahedral_cylinder if bricks else whole_cylinder
        return round_(diameter, height, radial, axial)
    raise UsageError("no body is given; set body.file, body.block or body.cylinder")


def _with_places(mesh: Mesh, places: tuple[str, ...]) -> Mesh:
    whole = replace(mesh, facets={**mesh.facets, "surface": mesh.surface})
    chosen = {text: facets_of(whole, place_of(text, whole)) for text in places}
    return replace(whole, facets={**whole.facets, **chosen})


def named_places(p: MeasuredBody) -> tuple[str, ...]:
    """Return the places that hold and move the body, in words."""
    said = (*(getattr(p.held, name) for name in (*AXES, "slides")), p.moved.place)
    return tuple(text for text in said if text)


def slides_across(text: str, mesh: Mesh) -> int:
    """The axis that a flat place lies across; raises `SceneError` for one that is not flat."""
    x = mesh.nodes[nodes_of(mesh, place_of(text, mesh))]
    spread = np.ptp(x, axis=0)
    if spread.min() > _FLAT * spread.max():
        raise SceneError(
            f"held.slides = {text}: {1e3 * spread.min():.3g} mm out of flat; a sliding place must "
            "be a plane normal to x, y or z"
        )
    return int(spread.argmin())


def gridded(p: MeasuredBody) -> MeasuredBody:
    """With `body.divisions`: a grid near `body.cells` whose family of similar grids is rich, and
    which has a node in the middle of a plate that the body slides on."""
    if p.body.file is not None or p.body.divisions or not (p.body.block or p.body.cylinder):
        return p
    if p.indenter.there:
        spans = spans_of(p)
        ideal = tuple(p.body.cells * s / max(spans) for s in spans)
    else:
        ideal = _ideal(p.body)
    cells = divided(ideal, even_axes(p))
    return replace(p, body=replace(p.body, divisions=cells))


def _ideal(card: Solid) -> tuple[float, ...]:
    """Cells per axis (of a cylinder along radius and height): cubes where the body is compact.

    A slender or thin body has `_ACROSS` cells across it, at most `_ASPECT` times as long as they
    are thick, as far as `_UNKNOWNS` allow.
    """
    lengths = card.block or (card.cylinder[0] / 2, card.cylinder[1])
    thick = min(lengths) / _ACROSS

    def cells(edge: float) -> tuple[float, ...]:
        return tuple(max(length / edge, _ACROSS) for length in lengths)

    cubes = max(card.block or card.cylinder) / card.cells
    edge = min(cubes, _ASPECT * thick)
    while edge < cubes and grid_unknowns(cells(edge), round_=bool(card.cylinder)) > _UNKNOWNS:
        edge = min(1.1 * edge, cubes)
    return cells(edge)


def even_axes(p: MeasuredBody) -> tuple[bool, ...]:
    """Axes of a block along which every grid has a middle: in the plane of a place that slides,
    whose middle is pinned. A cylinder has an axis."""
    if not (p.held.slides and p.body.block):
        return ()
    across = slides_across(p.held.slides, body_of(p.body, folder=Path()))
    return tuple(c != across for c in range(3))


def grid_unknowns(cells: Sequence[float], *, round_: bool) -> float:
    """Those of quadratic hexahedra: of a disc in squares, a core and rings about it."""
    if round_:
        n = cells[0]
        return 3 * (4 * n**2 + 4 * n + 1 + 16 * n * ceil(n / 2)) * (2 * cells[1] + 1)
    return 3 * prod(2 * n + 1 for n in cells)


def unknowns_of(p: MeasuredBody, order: int, folder: Path) -> float:
    """Return the unknowns of a mesh file in elements of this order; of a grid, quadratic ones."""
    if p.body.file is None:
        return grid_unknowns(gridded(p).body.divisions, round_=bool(p.body.cylinder))
    mesh = body_of(p.body, folder=folder, places=named_places(p))
    return float((quadratic(mesh) if order == 2 and not mesh.bricks else mesh).nodes.size)
