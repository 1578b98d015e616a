"""Quadrilaterals and hexahedra: numbering, volumes, sides, and what scenes of them refuse."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.bending_rod.body import bending_rod
from experiments.needle_block.body import needle_block
from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.geometries.box import box, grid
from validate.scene.geometries.refinement import linear, refined
from validate.scene.material import Material
from validate.scene.mesh import Mesh, boundary_facets, require_positive_cells
from validate.scene.scene import Cavity, Drive, Foundation, Scene, Weight
from validate.scene.shape_functions import CORNERS

BLOCKS = [((3.0, 2.0, 1.0), (2, 3, 4)), ((3.0, 2.0), (2, 3)), ((1.0, 1.0), (1, 1))]


@pytest.mark.parametrize(("size", "cells"), BLOCKS)
def test_bricks_fill_the_block_and_number_as_the_simplices_do(
    size: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    mesh, split = grid(size, cells), box(size, cells)
    assert np.array_equal(mesh.nodes, split.nodes)
    assert len(mesh.cells) == np.prod(cells)
    assert mesh.cell_volumes() == pytest.approx(
        np.full(len(mesh.cells), np.prod(size / np.array(cells)))
    )
    first = mesh.nodes[mesh.cells[0]] * np.array(cells) / np.array(size)
    assert first == pytest.approx(CORNERS[len(size)])
    for name, facets in split.facets.items():
        assert np.array_equal(mesh.facet_nodes(name), np.unique(facets))
    require_positive_cells(mesh)


def test_facets_point_outward() -> None:
    """Their vector areas times the place sum to d times the volume (divergence theorem), and each
    looks away from the middle."""
    mesh = grid((3.0, 2.0, 1.0), (2, 3, 4))
    x = mesh.nodes[boundary_facets(mesh.corners, 3)]
    areas = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]) / 2
    assert (areas * x.mean(axis=1)).sum() == pytest.approx(3 * 6.0)
    assert (areas * (x.mean(axis=1) - [1.5, 1.0, 0.5])).sum(axis=1).min() > 0
    flat = grid((3.0, 2.0), (2, 3))
    ends = flat.nodes[boundary_facets(flat.corners, 2)]
    along = ends[:, 1] - ends[:, 0]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    assert (outward * ends.mean(axis=1)).sum() == pytest.approx(2 * 6.0)
    assert (outward * (ends.mean(axis=1) - [1.5, 1.0])).sum(axis=1).min() > 0


@pytest.mark.parametrize(("size", "cells"), BLOCKS)
def test_split_bricks_fill_the_mesh_and_meet(
    size: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    mesh, d = grid(size, cells), len(size)
    x = mesh.nodes[mesh.simplices]
    volumes = np.linalg.det(x[:, 1:] - x[:, :1])
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(np.prod(size) * {2: 2, 3: 6}[d])
    sides = sum(len(f) for f in mesh.facets.values())
    assert len(boundary_facets(mesh.simplices, d)) == sides * (d - 1)


def test_a_folded_quadrilateral_is_refused_though_its_area_is_positive() -> None:
    dart = Mesh(np.array([[0, 0], [1, 0], [0.2, 0.2], [0, 1.0]]), np.array([[0, 1, 2, 3]]), "quad4")
    assert dart.cell_volumes()[0] == pytest.approx(0.2)
    with pytest.raises(SceneError, match="1 of 1 elements inverted or flat"):
        require_positive_cells(dart)


def test_hexahedra_are_halved_as_a_finer_grid_has_them() -> None:
    """Sheared: the same nodes, cells and facets as the grid of twice the cells an edge."""
    shear = np.array([[1, 0, 0], [0.3, 1, 0], [0, 0.2, 1]])
    coarse, fine = (grid((1.0, 2.0, 3.0), cells) for cells in ((1, 2, 1), (2, 4, 2)))
    body = Mesh(coarse.nodes @ shear, coarse.cells, "hex8", coarse.facets)
    got = refined(Scene(body.quadratic(), Material(1.0, 0.3))).mesh
    assert got.kind == "hex8"
    assert got.cell_volumes() == pytest.approx(np.full(16, 6 / 16))

    def places(nodes: Floats, rows: Ints) -> list[list[tuple[float, ...]]]:
        x = np.round(nodes[rows], 9) + 0.0
        return sorted(sorted(map(tuple, one)) for one in x.tolist())

    assert places(got.nodes, got.cells) == places(fine.nodes @ shear, fine.cells)
    for name, facets in fine.facets.items():
        assert places(got.nodes, got.facets[name]) == places(fine.nodes @ shear, facets)
    flat = np.cross(
        got.nodes[got.facets["z1"][:, 1]] - got.nodes[got.facets["z1"][:, 0]],
        got.nodes[got.facets["z1"][:, 3]] - got.nodes[got.facets["z1"][:, 0]],
    )
    assert (flat[:, 2] > 0).all()  # outward, as they were


def test_what_bricks_do_not_have_is_refused() -> None:
    rod = bending_rod(1)
    with pytest.raises(SceneError, match="quad4 have no quadratic form"):
        needle_block(4).mesh.quadratic()
    with pytest.raises(SceneError, match="quad4 have no quadratic form"):
        refined(needle_block(4))
    with pytest.raises(SceneError, match=r"nodal mean dilatation.*hex8"):
        replace(rod, dilatation="nodal_mean")
    with pytest.raises(SceneError, match="need triangular facets"):
        replace(rod, foundations=(Foundation("z0", (0,), 1.0),))
    with pytest.raises(SceneError, match="need triangular facets"):
        replace(rod, cavities=(Cavity("c", "z0"),))


def test_plane_states_and_thicknesses_are_those_of_two_dimensions() -> None:
    block = needle_block(4)
    with pytest.raises(SceneError, match="thickness 0 m"):
        replace(block, thickness=0.0)
    with pytest.raises(SceneError, match=r"plane stress of 1 m: for 2-D meshes only"):
        replace(bending_rod(1), plane="stress")
    with pytest.raises(SceneError, match="cavities in 2-D are per metre"):
        replace(block, thickness=0.1, cavities=(Cavity("c", "x1"),))


def test_drives_and_weights_are_checked() -> None:
    with pytest.raises(SceneError, match="expected finite speeds and increasing"):
        Drive("d", "x1", (1.0, 0.0), speeds=((1.0, 0.1), (0.0, 0.2)))
    with pytest.raises(SceneError, match="direction of length 2"):
        Weight("w", (0.0, 2.0))
    with pytest.raises(SceneError, match="needle block of 5 cells a side"):
        needle_block(5)
    with pytest.raises(SceneError, match="at least 1"):
        bending_rod(0)
    scene = Scene(grid((1.0, 1.0), (1, 1)), Material(1.0, 0.3), loads=(Weight("w", (0.0, -1.0)),))
    assert scene.inputs == ("w",)


def test_quadratic_hexahedra_have_a_node_at_every_place_once() -> None:
    mesh = grid((3.0, 2.0, 1.0), (2, 3, 1))
    fine = mesh.quadratic()
    assert (fine.kind, fine.order, len(fine.nodes)) == ("hex27", 2, 5 * 7 * 3)
    assert np.array_equal(fine.nodes[: len(mesh.nodes)], mesh.nodes)
    assert np.unique(fine.nodes.round(9), axis=0).shape == fine.nodes.shape
    assert np.array_equal(fine.corners, mesh.cells)
    assert (
        np.ptp(fine.nodes[fine.cells[:, 8:]].mean(axis=1) - fine.nodes[fine.cells[:, 26]]) < 1e-15
    )
    for name, facets in fine.facets.items():
        assert np.array_equal(facets[:, :4], mesh.facets[name])
        assert fine.nodes[facets[:, 8]] == pytest.approx(fine.nodes[facets[:, :4]].mean(axis=1))
    sides = np.sort(np.vstack(list(fine.facets.values())), axis=1)
    found = np.sort(boundary_facets(fine.cells, 3), axis=1)
    assert {tuple(f) for f in found.tolist()} == {tuple(f) for f in sides.tolist()}
    assert linear(fine).kind == "hex8"
    assert np.array_equal(linear(fine).facets["x1"], mesh.facets["x1"])
