"""Meshes: orientation, closed boundaries, Kuhn's split, quadratic nodes, checks at the door."""

from itertools import product

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh

from validate.errors import SceneError
from validate.scene.geometries.specification import quarter_cylinder
from validate.scene.mesh import EDGES, Mesh, boundary_facets, kuhn_cells, require_positive_cells

UNIT_TET = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def grid_nodes(shape: tuple[int, ...]) -> np.ndarray:
    lines = [np.linspace(0, 1, n) for n in shape]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, len(shape))


def area_vectors(nodes: np.ndarray, facets: np.ndarray) -> np.ndarray:
    x = nodes[facets[:, :3]]
    return np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2


@pytest.mark.parametrize("shape", [(2, 2, 2), (3, 2, 4), (4, 5, 3)])
def test_kuhn_split_fills_the_box_with_six_equal_tetrahedra_per_cell(
    shape: tuple[int, int, int],
) -> None:
    mesh = Mesh(grid_nodes(shape), kuhn_cells(shape), "tet4")
    boxes = int(np.prod(np.array(shape) - 1))
    assert len(mesh.cells) == 6 * boxes
    assert mesh.cell_volumes() == pytest.approx(np.full(6 * boxes, 1 / (6 * boxes)), rel=1e-12)


def test_kuhn_split_in_the_plane_and_its_diagonal() -> None:
    mesh = Mesh(grid_nodes((3, 4)), kuhn_cells((3, 4)), "tri3")
    assert len(mesh.cells) == 12
    assert mesh.cell_volumes() == pytest.approx(np.full(12, 1 / 12), rel=1e-12)
    # Every tetrahedron of a box holds its first and last corner: the diagonal (0,0,0)-(1,1,1).
    cells = kuhn_cells((2, 2, 2))
    assert ((cells == 0).any(axis=1) & (cells == 7).any(axis=1)).all()


def test_kuhn_split_is_conforming() -> None:
    """An inner facet belongs to two cells; the outside of a grid is 2 triangles per square."""
    assert len(boundary_facets(kuhn_cells((3, 4, 5)), 3)) == 2 * 2 * (2 * 3 + 3 * 4 + 2 * 4)


def test_boundary_facets_of_one_tetrahedron_point_outward() -> None:
    facets = boundary_facets(np.array([[0, 1, 2, 3]]), 3)
    x = UNIT_TET[facets]
    outward = x.mean(axis=1) - UNIT_TET.mean(axis=0)
    areas = area_vectors(UNIT_TET, facets)
    assert len(facets) == 4
    assert ((outward * areas).sum(axis=1) > 0).all()


@pytest.mark.parametrize(
    "mesh",
    [phantom_mesh(COARSE_GRID), quarter_cylinder(0.05, 0.03, 3, 2)],
    ids=["inclusion", "cylinder"],
)
def test_boundary_is_closed_and_encloses_the_cells(mesh: Mesh) -> None:
    facets = boundary_facets(mesh.cells, 3)
    areas = area_vectors(mesh.nodes, facets)
    assert np.abs(areas.sum(axis=0)).max() < 1e-15 * len(facets)
    enclosed = (mesh.nodes[facets].mean(axis=1) * areas).sum() / 3
    assert enclosed == pytest.approx(mesh.cell_volumes().sum(), rel=1e-12)


def test_named_sets_are_the_whole_boundary_once() -> None:
    mesh = phantom_mesh(COARSE_GRID)
    named = np.sort(np.vstack(list(mesh.facets.values())), axis=1)
    outside = np.sort(boundary_facets(mesh.cells, 3), axis=1)
    assert sorted(map(tuple, named)) == sorted(map(tuple, outside))


def test_quadratic_puts_one_node_in_the_middle_of_every_edge() -> None:
    linear = phantom_mesh(COARSE_GRID)
    mesh = linear.quadratic()
    n = len(linear.nodes)
    assert (mesh.kind, mesh.order) == ("tet10", 2)
    assert np.array_equal(mesh.nodes[:n], linear.nodes)
    assert np.array_equal(mesh.corners, linear.cells)
    for local, (i, j) in enumerate(EDGES[3]):
        middle = mesh.nodes[mesh.cells[:, [i, j]]].mean(axis=1)
        assert mesh.nodes[mesh.cells[:, 4 + local]] == pytest.approx(middle, abs=1e-15)
    edges = np.sort(linear.cells[:, list(EDGES[3])].reshape(-1, 2), axis=1)
    assert len(mesh.nodes) == n + len(np.unique(edges, axis=0))
    assert mesh.cell_volumes() == pytest.approx(linear.cell_volumes(), rel=1e-15)


