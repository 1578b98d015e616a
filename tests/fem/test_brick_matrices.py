"""Matrices, loads and places of bricks against exact fields and scikit-fem's kernels."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import (
    Basis,
    BilinearForm,
    ElementHex1,
    ElementQuad1,
    ElementVector,
    MeshHex,
    MeshQuad,
    asm,
)
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from experiments.bending_rod.body import GRAVITY, bending_rod
from experiments.needle_block.body import needle_block
from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import (
    facet_integrals,
    mass,
    shape_gradients,
    stiffness,
    stiffness_damping,
)
from validate.fem.assembly.locate import Rows
from validate.fem.system import build
from validate.scene.geometries.box import grid
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Pin, PlaneState, Scene, Support, Weight

E, NU, RHO = 200.0, 0.3, 50.0
STEEL = Material(E, NU, rho=RHO, mass_damping=2.0, stiffness_damping=0.1)
SIZES = [((1.0, 0.8), (4, 3)), ((1.0, 0.8, 0.6), (3, 3, 2))]
blocks = pytest.mark.parametrize(("size", "cells"), SIZES, ids=["quad4", "hex8"])


def distorted(size: tuple[float, ...], cells: tuple[int, ...]) -> Mesh:
    """The grid with its inner nodes moved at random."""
    mesh, rng = grid(size, cells), np.random.default_rng(1)
    inner = ((mesh.nodes > 1e-9) & (mesh.nodes < np.array(size) - 1e-9)).all(axis=1)
    nodes = mesh.nodes.copy()
    nodes[inner] += 0.05 * rng.uniform(-1, 1, nodes[inner].shape)
    return Mesh(nodes, mesh.cells, mesh.kind, mesh.facets)


@pytest.mark.parametrize(
    ("size", "cells", "plane"),
    [(*SIZES[0], "strain"), (*SIZES[0], "stress"), (*SIZES[1], "strain")],
    ids=["plane strain", "plane stress", "hex8"],
)
def test_a_linear_field_is_carried_by_the_right_constant_stress(
    size: tuple[float, ...], cells: tuple[int, ...], plane: PlaneState
) -> None:
    """Patch test: u = G x, K u is the traction of sigma on the sides, nothing inside."""
    d = len(size)
    mesh, thickness = distorted(size, cells), 0.3 if d == 2 else 1.0
    scene = Scene(mesh, STEEL, plane=plane, thickness=thickness)
    G = np.random.default_rng(3).standard_normal((d, d))
    strain, mu = (G + G.T) / 2, E / 2 / (1 + NU)
    lam = E * NU / (1 - NU**2) if plane == "stress" else E * NU / (1 + NU) / (1 - 2 * NU)
    sigma = lam * np.trace(strain) * np.eye(d) + 2 * mu * strain
    forces = (stiffness(scene) @ (mesh.nodes @ G.T).ravel()).reshape(-1, d)
    expected = np.zeros_like(forces)
    for c, axis in enumerate("xyz"[:d]):
        for sign, name in ((-1, f"{axis}0"), (1, f"{axis}1")):
            load = tuple(float(i == c) for i in range(d))
            unit = build(replace(scene, loads=(Load("t", name, load),))).loads.reshape(-1, d)[:, c]
            area = float(np.prod(size)) / size[c] * thickness
            expected += sign * area * np.outer(unit, sigma[:, c])
    assert forces == pytest.approx(expected, abs=1e-11 * np.abs(forces).max())


def test_the_quadrilaterals_kernel_is_scikit_fems() -> None:
    n, scene = 6, needle_block(6)
    theirs = MeshQuad.init_tensor(*2 * (np.linspace(0, 1, n + 1),))
    _same_matrices(scene, Basis(theirs, ElementVector(ElementQuad1()), intorder=3))


def test_the_hexahedras_kernel_is_scikit_fems() -> None:
    lines = (np.linspace(0, 0.5, 5), np.linspace(0, 0.25, 3), np.linspace(0, 0.25, 3))
    basis = Basis(MeshHex.init_tensor(*lines), ElementVector(ElementHex1()), intorder=3)
    _same_matrices(bending_rod(2), basis)


def _same_matrices(scene: Scene, basis: Basis) -> None:
    """Their meshes number nodes in their own way: unknowns are matched by place."""
    m, d = scene.material, scene.mesh.dimension
    places = basis.doflocs[:, basis.nodal_dofs[0]].T
    order = np.array([np.argmin(np.linalg.norm(places - x, axis=1)) for x in scene.mesh.nodes])
    unknowns = basis.nodal_dofs[:, order].T.ravel()
    K = asm(linear_elasticity(*lame_parameters(m.E, m.nu)), basis)[unknowns][:, unknowns]
    M = m.rho * asm(BilinearForm(lambda u, v, w: dot(u, v)), basis)[unknowns][:, unknowns]
    ours = build(scene)
    assert len(places) == len(scene.mesh.nodes)
    assert (d, len(unknowns)) == (len(basis.nodal_dofs), len(ours.moves))
    assert np.abs((ours.K - K).toarray()).max() < 1e-14 * np.abs(K).max()
    assert np.abs((ours.M - M).toarray()).max() < 1e-14 * np.abs(M).max()


@blocks
def test_masses_add_up_and_thickness_and_dampings_scale(
    size: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    mesh = distorted(size, cells)
    thickness = 0.25 if len(size) == 2 else 1.0
    scene = Scene(mesh, STEEL, thickness=thickness)
    M = mass(scene)
    total = RHO * thickness * float(np.prod(size))
    assert M.sum() == pytest.approx(len(size) * total)
    assert np.linalg.eigvalsh(M.toarray())[0] > 0
    assert build(scene).masses.min() > 0
    assert build(scene).masses.sum() == pytest.approx(M.sum())
    assert np.abs((stiffness_damping(scene) - 0.1 * stiffness(scene)).toarray()).max() < 1e-12
    assert np.abs((mass(scene, damping=True) - 2.0 * M).toarray()).max() < 1e-12 * total


def test_regions_of_bricks_have_their_own_stiffness() -> None:
    whole = Scene(grid((1.0, 1.0), (2, 1)), STEEL)
    two = replace(whole, regions=(Region("right", np.array([1]), replace(STEEL, E=3 * E)),))
    inner = stiffness(two) - stiffness(whole)
    nodes = np.flatnonzero(np.abs(inner.toarray()).max(axis=1) > 1e-12) // 2
    assert set(nodes.tolist()) == {1, 2, 4, 5}


@blocks
def test_a_column_compresses_under_its_weight(
    size: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    """nu = 0, one bar: the top moves rho g L^2/(2 E), exactly at the nodes."""
    d = len(size)
    down = (0.0,) * (d - 1) + (-1.0,)
    bar = Material(E, 0.0, rho=RHO)
    scene = Scene(
        grid(size, cells), bar, (Support(f"{'xyz'[d - 1]}0", (d - 1,)),),
        tuple(Pin((0.0,) * d, (c,)) for c in range(d - 1)), loads=(Weight("g", down),),
    )  # fmt: skip
    if d == 3:
        scene = replace(scene, pins=(*scene.pins, Pin((size[0], 0.0, 0.0), (1,))))
    system = build(scene)
    assert system.loads.sum() == pytest.approx(-RHO * float(np.prod(size)))
    u = np.zeros(len(system.moves))
    u[system.free] = system.factor().solve(9.81 * system.loads[system.free, 0])
    height = size[-1]
    z = scene.mesh.nodes[:, -1]
    expected = -RHO * 9.81 / E * (height * z - z**2 / 2)
    assert u.reshape(-1, d)[:, -1] == pytest.approx(expected, abs=1e-12)


def test_a_weight_needs_densities() -> None:
    scene = Scene(grid((1.0, 1.0), (1, 1)), Material(E, NU), loads=(Weight("g", (0.0, -1.0)),))
    with pytest.raises(SceneError, match="needs the density"):
        _ = build(scene).loads


@pytest.mark.parametrize(("n", "tip"), [(2, 0.114656), (3, 0.122214), (4, 0.125412)])
def test_the_rods_static_tip(n: int, tip: float) -> None:
    """Mean of the free end, from an independent reconstruction of paper 002 (6 digits)."""
    system = build(bending_rod(n))
    u = np.zeros(len(system.moves))
    u[system.free] = system.factor().solve(GRAVITY * system.loads[system.free, 0])
    end = system.scene.mesh.facet_nodes("x1")
    assert -u.reshape(-1, 3)[end, 2].mean() == pytest.approx(tip, abs=1e-6)


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_point_displacement_has_no_limit_but_an_analytic_slope(plane: PlaneState) -> None:
    """d(u0/F)/d ln n = 2 (1 - nu^2)/(pi E) in plane strain, 2/(pi E) in plane stress."""
    flexibility = []
    for n in (24, 48):
        scene = needle_block(n, STEEL, plane)
        system = build(scene)
        u = system.moves[:, 0].copy()
        u[system.free] = system.factor().solve(-(system.K @ u)[system.free])
        flexibility.append(1 / float(system.moves[:, 0] @ (system.K @ u)))
    modulus = E / (1 - NU**2) if plane == "strain" else E
    slope = (flexibility[1] - flexibility[0]) / np.log(2)
    assert slope == pytest.approx(2 / np.pi / modulus, rel=0.01)


@blocks
def test_points_in_distorted_bricks_are_found(
    size: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    mesh = distorted(size, cells)
    rng = np.random.default_rng(5)
    points = rng.random((400, len(size))) * np.array(size)
    rows = Rows.barycentric(mesh, points)
    assert rows.apply(mesh.nodes) == pytest.approx(points, abs=1e-14)
    assert rows.outside.max() < 1e-14
    assert rows.weights.sum(axis=1) == pytest.approx(np.ones(400))


@blocks
def test_points_outside_are_read_at_their_feet(
    size: tuple[float, ...], cells: tuple[int, ...]
) -> None:
    mesh, reach = grid(size, cells), np.array(size)
    points = np.random.default_rng(6).uniform(-0.2, 1.2, (300, len(size))) * reach
    rows = Rows.barycentric(mesh, points)
    feet: Floats = np.clip(points, 0, reach)
    assert rows.apply(mesh.nodes) == pytest.approx(feet, abs=1e-14)
    assert rows.outside == pytest.approx(np.linalg.norm(points - feet, axis=1), abs=1e-14)


def test_facets_of_hexahedra_share_a_load_by_their_shape_functions() -> None:
    """A skew face: shares are integrals of N_a; on one face of 2 x 1 m, a quarter each."""
    mesh = grid((2.0, 1.0, 1.0), (1, 1, 1))
    load = Load("t", "z1", (0.0, 0.0, 1.0))
    f = build(Scene(mesh, STEEL, loads=(load,))).loads.reshape(-1, 3)[:, 2]
    assert f[4:] == pytest.approx(np.full(4, 0.25))
    assert facet_integrals(mesh, mesh.facets["z1"]).sum() == pytest.approx(2.0)
    nodes = mesh.nodes.copy()
    nodes[mesh.nodes[:, 2] > 0.5, 1] *= 1 + nodes[mesh.nodes[:, 2] > 0.5, 0]  # a trapezium
    skew = Mesh(nodes, mesh.cells, "hex8", mesh.facets)
    f = build(Scene(skew, STEEL, loads=(load,))).loads.reshape(-1, 3)[:, 2]
    assert facet_integrals(skew, skew.facets["z1"]).sum() == pytest.approx(4.0)
    # The load's moment about y is that of a uniform traction: the integral of x (1 + x) over 4.
    assert f @ skew.nodes[:, 0] == pytest.approx((2.0 + 8 / 3) / 4)


def test_bricks_have_no_constant_gradients() -> None:
    with pytest.raises(SceneError, match="quad4 have no constant strain"):
        shape_gradients(needle_block(2).mesh)
