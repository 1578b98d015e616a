"""The quarter cone: its volume, its planes, and the cylinder as its limit."""

import numpy as np
import pytest

from validate.errors import SceneError
from validate.scene.geometries.specification import quarter_cone, quarter_cylinder
from validate.scene.mesh import boundary_facets

BOTTOM, TOP, HEIGHT = 0.068, 0.058, 0.028
FRUSTUM = HEIGHT / 3 * (0.034**2 + 0.034 * 0.029 + 0.029**2)  # volume / pi


@pytest.mark.parametrize(("radial", "axial", "grading"), [(1, 1, 1.0), (2, 3, 1.0), (5, 4, 2.0)])
def test_volume_is_that_of_the_inscribed_pyramid_frustum(
    radial: int, axial: int, grading: float
) -> None:
    """The cross-section is a polygon of 2 n sectors of area R^2 sin(pi / 4 n) / 2 each.

    A side quadrilateral between two rings is planar, so splitting it loses nothing.
    """
    mesh = quarter_cone(BOTTOM, TOP, HEIGHT, radial, axial, grading)
    exact = radial * np.sin(np.pi / (4 * radial)) * FRUSTUM
    assert mesh.cell_volumes().sum() == pytest.approx(exact, rel=1e-12)
    assert mesh.cell_volumes().min() > 0


def test_volume_converges_to_the_exact_one_at_second_order() -> None:
    volumes = [quarter_cone(BOTTOM, TOP, HEIGHT, n, 2).cell_volumes().sum() for n in (4, 8, 16)]
    errors = 1 - np.array(volumes) / (np.pi * FRUSTUM / 4)
    assert errors.min() > 0
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.02)


def test_sets_lie_on_their_surfaces_and_cover_the_boundary() -> None:
    mesh = quarter_cone(BOTTOM, TOP, HEIGHT, 3, 4).quadratic()
    vertices = len(quarter_cone(BOTTOM, TOP, HEIGHT, 3, 4).nodes)
    x = {name: mesh.nodes[mesh.facet_nodes(name)] for name in mesh.facets}
    assert np.abs(x["bottom"][:, 2]).max() == 0
    assert x["top"][:, 2] == pytest.approx(HEIGHT)
    assert np.abs(x["symmetry_x"][:, 0]).max() < 1e-17
    assert np.abs(x["symmetry_y"][:, 1]).max() < 1e-17
    side = mesh.nodes[[n for n in mesh.facet_nodes("side") if n < vertices]]
    radius = 0.034 - 0.005 * side[:, 2] / HEIGHT
    assert np.hypot(*side[:, :2].T) == pytest.approx(radius, rel=1e-14)
    assert np.hypot(*x["top"][:, :2].T).max() == pytest.approx(0.029)
    named = sum(len(f) for f in mesh.facets.values())
    assert named == len(boundary_facets(mesh.corners, 3))


def test_equal_diameters_are_the_cylinder() -> None:
    cone, cylinder = (
        quarter_cone(0.05, 0.05, 0.03, 3, 4, 2.0),
        quarter_cylinder(0.05, 0.03, 3, 4, 2.0, inscribed=True),
    )
    assert np.array_equal(cone.nodes, cylinder.nodes)
    assert np.array_equal(cone.facets["side"], cylinder.facets["rim"])


@pytest.mark.parametrize("sizes", [(0.0, 0.05, 0.03), (0.05, -0.01, 0.03), (0.05, 0.04, 0.0)])
def test_empty_cones_are_refused(sizes: tuple[float, float, float]) -> None:
    with pytest.raises(SceneError, match="must be positive"):
        quarter_cone(*sizes, 2, 2)
