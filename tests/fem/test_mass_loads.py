"""Mass, damping, loads and regions: exact entries, totals, the cube that other codes agree on."""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import facet_integrals, stiffness
from validate.fem.locking import locking_notes
from validate.fem.system import System, build
from validate.scene.geometries.box import box, centroids
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Scene, Support, Weight

SOFT = Material(1e4, 0.3, rho=1000.0, mass_damping=2.0, stiffness_damping=0.1)
HARD = Material(3e4, 0.4, rho=1500.0, mass_damping=5.0, stiffness_damping=0.02)
SIZE = (0.03, 0.02, 0.01)
UP = {2: (0.0, 1.0), 3: (0.0, 0.0, 1.0)}


def block(order: int = 1, d: int = 3) -> Mesh:
    mesh = box(SIZE[:d], (3, 2, 2)[:d])
    return mesh.quadratic() if order == 2 else mesh


def top(mesh: Mesh) -> str:
    return "y1" if mesh.dimension == 2 else "z1"


def layered(mesh: Mesh) -> Scene:
    """The cells beyond the middle of x are hard."""
    cells = np.flatnonzero(centroids(mesh)[:, 0] > 0.01)
    return Scene(mesh, SOFT, regions=(Region("layer", cells, HARD),))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("order", [1, 2])
def test_masses_add_up_to_the_body(order: int, d: int) -> None:
    """Unit velocity along any axis has the body's mass; rows and lumps of HRZ likewise."""
    system = build(layered(block(order, d)))
    total = np.prod(SIZE[1:d]) * (0.01 * 1000 + 0.02 * 1500)
    masses = system.masses.reshape(-1, d)
    for axis in range(d):
        unit = np.zeros_like(masses)
        unit[:, axis] = 1
        assert unit.ravel() @ system.M @ unit.ravel() == pytest.approx(total, rel=1e-13)
        assert masses[:, axis].sum() == pytest.approx(total, rel=1e-13)
    assert masses.min() > 0
    assert abs(system.M - system.M.T).max() <= 1e-15 * abs(system.M).max()


def barycentric_integral(powers: tuple[int, ...], volume: float) -> float:
    """Integral of a monomial in barycentric coordinates over a simplex of dimension d."""
    d = len(powers) - 1
    top = np.prod([factorial(p) for p in powers]) * factorial(d)
    return float(volume * top / factorial(d + sum(powers)))


def test_a_linear_cells_mass_is_exact() -> None:
    """rho V (1 + delta_ab)/20, and a quarter of the mass at every corner when lumped."""
    mesh = Mesh(np.vstack([np.zeros(3), np.diag(SIZE)]), np.array([[0, 1, 2, 3]]), "tet4", {})
    system = build(Scene(mesh, SOFT))
    m = 1000 * np.prod(SIZE) / 6
    exact = np.kron(m * (np.ones((4, 4)) + np.eye(4)) / 20, np.eye(3))
    assert system.M.toarray() == pytest.approx(exact, rel=1e-13)
    assert system.masses == pytest.approx(np.full(12, m / 4), rel=1e-13)


def test_a_quadratic_cells_mass_is_exact() -> None:
    """Functions L(2L - 1) and 4 L_a L_b by the integrals of monomials; HRZ of those."""
    corners = np.vstack([np.zeros(3), np.diag(SIZE)])
    mesh = Mesh(corners, np.array([[0, 1, 2, 3]]), "tet4", {}).quadratic()
    V = float(np.prod(SIZE)) / 6
    shapes = []
    for node in mesh.nodes:
        L = np.array([1 - (node / SIZE).sum(), *(node / SIZE)])
        on = np.flatnonzero(L > 0.25)
        one = np.eye(4, dtype=int)
        if len(on) == 1:
            shapes.append([(2.0, 2 * one[on[0]]), (-1.0, one[on[0]])])
        else:
            shapes.append([(4.0, one[on[0]] + one[on[1]])])
    exact = np.array(
        [
            [
                sum(
                    s * t * barycentric_integral(tuple(p + q), V) for s, p in left for t, q in right
                )
                for right in shapes
            ]
            for left in shapes
        ]
    )
    system = build(Scene(mesh, SOFT))
    assert system.M.toarray() == pytest.approx(1000 * np.kron(exact, np.eye(3)), abs=1e-12 * V)
    share = np.diag(exact) / np.trace(exact)
    assert system.masses[::3] == pytest.approx(1000 * V * share, rel=1e-12)


