"""Integrals over cells of every kind against volumes and scikit-fem."""

import numpy as np
import pytest
from field_oracles import nodal_volumes

from validate.fem.assembly.assemble import jacobians, mass, nodal_rule, rule, values_at, volumes_at
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

PLANE, SOLID = ((1.0, 0.8), (3, 2)), ((1.0, 0.8, 0.6), (2, 2, 1))
MESHES = {
    "tri3": box(*PLANE),
    "tri6": box(*PLANE).quadratic(),
    "quad4": grid(*PLANE),
    "tet4": box(*SOLID),
    "tet10": box(*SOLID).quadratic(),
    "hex8": grid(*SOLID),
    "hex27": grid(*SOLID).quadratic(),
}


@pytest.fixture(params=MESHES, name="mesh")
def _mesh(request: pytest.FixtureRequest) -> Mesh:
    return MESHES[request.param]


def test_shapes_are_one_at_their_own_node(mesh: Mesh) -> None:
    assert np.allclose(nodal_rule(mesh).N, np.eye(mesh.cells.shape[1]), atol=1e-15)


def test_volumes_and_nodal_shares_sum_to_the_body(mesh: Mesh) -> None:
    per_cell = volumes_at(mesh, rule(mesh, 2)).sum(axis=1)
    assert per_cell == pytest.approx(mesh.cell_volumes(), rel=1e-13)
    assert nodal_volumes(mesh).sum() == pytest.approx(mesh.cell_volumes().sum(), rel=1e-13)


def test_nodal_shares_are_the_row_sums_of_the_library_mass(mesh: Mesh) -> None:
    """On cells of different sizes, as w_a = sum over b of the integral of N_a N_b."""
    uneven = Mesh(mesh.nodes**2 + mesh.nodes, mesh.cells, mesh.kind) if mesh.order == 1 else mesh
    M = mass(Scene(uneven, Material(1e4, 0.3, rho=1.0)))
    rows = np.asarray(M.sum(axis=1)).ravel()[:: mesh.dimension]
    assert nodal_volumes(uneven) == pytest.approx(rows, rel=1e-12, abs=1e-15)


def test_vertices_of_quadratic_tetrahedra_have_negative_shares() -> None:
    mesh = MESHES["tet10"]
    assert (nodal_volumes(mesh)[np.unique(mesh.corners)] < 0).all()


def test_the_integral_of_a_square_is_that_of_the_library_mass(mesh: Mesh) -> None:
    """u^T M u by scikit-fem against our quadrature, of an arbitrary field."""
    u = np.random.default_rng(3).normal(size=mesh.nodes.shape)
    points = rule(mesh, 3)
    ours = 1070.0 * (volumes_at(mesh, points) * (values_at(mesh, points, u) ** 2).sum(2)).sum()
    M = mass(Scene(mesh, Material(1e4, 0.3, rho=1070.0)))
    assert ours == pytest.approx(float(u.ravel() @ (M @ u.ravel())), rel=1e-12)


def test_a_jacobian_turns_negative_with_its_cell(mesh: Mesh) -> None:
    mirrored = np.zeros(mesh.nodes.shape)
    mirrored[:, 0] = -2 * mesh.nodes[:, 0]
    found = rule(mesh, 2)
    assert jacobians(mesh, found, mirrored) == pytest.approx(-jacobians(mesh, found), rel=1e-12)
