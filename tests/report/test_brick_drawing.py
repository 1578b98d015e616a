"""Bodies of hexahedra are drawn by the tetrahedra they split into."""

from pathlib import Path

import numpy as np
import pytest
from report_samples import no_gl

from experiments.bending_rod.body import bending_rod
from validate.report.scenes import gl
from validate.report.scenes.body import skins
from validate.report.scenes.panels import surface_of
from validate.scene.geometries.specification import Box
from validate.scene.mesh import Kind
from validate.scene.shape_functions import LATTICE

ROD = bending_rod(3)


def test_the_skin_has_two_triangles_a_side() -> None:
    (outside,) = skins(ROD, 5000)
    assert len(outside.triangles) == 2 * (2 * 9 + 4 * 18)
    x = ROD.mesh.nodes[outside.nodes][outside.triangles]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    assert (normals * (x.mean(axis=1) - [0.25, 0.125, 0.125])).sum(axis=1).min() > 0


@pytest.mark.parametrize("kind", ["tet4", "tet10", "hex8", "hex27"])
def test_a_surface_is_whole_and_bends_as_its_elements_do(kind: Kind) -> None:
    """Its area is that of the box, and points of a quadratic displacement lie where it moves
    them."""
    linear = "hex8" if kind.startswith("hex") else "tet4"
    mesh = Box((0.2, 0.1, 0.1), cells=(2, 1, 1), element=linear).resolved(Path())
    mesh = mesh if kind == linear else mesh.quadratic()
    surface = surface_of(mesh)
    x = surface.at(mesh.nodes)
    corners = x[surface.every(surface.triangles).reshape(-1, 3)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(cross, axis=1).sum() == pytest.approx(2 * 0.01 + 4 * 0.02)
    assert (cross * (corners.mean(axis=1) - [0.1, 0.05, 0.05])).sum(axis=1).min() > 0  # outward
    if mesh.order == 2:
        assert surface.at(mesh.nodes**2) == pytest.approx(x**2, abs=1e-15)
        assert len(surface.triangles) > 8
    rim = x[surface.every(surface.rim)]
    on_sides = (np.abs(np.diff(rim, axis=1)) > 1e-12).sum(axis=2)
    assert on_sides.min() == 1 or kind.startswith("tet")  # along edges of bricks
    assert rim[:, 0] == pytest.approx(rim[:, -1])


@pytest.mark.slow
def test_quadratic_hexahedra_are_listed_as_vtk_does() -> None:
    """Its own local coordinates of the 27 nodes, in its order, are the places of ours."""
    if not gl.available():
        no_gl()
    from vtkmodules.vtkCommonDataModel import vtkTriQuadraticHexahedron

    from validate.report.scenes.panels import vtk_order

    theirs = vtkTriQuadraticHexahedron().GetParametricCoords()
    assert LATTICE[3][vtk_order()] == pytest.approx(np.array(theirs[: 3 * 27]).reshape(27, 3))