def test_quadratic_facets_carry_their_own_middles() -> None:
    mesh = phantom_mesh(COARSE_GRID).quadratic()
    for facets in mesh.facets.values():
        for local, (i, j) in enumerate(EDGES[2]):
            middle = mesh.nodes[facets[:, [i, j]]].mean(axis=1)
            assert mesh.nodes[facets[:, 3 + local]] == pytest.approx(middle, abs=1e-15)


def test_quadratic_in_the_plane_and_twice() -> None:
    square = Mesh(grid_nodes((2, 2)), kuhn_cells((2, 2)), "tri3", {"side": np.array([[0, 1]])})
    mesh = square.quadratic()
    assert mesh.kind == "tri6"
    assert mesh.nodes[mesh.facets["side"][0, 2]] == pytest.approx([0.0, 0.5])
    assert mesh.quadratic() is mesh


def test_inverted_element_is_named_by_its_number_and_volume() -> None:
    cells = kuhn_cells((3, 3, 3))
    cells[17, [0, 1]] = cells[17, [1, 0]]
    mesh = Mesh(1e-3 * grid_nodes((3, 3, 3)), cells, "tet4")
    with pytest.raises(SceneError, match=r"1 of 48 .* element 17 with -0\.02083 mm3"):
        require_positive_cells(mesh)


def test_flat_element_is_refused() -> None:
    nodes = np.vstack([UNIT_TET, [[1.0, 1.0, 0.0]]])
    with pytest.raises(SceneError, match=r"1 of 2 elements.*element 1"):
        require_positive_cells(Mesh(nodes, np.array([[0, 1, 2, 3], [0, 1, 2, 4]]), "tet4"))


def test_arrays_of_a_mesh_are_own_read_only_copies() -> None:
    nodes, cells = UNIT_TET.copy(), np.array([[0, 1, 2, 3]])
    mesh = Mesh(nodes, cells, "tet4", {"base": np.array([[0, 2, 1]])})
    nodes[0, 0] = 9.0
    assert mesh.nodes[0, 0] == 0.0
    for array in (mesh.nodes, mesh.cells, mesh.facets["base"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1
    with pytest.raises(TypeError):
        mesh.facets["base"] = cells  # type: ignore[index]


@pytest.mark.parametrize(
    ("nodes", "cells", "message"),
    [
        (UNIT_TET.T[:, :3], [[0, 1, 2, 3]], "outside 0..2"),
        (UNIT_TET[:, :2], [[0, 1, 2, 3]], r"mesh nodes \[m\]: shape \(4, 2\)"),
        (UNIT_TET, [[0, 1, 2]], r"cells: shape \(1, 3\)"),
        (UNIT_TET, [[0, 1, 2, 4]], "entries 0..4 outside 0..3"),
        (UNIT_TET * [1, 1, np.nan], [[0, 1, 2, 3]], "4 of 12 values not finite"),
    ],
)
def test_arrays_of_a_wrong_shape_or_content_are_refused(
    nodes: np.ndarray, cells: list[list[int]], message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        Mesh(nodes, np.array(cells), "tet4")


def test_facet_nodes_and_nearest_node() -> None:
    mesh = quarter_cylinder(0.05, 0.03, 2, 3, inscribed=True)
    top = mesh.facet_nodes("upper_plate")
    assert np.array_equal(top, np.flatnonzero(mesh.nodes[:, 2] > 0.03 - 1e-9))
    for corner in product((0.0, 0.025), (0.0,), (0.0, 0.03)):
        found = mesh.nearest_node(np.array(corner))
        assert mesh.nodes[found] == pytest.approx(corner, abs=1e-12)
    with pytest.raises(SceneError, match=r"no facets 'lid'; it has .*'upper_plate'"):
        mesh.facet_nodes("lid")
