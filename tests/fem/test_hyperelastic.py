"""The hyperelastic kernel: exact truths, derivatives against differences, linearisation."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from law_samples import NAMES, SPLIT, sample
from phantoms import COARSE_GRID, grid_mesh, phantom_mesh, phantom_scene

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import stiffness
from validate.fem.cavity import cavity_surface, volume_hessian
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.laws.law import NeoHooke, SaintVenantKirchhoff, law_of
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Dilatation, Foundation, Membrane, Scene

MATERIAL = Material(15_200.0, 0.485)
ELEMENTS: list[tuple[int, Dilatation]] = [(1, "pointwise"), (1, "nodal_mean"), (2, "pointwise")]
every = pytest.mark.parametrize(
    ("order", "dilatation", "name"),
    [(*e, n) for e in ELEMENTS for n in NAMES if e[1] == "pointwise" or n in SPLIT],
    ids=lambda v: str(v),
)


def phantom(order: int, dilatation: Dilatation, name: str) -> Scene:
    scene = phantom_scene(phantom_mesh(COARSE_GRID, order), dilatation=dilatation)
    return replace(scene, material=sample(name, MATERIAL.E, MATERIAL.nu))


@cache
def body(order: int, dilatation: Dilatation, name: str) -> Body:
    return Body(phantom(order, dilatation, name))


def deformed(mesh: Mesh, seed: int = 1) -> Floats:
    """A large homogeneous deformation with small disorder, nothing inverted."""
    rng = np.random.default_rng(seed)
    H = np.array([[-0.35, 0.2, 0.1], [0.05, 0.2, -0.1], [0.1, 0.0, 0.1]])
    return (mesh.nodes @ H.T + 1e-4 * rng.normal(size=mesh.nodes.shape)).ravel()


def turn(axis: int, angle: float) -> Floats:
    i, j = [a for a in range(3) if a != axis]
    R = np.eye(3)
    R[[i, j, i, j], [i, j, j, i]] = np.cos(angle), np.cos(angle), -np.sin(angle), np.sin(angle)
    return R


# Derivatives


@pytest.mark.slow
@every
def test_tangent_at_rest_is_the_linear_stiffness(
    order: int, dilatation: Dilatation, name: str
) -> None:
    scene = phantom(order, dilatation, name)
    K, T = stiffness(scene), body(order, dilatation, name).tangent(np.zeros(scene.mesh.nodes.size))
    assert abs(T - K).max() <= 1e-10 * abs(K).max()


@pytest.mark.slow
@every
def test_force_and_tangent_are_derivatives(order: int, dilatation: Dilatation, name: str) -> None:
    b = body(order, dilatation, name)
    u = deformed(b.mesh)
    assert 0.2 < b.jacobians(u).min() < 0.95
    v = np.random.default_rng(2).normal(size=u.size)
    h = 1e-8
    work = (b.energy(u + h * v) - b.energy(u - h * v)) / (2 * h)
    assert work == pytest.approx(b.force(u) @ v, rel=1e-7)
    T = b.tangent(u)
    slope = (b.force(u + h * v) - b.force(u - h * v)) / (2 * h)
    assert slope == pytest.approx(T @ v, abs=1e-7 * np.abs(T @ v).max())
    assert abs(T - T.T).max() <= 1e-12 * abs(T).max()


@pytest.mark.parametrize("order", [1, 2])
def test_volume_hessian_is_the_derivative_of_the_load(order: int) -> None:
    mesh = phantom_mesh(COARSE_GRID, order)
    cavity = cavity_surface(mesh, "cyst", "cavity")
    x = mesh.nodes + deformed(mesh).reshape(-1, 3)
    v = np.random.default_rng(3).normal(size=x.shape)
    h = 1e-7
    slope = (cavity.pressure_load(x + h * v) - cavity.pressure_load(x - h * v)) / (2 * h)
    H = volume_hessian(cavity, x)
    assert slope.ravel() == pytest.approx(H @ v.ravel(), abs=1e-8 * np.abs(slope).max())
    assert abs(H - H.T).max() <= 1e-15
    # V is homogeneous of degree 3: x . d2V/dx2 x = 6 V, exact.
    y = (x - x[cavity.nodes].mean(axis=0)).ravel()
    assert y @ H @ y == pytest.approx(6 * cavity.volume(x), rel=1e-12)


# Exact truths


@pytest.mark.slow
@every
def test_rigid_turn_by_a_right_angle_costs_nothing(
    order: int, dilatation: Dilatation, name: str
) -> None:
    b = body(order, dilatation, name)
    for axis in range(3):
        u = (b.mesh.nodes @ turn(axis, np.pi / 2).T - b.mesh.nodes + [0.1, -0.2, 0.3]).ravel()
        assert np.abs(b.force(u)).max() <= 1e-13 * b.unit_force
        assert abs(b.energy(u)) <= 1e-13 * MATERIAL.E * float(b.weights.sum())
        assert b.jacobians(u) == pytest.approx(1.0, abs=1e-12)
        assert b.principal_stretches(u) == pytest.approx(1.0, abs=1e-12)


@every
def test_homogeneous_deformation_is_exact(order: int, dilatation: Dilatation, name: str) -> None:
    """The patch test at finite strain: inner nodes in balance, energy and face force exact."""
    mesh = grid_mesh((4, 4, 4), kind="tet10" if order == 2 else "tet4")
    rng = np.random.default_rng(5)
    inner = ((mesh.nodes > 0) & (mesh.nodes < 1)).all(axis=1)
    corners = np.unique(mesh.corners)
    material = sample(name, MATERIAL.E, MATERIAL.nu)
    b = Body(Scene(_disordered(mesh, rng), material, dilatation=dilatation))
    H = np.array([[-0.3, 0.2, 0.1], [0.05, 0.25, -0.1], [0.1, 0.0, 0.15]])
    u = (b.mesh.nodes @ H.T).ravel()
    law = law_of(material)
    force = b.force(u).reshape(-1, 3)
    P = law.stress(H)
    assert len(corners) == 64
    assert np.abs(force[inner]).max() <= 1e-12 * np.abs(force).max()
    for axis, letter in enumerate("xyz"):
        on = mesh.facet_nodes(f"{letter}1")
        off = mesh.facet_nodes(f"{letter}0")
        # The nodes of two opposite faces carry the traction; those of edges share several.
        moment = ((b.mesh.nodes[:, [axis]]) * force).sum(axis=0)
        assert moment == pytest.approx(P[:, axis], abs=1e-10 * np.abs(P).max())
        assert len(on) == len(off)
    assert b.energy(u) == pytest.approx(float(law.energy(H)), rel=1e-12)


def _disordered(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Inner vertices moved, edge nodes kept in the middle of their edges."""
    vertices = int(mesh.corners.max()) + 1
    nodes = mesh.nodes[:vertices].copy()
    inner = ((nodes > 0) & (nodes < 1)).all(axis=1)
    nodes[inner] += 0.05 * rng.uniform(-1, 1, (int(inner.sum()), 3))
    linear = Mesh(nodes, mesh.corners, "tet4", {})
    return linear.quadratic() if mesh.order == 2 else linear


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_uniaxial_saint_venant_kirchhoff(nu: float) -> None:
    """An earlier study: slipping plates, P = E lambda (lambda^2 - 1) / 2 for any nu."""
    law = law_of(Material(30e3, nu, "svk"))
    for stretch, newton in ((0.9, -25.65), (0.8, -43.20)):
        side = np.sqrt(1 - nu * (stretch**2 - 1))
        P = law.stress(np.diag([stretch, side, side]) - np.eye(3))
        assert 0.01 * P[0, 0] == pytest.approx(newton, rel=1e-12)
        assert abs(P[1, 1]) <= 1e-10 * abs(P[0, 0])
    assert law.least_stretch == pytest.approx(0.57735, abs=1e-5)