def test_a_missing_density_is_named() -> None:
    scene = Scene(block(), replace(SOFT, rho=None))
    with pytest.raises(SceneError, match="set rho kg/m3 of every material"):
        _ = build(scene).M
    scene = Scene(block(), SOFT, regions=(Region("r", np.array([0]), replace(HARD, rho=None)),))
    with pytest.raises(SceneError, match="set rho kg/m3 of every material"):
        _ = build(scene).M


def parts(mesh: Mesh, material: Material, hard: Material) -> tuple[Floats, Floats]:
    """K (dense) of the two halves of a layered block, each as if the other were absent."""
    scene = layered(mesh)
    cells = scene.regions[0].cells
    # A modulus of almost nothing for the other half leaves the one.
    faint = replace(material, E=1e-9)
    one = replace(scene, material=material, regions=(Region("r", cells, faint),))
    two = replace(scene, material=faint, regions=(Region("r", cells, hard),))
    return stiffness(one).toarray(), stiffness(two).toarray()


@pytest.mark.parametrize("order", [1, 2])
def test_regions_add_their_stiffness_and_their_damping(order: int) -> None:
    mesh = block(order)
    scene = layered(mesh)
    system = build(scene)
    soft, hard = parts(mesh, SOFT, HARD)
    scale = np.abs(system.K).max()
    assert np.abs(system.K - (soft + hard)).max() <= 1e-9 * scale
    whole = build(Scene(mesh, replace(SOFT, rho=1.0))).M.toarray()
    dense = build(replace(scene, material=replace(SOFT, rho=1e-12))).M.toarray()
    light = 1000 * (whole - dense / 1500)
    expected = 0.1 * soft + 0.02 * hard + 2.0 * light + 5.0 * dense
    assert np.abs(system.C - expected).max() <= 1e-10 * scale


def test_one_material_has_rayleigh_damping() -> None:
    system = build(Scene(block(), SOFT))
    assert abs(system.C - (2.0 * system.M + 0.1 * system.K)).max() <= 1e-13 * abs(system.C).max()


def test_a_stretched_bar_of_two_materials_is_two_springs() -> None:
    """nu = 0: force over displacement of springs E A / l in a row."""
    mesh = block()
    cells = np.flatnonzero(centroids(mesh)[:, 0] > 0.01)
    soft, hard = replace(SOFT, nu=0.0), replace(HARD, nu=0.0)
    system = build(
        Scene(
            mesh,
            soft,
            (Support("x0", (0, 1, 2)),),
            regions=(Region("layer", cells, hard),),
            loads=(Load("pull", "x1", (1.0, 0.0, 0.0)),),
        )
    )
    u = system.factor().solve(system.loads[system.free])[:, 0]
    full = np.zeros(mesh.nodes.size)
    full[system.free] = u
    area = SIZE[1] * SIZE[2]
    end = full.reshape(-1, 3)[mesh.facet_nodes("x1"), 0]
    assert end == pytest.approx(np.full(len(end), 0.01 / 1e4 / area + 0.02 / 3e4 / area))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("spread", ["consistent", "nodal", "per_node"])
def test_loads_have_their_total_along_their_direction(spread: str, order: int, d: int) -> None:
    mesh = block(order, d)
    load = Load("pull", top(mesh), UP[d], spread)  # type: ignore[arg-type]
    column = build(Scene(mesh, SOFT, loads=(load,))).loads[:, 0].reshape(-1, d)
    nodes = mesh.facet_nodes(top(mesh))
    assert column.sum(axis=0) == pytest.approx(
        np.array(UP[d]) * (len(nodes) if spread == "per_node" else 1.0)
    )
    assert np.abs(np.delete(column, nodes, axis=0)).max() == 0.0
    if spread != "consistent":
        assert np.ptp(column[nodes, -1]) == 0.0


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("order", [1, 2])
def test_a_consistent_load_does_the_work_of_its_traction(order: int, d: int) -> None:
    """1/A of the integral of what the elements can hold, x and (order 2) x^2, over the side."""
    mesh = block(order, d)
    load = Load("pull", top(mesh), UP[d])
    share = build(Scene(mesh, SOFT, loads=(load,))).loads[:, 0].reshape(-1, d)[:, -1]
    x = mesh.nodes[:, 0]
    assert share @ x == pytest.approx(SIZE[0] / 2)
    if order == 2:
        assert share @ x**2 == pytest.approx(SIZE[0] ** 2 / 3)


def test_integrals_over_facets_sum_to_areas_and_lengths() -> None:
    assert facet_integrals(block(), block().facets["z1"]).sum() == pytest.approx(SIZE[0] * SIZE[1])
    flat = block(2, 2)
    assert facet_integrals(flat, flat.facets["y1"]).sum() == pytest.approx(SIZE[0])


