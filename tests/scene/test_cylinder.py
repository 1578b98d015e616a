"""The quarter cylinder: its volume converges at second order, its planes are planes."""

import numpy as np
import pytest

from validate.errors import SceneError
from validate.scene.geometries.specification import hexahedral_cylinder, quarter_cylinder
from validate.scene.mesh import boundary_facets, require_positive_cells

EXACT = np.pi * 0.05**2 / 16 * 0.03


@pytest.mark.parametrize(("radial", "grading"), [(1, 1.0), (2, 2.0), (6, 1.0)])
def test_the_mesh_has_the_circles_area(radial: int, grading: float) -> None:
    """A polygon of 16 corners on the circle has 97.45 % of it, and so would the force."""
    mesh = quarter_cylinder(0.05, 0.03, radial, 2, grading)
    assert mesh.cell_volumes().sum() == pytest.approx(EXACT, rel=1e-12)


def test_volume_converges_to_the_exact_one_at_second_order() -> None:
    volumes = [
        quarter_cylinder(0.05, 0.03, n, 2, inscribed=True).cell_volumes().sum() for n in (4, 8, 16)
    ]
    errors = 1 - np.array(volumes) / EXACT
    assert errors.min() > 0  # inscribed polygon
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize(("radial", "axial"), [(1, 1), (2, 3), (5, 4)])
def test_volume_is_that_of_the_inscribed_polygon(radial: int, axial: int) -> None:
    """Each of the 2 n equal sectors of the rim is a triangle of area R^2 sin(pi / 4 n) / 2."""
    mesh = quarter_cylinder(0.05, 0.03, radial, axial, inscribed=True)
    area = radial * 0.025**2 * np.sin(np.pi / (4 * radial))
    assert len(mesh.nodes) == (radial + 1) ** 2 * (axial + 1)
    assert len(mesh.cells) == 6 * radial**2 * axial
    assert mesh.cell_volumes().min() > 0
    assert mesh.cell_volumes().sum() == pytest.approx(0.03 * area, rel=1e-12)


def test_sets_lie_on_their_planes_and_cover_the_boundary() -> None:
    mesh = quarter_cylinder(0.05, 0.03, 3, 4, inscribed=True)
    x = {name: mesh.nodes[mesh.facet_nodes(name)] for name in mesh.facets}
    assert np.abs(x["lower_plate"][:, 2]).max() == 0
    assert x["upper_plate"][:, 2] == pytest.approx(0.03)
    assert np.abs(x["symmetry_x"][:, 0]).max() < 1e-17
    assert np.abs(x["symmetry_y"][:, 1]).max() < 1e-17
    assert np.hypot(*x["rim"][:, :2].T) == pytest.approx(0.025, rel=1e-14)
    named = sum(len(f) for f in mesh.facets.values())
    assert named == len(boundary_facets(mesh.cells, 3))


@pytest.mark.parametrize(
    ("diameter", "height", "radial", "axial"),
    [(0.0, 0.03, 2, 2), (0.05, -0.03, 2, 2), (0.05, 0.03, 0, 2), (0.05, 0.03, 2, 0)],
)
def test_empty_cylinders_are_refused(
    diameter: float, height: float, radial: int, axial: int
) -> None:
    with pytest.raises(SceneError, match="all must be positive"):
        quarter_cylinder(diameter, height, radial, axial)


def test_grading_shrinks_cells_towards_rim_and_plates_and_keeps_the_volume() -> None:
    plain, graded = (quarter_cylinder(0.05, 0.03, 6, 8, g, inscribed=True) for g in (1.0, 2.0))
    assert graded.cell_volumes().sum() == pytest.approx(plain.cell_volumes().sum(), rel=1e-12)
    z = np.unique(np.round(graded.nodes[:, 2], 9))
    assert z[1] - z[0] == pytest.approx((z[4] - z[3]) / 7)  # 1/16 and 7/16 of the half height
    assert z + z[::-1] == pytest.approx(np.full(9, 0.03))
    r = np.unique(np.round(np.linalg.norm(graded.nodes[:, :2], axis=1), 9))
    assert r[-1] - r[-2] == pytest.approx(0.025 / 36)


@pytest.mark.parametrize(("radial", "axial"), [(1, 2), (2, 5), (3, 4), (6, 7)])
def test_hexahedra_of_a_cylinder_have_its_volume_and_its_faces(radial: int, axial: int) -> None:
    """The rim is a polygon of 4 `radial` sides of the circle's area; its second moment follows."""
    mesh = hexahedral_cylinder(0.02, 0.03, radial, axial)
    assert mesh.kind == "hex8"
    assert len(mesh.cells) == axial * radial * (radial + 4 * ((radial + 1) // 2))
    require_positive_cells(mesh)
    assert mesh.cell_volumes().sum() == pytest.approx(np.pi * 0.01**2 * 0.03, rel=1e-12)
    disc = radial * (radial + 4 * ((radial + 1) // 2))
    assert len(mesh.facets["lower_plate"]) == len(mesh.facets["upper_plate"]) == disc
    assert len(mesh.facets["rim"]) == 4 * radial * axial
    rim = mesh.nodes[mesh.facet_nodes("rim")]
    assert np.ptp(np.hypot(rim[:, 0], rim[:, 1])) < 1e-15
    with pytest.raises(SceneError, match="0 x 3 hexahedra: all must be positive"):
        hexahedral_cylinder(0.02, 0.03, 0, 3)
