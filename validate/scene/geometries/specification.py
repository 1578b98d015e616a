"""Geometries: declared shapes that are meshed when a scene is resolved; upright cylinders.

    Box(("4 mm", "4 mm", "7 mm"), cells=(4, 4, 7))                 a block from the origin Box(...,
    element="hex27", symmetry=("x", "y"), grading=3.0)    a quarter of it Cylinder("30 mm", "20 mm",
    cells=(4, 6), element="hex27")      about z, from the origin up Cone("60 mm", "40 mm", "20 mm",
    cells=(4, 6))          a quarter, about z MeshFile("liver.vtk", unit="mm")
    beside the experiment's file SurfaceFile("liver.stl", unit="mm", edge="4 mm")
    filled with tetrahedra Sheet(...)                                                     two pads
    on it (`scene.geometries.sheet`)

Every number has a path (`body.cells`), and every geometry has a family of similar ones, which u_num
is found on.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import known, quantity, take_units
from validate.scene.geometries.box import box, grid, member
from validate.scene.geometries.refinement import coarser, linear, refined
from validate.scene.material import Material
from validate.scene.mesh import (
    Kind,
    Mesh,
    boundary_facets,
    kuhn_cells,
    require_nodes,
    require_positive_cells,
)
from validate.scene.mesh_files.mesh_file import filled, read_mesh
from validate.scene.places import facets_of, place_of
from validate.scene.scene import Scene, Support

# --- upright cylinders: hexahedra, or tetrahedra from mirror images of a quarter -----------------


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


# --- geometries: declared shapes that are meshed when a scene is resolved ------------------------

_AXES = "xyz"


@runtime_checkable
class Geometry(Protocol):
    """What a mesh is made from; `folder` is that of the experiment's file."""

    def resolved(self, folder: Path) -> Mesh: ...

    def scaled(self, share: float) -> "Geometry":
        """Return the similar one with about `share` of the cells along every edge."""
        ...

    def __hash__(self) -> int: ...


def cell_size(mesh: Mesh) -> float:
    """Return the edge m of a cube (in 2-D a square) as large as a mean cell."""
    return float(np.abs(mesh.cell_volumes()).mean() ** (1 / mesh.dimension))


def _of_order(mesh: Mesh, element: Kind) -> Mesh:
    return mesh.quadratic() if element in ("tri6", "tet10", "hex27") else mesh


