"""Interpolation rows: polynomials are met exactly, points outside are measured and refused."""

import numpy as np
import pytest
from phantoms import CAPSULE, COARSE_GRID, grid_mesh, phantom_mesh

from validate.errors import RegistrationError, SceneError
from validate.fem.assembly.locate import (
    Rows,
    facet_samples,
    nearest_node_rows,
    nearest_on_surface,
    probe_rows,
    require_inside,
)
from validate.scene.geometries.box import box
from validate.scene.mesh import Mesh
from validate.scene.scene import Probe

orders = pytest.mark.parametrize("order", [1, 2])


def field(x: np.ndarray, order: int) -> np.ndarray:
    """A vector field of the given degree."""
    linear = x @ np.array([[1.0, 2.0, -1.0], [0.5, 0.0, 3.0]]).T + [0.1, -0.2]
    return linear if order == 1 else linear + np.stack([x[:, 0] * x[:, 1], x[:, 2] ** 2], axis=1)


def inside(mesh: Mesh, k: int) -> np.ndarray:
    rng = np.random.default_rng(2)
    L = rng.dirichlet(np.ones(4), k)
    return np.einsum(
        "ka,kad->kd", L, mesh.nodes[mesh.corners[rng.integers(len(mesh.cells), size=k)]]
    )


def test_points_that_are_none_are_refused() -> None:
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    for points, why in ((np.zeros(3), r"points.*\(3,\)"), (np.full((1, 3), np.nan), "not finite")):
        with pytest.raises(SceneError, match=why):
            Rows.barycentric(mesh, points)


@orders
def test_polynomials_of_the_mesh_order_are_read_exactly(order: int) -> None:
    mesh = phantom_mesh(COARSE_GRID, order)
    points = inside(mesh, 300)
    rows = Rows.barycentric(mesh, points)
    assert rows.apply(field(mesh.nodes, order)) == pytest.approx(field(points, order), abs=1e-13)
    assert rows.outside.max() < 1e-15
    assert rows.weights.sum(axis=1) == pytest.approx(1.0, abs=1e-13)
    require_inside(rows, tuple(map(str, range(300))), 1e-12)


@orders
def test_nodes_read_themselves(order: int) -> None:
    mesh = phantom_mesh(COARSE_GRID, order)
    values = np.random.default_rng(0).normal(size=(len(mesh.nodes), 3))
    assert Rows.barycentric(mesh, mesh.nodes).apply(values) == pytest.approx(values, abs=1e-10)
    assert nearest_node_rows(mesh, mesh.nodes).apply(values) == pytest.approx(values, abs=0)


def test_point_outside_is_clipped_measured_and_named() -> None:
    mesh = grid_mesh((3, 3, 3))
    points = np.array([[0.3, 0.4, 0.2], [0.3, 0.4, 1.25]])
    rows = Rows.barycentric(mesh, points)
    assert rows.outside[0] < 1e-15
    # The clipped foot lies in the nearest cell, at most a little beside the nearest point.
    assert 0.25 <= rows.outside[1] < 0.5
    assert (rows.weights.toarray() >= 0).all()
    with pytest.raises(RegistrationError, match=r"1 of 2 points .* 'b' by \d+\.\d\d mm"):
        require_inside(rows, ("a", "b"), 0.1)


def test_nearest_node_among_some() -> None:
    mesh = phantom_mesh(COARSE_GRID)
    wall = mesh.facet_nodes("cavity")
    points = mesh.nodes[wall] + 1e-5
    everywhere = nearest_node_rows(mesh, points, wall)
    assert np.array_equal(everywhere.weights.indices, wall)
    assert everywhere.outside == pytest.approx(np.sqrt(3) * 1e-5, rel=1e-9)
    far = nearest_node_rows(mesh, np.zeros((1, 3)), wall)
    distances = np.linalg.norm(mesh.nodes[wall], axis=1)
    assert far.weights.indices[0] == wall[distances.argmin()]


@orders
@pytest.mark.parametrize("parts", [1, 2, 5])
def test_facet_samples_cover_the_facets(order: int, parts: int) -> None:
    mesh = phantom_mesh(COARSE_GRID, order)
    facets = mesh.facets["cavity"]
    rows, triangles = facet_samples(mesh, facets, parts)
    x = rows.apply(mesh.nodes)
    assert len(triangles) == parts**2 * len(facets)
    assert len(x) == (parts + 1) * (parts + 2) // 2 * len(facets)
    assert rows.apply(field(mesh.nodes, order)) == pytest.approx(field(x, order), abs=1e-13)

    def area_vectors(nodes: np.ndarray, corners: np.ndarray) -> np.ndarray:
        p = nodes[corners]
        return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2

    small = area_vectors(x, triangles).reshape(len(facets), -1, 3).sum(axis=1)
    assert small == pytest.approx(area_vectors(mesh.nodes, facets[:, :3]), abs=1e-18)
    assert CAPSULE.distance(x).max() < 1e-15


@pytest.mark.parametrize("order", [1, 2])
def test_a_marker_on_a_stalk_is_turned_with_the_surface(order: int) -> None:
    """A rigid motion by 20 degrees moves a point 6 mm off the face exactly, as if it were the
    body's; a point inside is read as ever."""
    mesh = box((0.1, 0.03, 0.03), (4, 2, 2))
    mesh = mesh.quadratic() if order == 2 else mesh
    points = np.array([[0.1, 0.015, 0.036], [0.04, -0.006, 0.01], [0.05, 0.01, 0.02]])
    probes = [Probe(str(i), tuple(p.tolist()), stands=i < 2) for i, p in enumerate(points)]
    rows = probe_rows(mesh, probes)
    c, s = np.cos(0.35), np.sin(0.35)
    H = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) - np.eye(3)
    assert np.allclose(rows.apply(mesh.nodes @ H.T + 0.002), points @ H.T + 0.002, atol=1e-15)
    assert rows.outside[2] == 0
    assert ((rows.outside[:2] >= 0.006 - 1e-12) & (rows.outside[:2] < 0.009)).all()
    u = np.random.default_rng(1).normal(size=mesh.nodes.shape)
    assert np.allclose(rows.apply(u)[2], Rows.barycentric(mesh, points).apply(u)[2])


def test_the_foot_of_a_marker_on_a_stalk_is_the_nearest_point_of_the_surface() -> None:
    """Off faces, edges and corners of a block of tetrahedra, and within it."""
    mesh = box((0.1, 0.03, 0.03), (6, 2, 2))
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.02, 0.05, (200, 3)) + np.array([0.03, 0.0, 0.0])
    nearest = np.clip(points, 0, [0.1, 0.03, 0.03])
    out = np.linalg.norm(points - nearest, axis=1)
    rows = Rows.standing(mesh, points)
    assert rows.outside == pytest.approx(out, abs=1e-12)
    outside = points[out > 0]
    assert nearest_on_surface(mesh, outside) == pytest.approx(nearest[out > 0], abs=1e-12)
    G = rng.normal(size=(3, 3))
    assert rows.apply(mesh.nodes @ G) == pytest.approx(points @ G, abs=1e-12)
