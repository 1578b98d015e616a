"""Geometries that are resolved late: volumes, symmetry, similar families, files."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from validate.errors import SceneError, UsageError
from validate.parameters import with_given
from validate.scene.geometries.box import grid
from validate.scene.geometries.specification import (
    Box,
    Cylinder,
    Geometry,
    MeshFile,
    SurfaceFile,
    cell_size,
)
from validate.scene.material import Material, Region
from validate.scene.mesh_files.mesh_file import write_mesh
from validate.scene.places import OnPlane, facets_of, nodes_of, place_of
from validate.scene.scene import Foundation, Mass, Membrane, Scene, Support

HERE = Path()
BOX = Box((0.02, 0.01, 0.04), (4, 2, 8))
ROUND = Cylinder(0.03, 0.02, (4, 4))


@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8", "hex27"])
@pytest.mark.parametrize(("symmetry", "share"), [((), 1.0), (("x",), 0.5), (("x", "y"), 0.25)])
def test_a_block_has_its_volume(element: str, symmetry: tuple[str, ...], share: float) -> None:
    box = replace(BOX, element=element, symmetry=symmetry)
    mesh = box.resolved(HERE)
    assert mesh.kind == element
    assert mesh.cell_volumes().sum() == pytest.approx(share * 8e-6, rel=1e-9)
    assert box.copies * share == 1
    assert [s.facets for s in box.held] == [f"{axis}0" for axis in symmetry]


@pytest.mark.parametrize("body", [BOX, replace(BOX, grading=2.0), ROUND,
                                  replace(ROUND, part="quarter", grading=2.0)])  # fmt: skip
def test_similar_ones_scale_every_cell_by_one_factor(body: Geometry) -> None:
    fine, coarse = (cell_size(b.resolved(HERE)) for b in (body, body.scaled(0.5)))
    assert coarse / fine == pytest.approx(2.0, rel=0.02)


def test_symmetry_is_held_and_its_copies_are_whole() -> None:
    quarter = replace(BOX, symmetry=("x", "y"))
    scene = Scene(quarter, Material(1e3, 0.3), (Support("zmax"),))
    resolved = scene.resolved(quarter.resolved(HERE))
    assert resolved.copies == 4
    assert [s.components for s in resolved.supports] == [(0, 1, 2), (0,), (1,)]


def test_texts_have_units_and_numbers_are_si() -> None:
    assert Box(("2 cm", "10 mm", 0.04), (4, 2, 8)) == BOX  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="size=2 kPa: expected m"):
        Box(("2 kPa", "1 mm", "1 mm"), (1, 1, 1))  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="2 sizes and 3 numbers of cells"):
        Box((1.0, 1.0), (1, 1, 1))


def test_a_mesh_file_is_halved_and_has_no_coarser_one(tmp_path: Path) -> None:
    write_mesh(grid((1.0, 1.0, 1.0), (1, 1, 2)), tmp_path / "b.npz")
    body = MeshFile("b.npz")
    assert len(body.scaled(2.0).resolved(tmp_path).cells) == 8 * len(body.resolved(tmp_path).cells)
    with pytest.raises(SceneError, match="whole powers of 2 above 1"):
        body.scaled(0.5)
    with pytest.raises(SceneError, match=r"body\.edge is not set"):
        SurfaceFile("b.stl").scaled(2.0)


def test_the_side_of_a_body_is_what_faces_that_way() -> None:
    """The top layer is a thousandth of the body high, thinner than a filled surface is uneven."""
    mesh = grid((1.0, 1.0, 1.0), (2, 2, 4))
    thin = replace(
        mesh, nodes=np.column_stack([mesh.nodes[:, :2], 1 - (1 - mesh.nodes[:, 2]) ** 5])
    )
    assert len(nodes_of(thin, place_of("zmax", thin))) == 9


def test_a_region_is_the_cells_in_a_box_of_the_bodys_own_material() -> None:
    layer = Region("layer", where="box 0,0,1cm to 1m,1m,2cm", contrast=5.0)
    scene = Scene(BOX, Material(1e3, 0.3), (Support("zmin"),), regions=(layer,))
    (found,) = scene.resolved(BOX.resolved(HERE)).regions
    assert (found.material.E, found.material.nu) == (5e3, 0.3)
    assert len(found.cells) == 6 * 4 * 2 * 2


def test_a_declared_foundation_slips_has_springs_or_holds_its_places() -> None:
    """On every place that is joined by "+"; a sheet of no thickness is none."""
    ground = Foundation("x0 + zmax", (1, 2), 1e5, "slip", "plates")
    sheet = Membrane("z0", 0.0, Material(1e6, 0.3), "wall")
    block = Box((1.0, 1.0, 1.0), cells=(1, 1, 1))
    declared = Scene(block, Material(1.0, 0.3), foundations=(ground,), membranes=(sheet,))
    mesh = block.resolved(Path())

    def made(**changes: Any) -> Scene:
        return with_given(declared, changes).resolved(mesh)  # type: ignore[no-any-return]

    slips = declared.resolved(mesh)
    assert (slips.supports, slips.foundations, slips.membranes) == ((), (), ())
    held = made(**{"foundations.plates.contact": "bonded"})
    assert [s.components for s in held.supports] == [(1, 2)] * 2
    assert nodes_of(mesh, held.supports[1].facets).tolist() == nodes_of(mesh, "z1").tolist()
    springs = made(**{"foundations.plates.contact": "partial", "membranes.wall.thickness": "1 mm"})
    assert springs.foundations[0].facets == "x0"
    assert [f.stiffness for f in springs.foundations] == [1e5, 1e5]
    assert [m.thickness for m in springs.membranes] == [1e-3]
    with pytest.raises(SceneError, match=r"'plates'.*'slip'"):
        replace(slips, foundations=(replace(ground, facets="x0"),))


def test_two_sides_share_an_edge_and_no_mass_is_none() -> None:
    """Words choose the edge as planes do, on quadratic cells too; a mass of 0 hangs nowhere."""
    size = (0.1, 0.03, 0.02)
    body = Box(size, cells=(3, 2, 2), element="hex27")
    scene = Scene(body, Material(1.0, 0.3), (Support("x0"),), masses=(Mass("one", "x1 & z1", 1.0),))
    mesh = body.resolved(Path())
    end, top = OnPlane((0.1, 0.0, 0.0), (1.0, 0.0, 0.0)), OnPlane((0.0, 0.0, 0.02), (0.0, 0.0, 1.0))
    expected = (end & top).edges.entities(mesh)
    for words in ("x1 & z1", "xmax & zmax"):
        named = replace(scene, masses=(Mass("one", words, 1.0),)).resolved(mesh)
        assert facets_of(mesh, named.masses[0].facets).tolist() == expected.tolist()
    assert replace(scene, masses=(Mass("one", "x1 & z1", 0.0),)).resolved(mesh).masses == ()
    with pytest.raises(SceneError, match="none of"):
        replace(scene, masses=(Mass("one", "x0 & x1", 1.0),)).resolved(mesh)