@dataclass(frozen=True)
class Box:
    """A block [0, size], in 2-D a rectangle; facet sets x0, x1, y0, y1 (z0, z1).

    `symmetry` names the axes across whose middle planes the body is symmetric: the half, quarter or
    eighth from the middle (at 0) outwards is meshed, held across those planes. `cells` are those of
    the meshed part. `grading` above 1 shrinks them towards the ends at the far sides.
    """

    size: tuple[float, ...] = quantity((), "m", "lengths along the axes, of the whole body")
    cells: tuple[int, ...] = quantity((), "1", "cells along the axes, of the meshed part")
    element: Kind = quantity("tet4", "1", "element")
    grading: float = quantity(1.0, "1", "power that shrinks cells towards the far sides")
    symmetry: tuple[str, ...] = quantity((), "1", "axes across which half of the body is meshed")

    def __post_init__(self) -> None:
        take_units(self)
        if len(self.size) not in (2, 3) or len(self.cells) != len(self.size):
            raise SceneError(
                f"a block of {len(self.size)} sizes and {len(self.cells)} numbers of cells: give "
                "two or three of both"
            )
        if self.grading < 1 or not set(self.symmetry) <= set(_AXES[: len(self.size)]):
            raise SceneError(
                f"a block of grading {self.grading:g} (1 or above), symmetry {self.symmetry} (axes)"
            )

    @property
    def meshed(self) -> tuple[float, ...]:
        """Lengths m of the part that is meshed."""
        pairs = zip(self.size, _AXES, strict=False)
        return tuple(s / 2 if axis in self.symmetry else s for s, axis in pairs)

    def resolved(self, folder: Path) -> Mesh:
        bricks = self.element in ("quad4", "hex8", "hex27")
        even = (grid if bricks else box)(self.meshed, self.cells)
        if self.grading != 1:
            size = np.array(self.meshed)
            graded: Floats = size * (1 - (1 - even.nodes / size) ** self.grading)
            even = replace(even, nodes=graded)
        return _of_order(even, self.element)

    def scaled(self, share: float) -> "Box":
        return replace(self, cells=member(self.cells, share))

    @property
    def held(self) -> tuple[Support, ...]:
        """What symmetry holds."""
        return tuple(Support(f"{axis}0", (_AXES.index(axis),)) for axis in self.symmetry)

    @property
    def copies(self) -> int:
        return int(2 ** len(self.symmetry))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about z from the origin up; sets lower_plate, upper_plate, rim.

    A quarter has the sets symmetry_x and symmetry_y, which are held, and may be graded towards rim
    and plates. Sizes may stay open (None) until a recording states them.
    """

    diameter: float | None = quantity(None, "m", "diameter", asked=True)
    height: float | None = quantity(None, "m", "height", asked=True)
    cells: tuple[int, int] = quantity((4, 4), "1", "cells along the radius and the height")
    element: Kind = quantity("tet4", "1", "element")
    part: Literal["whole", "quarter"] = quantity("whole", "1", "what is meshed")
    grading: float = quantity(1.0, "1", "above 1: smaller cells towards rim and plates")

    def __post_init__(self) -> None:
        take_units(self)
        quarter, bricks = self.part == "quarter", self.element.startswith("hex")
        if (quarter and bricks) or (not quarter and self.grading != 1):
            raise SceneError(
                "a quarter of a cylinder is of tetrahedra, and only a quarter is graded"
            )

    def resolved(self, folder: Path) -> Mesh:
        size = known(self.diameter, "body.diameter"), known(self.height, "body.height")
        if self.part == "quarter":
            mesh = quarter_cylinder(*size, *self.cells, self.grading)
        elif self.element.startswith("hex"):
            mesh = hexahedral_cylinder(*size, *self.cells)
        else:
            mesh = whole_cylinder(*size, *self.cells)
        return _of_order(mesh, self.element)

    def scaled(self, share: float) -> "Cylinder":
        radial, axial = member(self.cells, share)
        return replace(self, cells=(radial, axial))

    @property
    def held(self) -> tuple[Support, ...]:
        sides = (("symmetry_x", 0), ("symmetry_y", 1)) if self.part == "quarter" else ()
        return tuple(Support(name, (axis,)) for name, axis in sides)

    @property
    def copies(self) -> int:
        return 4 if self.part == "quarter" else 1


@dataclass(frozen=True)
class Cone:
    """A quarter of an upright truncated cone about z, x and y >= 0, from the origin up.

    Sets bottom, top, side; symmetry_x and symmetry_y are held.
    """

    bottom: float = quantity(0.0, "m", "diameter at z = 0")
    top: float = quantity(0.0, "m", "diameter of the upper face")
    height: float = quantity(0.0, "m", "height")
    cells: tuple[int, int] = quantity((4, 4), "1", "cells along the radius and the height")
    element: Literal["tet4", "tet10"] = quantity("tet4", "1", "element")
    grading: float = quantity(1.0, "1", "above 1: smaller cells towards side and faces")

    def __post_init__(self) -> None:
        take_units(self)

    def resolved(self, folder: Path) -> Mesh:
        mesh = quarter_cone(self.bottom, self.top, self.height, *self.cells, self.grading)
        return _of_order(mesh, self.element)

    def scaled(self, share: float) -> "Cone":
        radial, axial = member(self.cells, share)
        return replace(self, cells=(radial, axial))

    @property
    def held(self) -> tuple[Support, ...]:
        return Support("symmetry_x", (0,)), Support("symmetry_y", (1,))

    @property
    def copies(self) -> int:
        return 4


@dataclass(frozen=True)
class MeshFile:
    """A mesh file of `scene.mesh_files.mesh_file` or `.third_party_meshes`, from the
    experiment's folder."""

    file: str = quantity("", "1", "mesh file")
    unit: str | None = quantity(None, "1", "unit of lengths in a file other than npz")
    halvings: int = quantity(
        0, "1", "times the cells' edges are cut in half; -1: filled anew, coarser"
    )
    element: Literal["as in the file", "linear", "quadratic"] = quantity(
        "as in the file", "1", "element order"
    )

    def resolved(self, folder: Path) -> Mesh:
        return self.placed(folder, ())

    def placed(self, folder: Path, places: tuple[str, ...]) -> Mesh:
        """With `places` in words as facet sets, chosen on the mesh as it is in the file, whose set
        "surface" is then all of it."""
        mesh = read_mesh(folder / self.file, self.unit)
        if places:
            mesh = linear(mesh)
            mesh = replace(mesh, facets={**mesh.facets, "surface": mesh.surface})
            chosen = {text: facets_of(mesh, place_of(text, mesh)) for text in places}
            mesh = replace(mesh, facets={**mesh.facets, **chosen})
        if self.halvings < 0:
            mesh = coarser(mesh, -self.halvings)
        for _ in range(self.halvings):
            mesh = refined(Scene(linear(mesh), Material(1.0, 0.3))).mesh
        if self.element == "linear":
            return linear(mesh)
        return mesh.quadratic() if self.element == "quadratic" and mesh.order == 1 else mesh

    def scaled(self, share: float) -> "MeshFile":
        halvings = self.halvings + round(np.log2(share))
        if halvings < self.halvings or halvings == self.halvings:
            raise SceneError(
                f"{self.file}: a mesh file has no similar mesh with {share:g} times the cells "
                "along an edge; use whole powers of 2 above 1"
            )
        return replace(self, halvings=halvings)


@dataclass(frozen=True)
class SurfaceFile:
    """A closed surface (STL, OBJ, PLY) that is filled with tetrahedra of about `edge`."""

    file: str = quantity("", "1", "surface file")
    unit: str = quantity("m", "1", "unit of lengths in it")
    edge: float = quantity(0.0, "m", "edge of the tetrahedra; 0: a twentieth of the diagonal")
    element: Literal["linear", "quadratic"] = quantity("linear", "1", "element order")

    def __post_init__(self) -> None:
        take_units(self)

    def resolved(self, folder: Path) -> Mesh:
        mesh = filled(folder / self.file, self.unit, self.edge).mesh
        return mesh.quadratic() if self.element == "quadratic" else mesh

    def scaled(self, share: float) -> "SurfaceFile":
        if self.edge <= 0:
            raise SceneError(f"{self.file}: body.edge is not set; its meshes are then not similar")
        return replace(self, edge=self.edge / share)
