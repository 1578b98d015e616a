"""Bodies of hexahedra are drawn by the tetrahedra they split into."""

import numpy as np
import pytest

from experiments.bending_rod.body import bending_rod
from validate.report.scenes import gl
from validate.report.scenes.bodies import _polygons
from validate.report.scenes.body import ShownBody
from validate.report.scenes.skin import skins
from validate.scene.shape_functions import LATTICE

# private: _polygons: called alone, case by case.

ROD = bending_rod(3)


def test_the_skin_has_two_triangles_a_side() -> None:
    (outside,) = skins(ROD, 5000)
    assert len(outside.triangles) == 2 * (2 * 9 + 4 * 18)
    x = ROD.mesh.nodes[outside.nodes][outside.triangles]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    assert (normals * (x.mean(axis=1) - [0.25, 0.125, 0.125])).sum(axis=1).min() > 0


def test_a_cut_shows_the_whole_section() -> None:
    still, up, along = np.zeros((len(ROD.mesh.nodes), 3)), np.eye(3)[2], np.eye(3)[0]
    middle = np.array([250.0, 125.0, 125.0])
    body = ShownBody(
        "rod",
        "",
        "",
        ROD.mesh,
        still,
        (),
        (),
        None,
        None,
        (0.0, 0.0),
        middle,
        np.eye(3)[1],
        "",
        up,
        along,
    )
    polygons, _ = _polygons(body, np.eye(3)[1])
    area = 0.0
    for x, y in (p.T for p in polygons):
        area += abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    assert area == pytest.approx(500.0 * 250.0)


@pytest.mark.slow
def test_quadratic_hexahedra_are_listed_as_vtk_does() -> None:
    """Its own local coordinates of the 27 nodes, in its order, are the places of ours."""
    if not gl.available():
        pytest.skip(gl.HOW_TO_GET)
    from vtkmodules.vtkCommonDataModel import vtkTriQuadraticHexahedron

    from validate.report.scenes.renders import vtk_order

    theirs = vtkTriQuadraticHexahedron().GetParametricCoords()
    assert LATTICE[3][vtk_order()] == pytest.approx(np.array(theirs[: 3 * 27]).reshape(27, 3))
