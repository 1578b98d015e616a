"""The block with a capsule-shaped hole: the mesh of paper 000 and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from phantoms import BLOCK, CAPSULE, COARSE_GRID, PAPER_GRID, phantom_mesh

from validate.errors import SceneError
from validate.fem.cavity import cavity_surface
from validate.scene.geometries.inclusion import SIDES, Block, Capsule
from validate.scene.mesh import require_positive_cells


def test_paper_mesh_is_the_reconstruction_of_the_science_note() -> None:
    mesh = phantom_mesh(PAPER_GRID)
    wall = cavity_surface(mesh, "cyst", "cavity")
    assert len(mesh.nodes) == 1328
    assert len(mesh.cells) == 5748
    assert len(mesh.facet_nodes("cavity")) == 80
    assert len(mesh.facets["cavity"]) == 156
    # 4448.3 mm3 in the note; more digits from an assembly made apart from this one.
    assert 1e9 * wall.volume(mesh.nodes) == pytest.approx(4448.318, abs=5e-4)
    require_positive_cells(mesh)


def test_cells_and_cavity_fill_the_block() -> None:
    mesh = phantom_mesh(PAPER_GRID)
    hole = cavity_surface(mesh, "cyst", "cavity").volume(mesh.nodes)
    assert mesh.cell_volumes().sum() + hole == pytest.approx(np.prod(BLOCK.sizes), rel=1e-12)


def test_wall_nodes_lie_on_the_capsule_and_faces_on_the_block() -> None:
    mesh = phantom_mesh(COARSE_GRID)
    wall = mesh.nodes[mesh.facet_nodes("cavity")]
    assert np.abs(CAPSULE.distance(wall)).max() < 1e-16
    for name, (axis, end) in zip(
        SIDES, [(0, 0), (0, 0.060), (1, 0), (1, 0.045), (2, 0), (2, 0.070)], strict=True
    ):
        assert mesh.nodes[mesh.facet_nodes(name), axis] == pytest.approx(end, abs=1e-16)


def test_every_node_is_used() -> None:
    mesh = phantom_mesh(PAPER_GRID)
    assert np.array_equal(np.unique(mesh.cells), np.arange(len(mesh.nodes)))


def test_capsule_distances_and_volume() -> None:
    capsule = Capsule((1.0, 2.0, 3.0), 0.5, 2.0)
    points = np.array([[1.0, 2.0, 3.0], [1.5, 2.4, 3.0], [1.0, 3.0, 3.0], [1.0, 3.5, 3.0]])
    assert capsule.distance(points) == pytest.approx([-0.5, 0.0, 0.0, 0.5], abs=1e-15)
    assert capsule.distance(np.array([[2.0, 3.5, 3.0]]))[0] == pytest.approx(np.sqrt(2) - 0.5)
    assert capsule.volume == pytest.approx(np.pi * 0.25 * 1.0 + np.pi / 6, rel=1e-14)
    assert Capsule((0, 0, 0), 1.0, 2.0).volume == pytest.approx(4 * np.pi / 3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_capsule_may_lie_along_any_axis(axis: int) -> None:
    capsule = Capsule((0.0, 0.0, 0.0), 0.5, 3.0, axis)
    ends = 1.5 * np.eye(3)
    assert np.isclose(capsule.distance(ends), 0).tolist() == (np.arange(3) == axis).tolist()
    assert capsule.reach[axis] == 1.5


def test_projection_moves_radially() -> None:
    capsule = Capsule((0.0, 0.0, 0.0), 1.0, 4.0)
    moved = capsule.project(np.array([[0.3, 0.7, 0.4], [0.0, 5.0, 0.0], [0.1, -1.0, 0.0]]))
    assert moved == pytest.approx(np.array([[0.6, 0.7, 0.8], [0, 2.0, 0], [1.0, -1.0, 0]]))


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.floats(0.027, 0.033),
    st.floats(0.0215, 0.0235),
    st.floats(0.032, 0.038),
    st.floats(0.0080, 0.0090),
    st.floats(0.026, 0.030),
)
def test_off_centre_inclusions_give_positive_cells_and_a_closed_wall(
    x: float, y: float, z: float, radius: float, length: float
) -> None:
    capsule = Capsule((x, y, z), radius, length)
    mesh = BLOCK.around(PAPER_GRID, capsule)
    assert mesh.cell_volumes().min() > 0
    hole = cavity_surface(mesh, "cyst", "cavity").volume(mesh.nodes)
    assert mesh.cell_volumes().sum() + hole == pytest.approx(np.prod(BLOCK.sizes), rel=1e-11)
    assert 0.6 * capsule.volume < hole < capsule.volume


@settings(max_examples=30)
@given(
    st.floats(0.010, 0.050),
    st.floats(0.010, 0.035),
    st.floats(0.010, 0.060),
    st.floats(0.001, 0.012),
    st.floats(1.0, 3.0),
)
def test_far_off_inclusions_are_meshed_properly_or_refused(
    x: float, y: float, z: float, radius: float, slender: float
) -> None:
    """Projection inverts cells for about one in ten of a wide range: never silently."""
    capsule = Capsule((x, y, z), radius, 2 * radius * slender)
    try:
        mesh = BLOCK.around(COARSE_GRID, capsule)
    except SceneError:
        return
    assert mesh.cell_volumes().min() > 0
    assert cavity_surface(mesh, "cyst", "cavity").volume(mesh.nodes) > 0


@pytest.mark.parametrize(
    ("centre", "face"),
    [
        ((0.0085, 0.0225, 0.035), "x = 0"),
        ((0.030, 0.0135, 0.035), "y = 0"),
        ((0.030, 0.0225, 0.0080), "z = 0"),
        ((0.0525, 0.0225, 0.035), "x = max"),
        ((0.030, 0.0320, 0.035), "y = max"),
        ((0.030, 0.0225, 0.0616), "z = max"),
    ],
)
def test_inclusion_that_reaches_a_face_is_refused(
    centre: tuple[float, float, float], face: str
) -> None:
    with pytest.raises(SceneError, match=f"face {face} of the block"):
        BLOCK.around(PAPER_GRID, Capsule(centre, 0.0085, 0.028))


def test_inclusion_too_near_a_face_for_its_mesh_is_refused() -> None:
    with pytest.raises(SceneError, match=r"shares \d+ nodes with the outer faces"):
        BLOCK.around((9, 5, 15), Capsule((0.03, 0.0225, 0.035), 0.0085, 0.0445))


def test_inclusion_smaller_than_an_element_is_refused() -> None:
    with pytest.raises(SceneError, match=r"diameter 1 mm.*23.3 mm"):
        BLOCK.around((4, 4, 4), Capsule((0.03, 0.0225, 0.035), 0.0005, 0.001))


def test_an_element_counts_as_the_widest_beside_the_inclusion() -> None:
    """Off centre the grid is 26.7 mm along z; what it is along the inclusion does not count."""

    def diameter(mm: float) -> Capsule:
        return Capsule((0.03, 0.0225, 0.040), mm / 2e3, 0.030)

    with pytest.raises(SceneError, match=r"diameter 26.6 mm.*26.7 mm"):
        BLOCK.around((4, 4, 4), diameter(26.6))
    with pytest.raises(SceneError, match="no node of"):  # the next rule's words
        BLOCK.around((4, 4, 4), diameter(26.7))


def test_inclusion_between_the_nodes_is_refused() -> None:
    """As wide as an element, yet every node is outside."""
    with pytest.raises(SceneError, match=r"\(8, 8, 8\) mesh.* radius 5.2 mm"):
        BLOCK.around((8, 8, 8), Capsule((0.03, 0.0225, 0.035), 0.0052, 0.0104))


@pytest.mark.parametrize("grid", [(3, 10, 15), (9, 3, 15), (9, 10, 3)])
def test_grids_too_coarse_for_a_hole_are_refused(grid: tuple[int, int, int]) -> None:
    with pytest.raises(SceneError, match="at least 4 along each side"):
        BLOCK.around(grid, CAPSULE)


@pytest.mark.parametrize(("radius", "length"), [(0.0, 0.01), (-1.0, 1.0), (0.006, 0.011)])
def test_impossible_capsules_are_refused(radius: float, length: float) -> None:
    with pytest.raises(SceneError, match="at least two radii"):
        Capsule((0.0, 0.0, 0.0), radius, length)


def test_sizes_of_the_block() -> None:
    assert Block(1.0, 2.0, 3.0).sizes.tolist() == [1.0, 2.0, 3.0]
