"""Geometries: declared shapes that are meshed when a scene is resolved.

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
from validate.scene.geometries.cylinder import (
    hexahedral_cylinder,
    quarter_cone,
    quarter_cylinder,
    whole_cylinder,
)
from validate.scene.geometries.refinement import coarser, linear, refined
from validate.scene.material import Material
from validate.scene.mesh import Kind, Mesh, cell_volumes, quadratic
from validate.scene.mesh_files.mesh_file import filled, read_mesh
from validate.scene.places import facets_of, place_of
from validate.scene.scene import Scene, Support

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
    return float(np.abs(cell_volumes(mesh)).mean() ** (1 / mesh.dimension))


def _of_order(mesh: Mesh, element: Kind) -> Mesh:
    return quadratic(mesh) if element in ("tri6", "tet10", "hex27") else mesh


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
    """A mesh file of `scene.mesh_files.mesh_file` or `scene.mesh_files.foreign_mesh`, from the
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
        return quadratic(mesh) if self.element == "quadratic" and mesh.order == 1 else mesh

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
        return quadratic(mesh) if self.element == "quadratic" else mesh

    def scaled(self, share: float) -> "SurfaceFile":
        if self.edge <= 0:
            raise SceneError(f"{self.file}: body.edge is not set; its meshes are then not similar")
        return replace(self, edge=self.edge / share)