def test_a_direction_that_is_no_unit_vector_is_refused() -> None:
    with pytest.raises(SceneError, match="direction of length 2"):
        Load("pull", "z1", (0.0, 0.0, 2.0))


def cube(order: int = 1, spread: str = "consistent") -> System:
    """Paper 001's block: E 10 kPa, nu .47, z = 0 held, pulled on top."""
    mesh = box((0.004, 0.004, 0.007), (4, 4, 7))
    return build(
        Scene(
            mesh.quadratic() if order == 2 else mesh,
            Material(1e4, 0.47, rho=1068.0, stiffness_damping=0.1),
            (Support("z0", (0, 1, 2)),),
            loads=(Load("pull", "z1", (0.0, 0.0, 1.0), spread),),  # type: ignore[arg-type]
        )
    )


def static(system: System, newtons: float) -> Floats:
    u = np.zeros(system.scene.mesh.nodes.size)
    u[system.free] = system.factor().solve(newtons * system.loads[system.free])[:, 0]
    return u.reshape(-1, 3)


def test_the_cube_that_six_codes_agree_on() -> None:
    """An earlier study: NGSolve, GetFEM, MFEM, felupe, OpenSees, scikit-fem, to 4e-16 m."""
    u = static(cube(), 3000 * 16e-6)
    corner = [6.7129710205e-4, 6.7129710205e-4, 2.1343991963e-3]
    middle = [3.8851967165e-4, 3.8851967165e-4, 1.8707896467e-3]
    assert u[175] == pytest.approx(corner, rel=1e-10)
    assert u[187] == pytest.approx(middle, rel=1e-10)
    assert u[2 + 10 + 125, 2] == pytest.approx(1.267872e-3, abs=5e-10)


def test_the_cubes_other_readings() -> None:
    """An earlier study: equal nodal forces 1.7333 mm; quadratic cells 1.98789 and 1.38692 mm."""
    assert static(cube(spread="nodal"), 3000 * 16e-6)[187, 2] == pytest.approx(1.7333e-3, abs=5e-8)
    u = static(cube(2), 3000 * 16e-6)
    assert u[[187, 137], 2] == pytest.approx([1.98789e-3, 1.38692e-3], abs=5e-9)


@pytest.mark.parametrize(
    ("nu", "order", "dilatation", "warned"),
    [
        (0.449, 1, "pointwise", False),
        (0.45, 1, "pointwise", True),
        (0.4999, 2, "pointwise", False),
        (0.48, 1, "nodal_mean", False),  # from .49 few of them are warned of
    ],
)
def test_linear_cells_near_incompressibility_are_warned_of(
    nu: float, order: int, dilatation: str, warned: bool
) -> None:
    scene = Scene(block(order), Material(1e4, nu), dilatation=dilatation)  # type: ignore[arg-type]
    warnings = locking_notes([("fem", scene)])
    assert bool(warnings) == warned
    if warnings:
        assert warnings[0].startswith("linear tetrahedra lock near incompressibility")
        assert warnings[0].endswith(f"nu = {nu:g} (fem)")


@pytest.mark.parametrize(
    ("across", "order", "warned"), [(1, 1, True), (4, 1, False), (1, 2, False)]
)
def test_few_linear_cells_across_a_slender_body_are_warned_of(
    across: int, order: int, warned: bool
) -> None:
    rod = box((0.1, 0.02, 0.02), (5 * across, across, across))
    scene = Scene(rod.quadratic() if order == 2 else rod, Material(1e4, 0.3))
    assert ("locks in bending" in " ".join(locking_notes([("fem", scene)]))) == warned


@pytest.mark.parametrize(("direction", "warned"), [((1.0, 0.0, 0.0), False), ((0, 0, -1.0), True)])
def test_a_bar_that_is_only_stretched_does_not_lock_in_bending(
    direction: tuple[float, ...], warned: bool
) -> None:
    rod = box((0.1, 0.02, 0.02), (5, 1, 1))
    scene = Scene(rod, Material(1e4, 0.3), loads=(Weight("gravity", direction),))
    assert bool(locking_notes([("fem", scene)])) == warned


def test_warnings_of_one_cause_are_one_line() -> None:
    """Two Poisson ratios and five methods: the cause once, with where it was found."""
    scenes = [(f"m{i}", Scene(block(1), Material(1e4, nu)))
              for i, nu in enumerate((0.49, 0.49, 0.49, 0.49, 0.4995))]  # fmt: skip
    (line,) = locking_notes(scenes)
    assert "nu = 0.49 (m0; m1; m2 and 1 more methods), nu = 0.4995 (m4)" in line