def test_neo_hooke_volumetric_part_is_infinite_at_both_ends() -> None:
    law = NeoHooke(1e3, 2e3)
    energies = [float(law.energy((s - 1) * np.eye(3))) for s in (1e-4, 1e-3, 1.0, 10.0, 1e3)]
    assert energies[2] == 0
    assert energies[0] > energies[1] > 1e3
    assert energies[4] > 1e12
    assert SaintVenantKirchhoff(1e3, 2e3).energy(-np.eye(3)) < 1e4


# What is counted, and what is refused


def test_inverted_cells_are_counted_and_named() -> None:
    b = body(1, "pointwise", "neo_hooke")
    assert b.inverted(np.zeros(b.mesh.nodes.size)) is None
    u = np.zeros_like(b.mesh.nodes)
    cell = 200
    node = b.mesh.cells[cell, 0]
    u[node] = 3 * (b.mesh.nodes[b.mesh.cells[cell, 1:]].mean(axis=0) - b.mesh.nodes[node])
    found = b.inverted(u.ravel())
    J = b.jacobians(u.ravel())[:, 0]
    assert found is not None
    assert J[cell] < 0
    assert (found.count, found.points) == (int((J <= 0).sum()), len(b.mesh.cells))
    assert found.first == int(np.flatnonzero(J <= 0)[0])
    assert b.inverted(np.full(u.size, np.nan)) is not None


def test_principal_stretch_of_a_known_deformation() -> None:
    b = body(2, "pointwise", "svk")
    F = turn(0, 0.7) @ np.diag([0.6, 1.1, 1.3]) @ turn(2, -0.4)
    u = (b.mesh.nodes @ (F - np.eye(3)).T).ravel()
    assert b.principal_stretches(u)[..., 0] == pytest.approx(0.6, rel=1e-10)
    assert b.principal_stretches(u)[..., 2] == pytest.approx(1.3, rel=1e-10)
    assert b.jacobians(u) == pytest.approx(0.6 * 1.1 * 1.3, rel=1e-10)


def test_foundation_acts_as_a_linear_spring() -> None:
    scene = phantom(1, "pointwise", "neo_hooke")
    held = replace(scene, foundations=(Foundation("y0", (0, 2), 1e5),))
    free, b = body(1, "pointwise", "neo_hooke"), Body(held)
    u = deformed(b.mesh)
    added = b.force(u) - free.force(u)
    assert added == pytest.approx((b.tangent(u) - free.tangent(u)) @ u, abs=1e-12)
    assert b.energy(u) - free.energy(u) == pytest.approx(added @ u / 2, rel=1e-9)
    K = stiffness(held)
    assert abs(b.tangent(0 * u) - K).max() <= 1e-10 * abs(K).max()


def test_what_has_no_large_strain_form_is_refused() -> None:
    scene = phantom(1, "pointwise", "neo_hooke")
    with pytest.raises(SceneError, match=r"'linear' .*'neo_hooke', .*'svk'"):
        Body(replace(scene, material=MATERIAL))
    membrane = Membrane("cavity", 1e-4, Material(1e6, 0.45))
    with pytest.raises(SceneError, match="membranes are linear only"):
        Body(replace(scene, membranes=(membrane,)))
    tet = Mesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1, 3]]), "tet4")
    with pytest.raises(SceneError, match="1 of 1 elements inverted"):
        Body(Scene(tet, Material(1.0, 0.3, "svk")))
