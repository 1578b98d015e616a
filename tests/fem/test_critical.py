"""The critical step: dense eigenvalues, one cell, slivers, an earlier study of paper 003."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from field_oracles import frequency_range

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem import critical as module
from validate.fem.critical import CriticalStep, element_frequencies
from validate.fem.large_strain import explicit
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh, boundary_facets
from validate.scene.scene import Scene, Support

# private: _density, _require: called alone, case by case.

GEL = Material(3e4, 0.49, rho=1000.0)
HELD = (Support("z0", (0, 1, 2)),)


def block(n: int = 3, order: int = 1) -> System:
    mesh = box((0.1, 0.1, 0.1), (n, n, n))
    return build(Scene(mesh.quadratic() if order == 2 else mesh, GEL, HELD))


def exact_limit(system: System) -> float:
    """2/omega_max by a dense solution."""
    root = np.sqrt(system.masses[system.free])
    K = system.K[system.free][:, system.free].toarray() / np.outer(root, root)
    return float(2 / np.sqrt(np.linalg.eigvalsh(K)[-1]))


@pytest.mark.parametrize("order", [1, 2])
def test_lanczos_finds_the_largest_frequency(order: int) -> None:
    system = block(4 - order, order)
    found, exact = CriticalStep.of(system, margin=0.0), exact_limit(system)
    assert found.lanczos == pytest.approx(exact, rel=1e-4)
    assert 0.98 * exact < found.recommended <= exact
    withdrawn = CriticalStep.of(system, margin=0.1).recommended
    assert withdrawn == pytest.approx(0.9 * found.recommended, rel=1e-12)
    assert found.gershgorin < exact
    if order == 1:
        assert found.element is not None
        assert found.element < exact


def test_few_products_leave_a_gap_that_the_safe_step_takes_off() -> None:
    """Lanczos comes from below in omega: its step alone would be too large."""
    rng = np.random.default_rng(1)
    d = np.sort(rng.uniform(0.0, 1.0, 4000)) ** 0.1
    found = CriticalStep.by_lanczos(lambda x: d * x, np.ones(4000), products=15, margin=0.0)
    exact = 2 / np.sqrt(d[-1])
    assert found.products == 15
    assert found.safe < exact < found.limit
    with pytest.raises(SceneError, match="at least 15 products"):
        CriticalStep.by_lanczos(lambda x: d * x, np.ones(4000), products=10)
    with pytest.raises(SceneError, match=r"margin 0\.7"):
        CriticalStep.by_lanczos(lambda x: d * x, np.ones(4000), margin=0.7)


def test_a_small_system_ends_early() -> None:
    found = CriticalStep.by_lanczos(lambda x: np.array([1.0, 4.0, 9.0]) * x, np.ones(3), margin=0.0)
    assert found.products == 3
    assert found.limit == pytest.approx(2 / 3, rel=1e-12)
    assert found.safe == pytest.approx(2 / 3, rel=1e-6)


@pytest.mark.parametrize(("ratio", "stable"), [(0.999, True), (1.001, False)])
def test_central_difference_is_stable_below_the_limit_only(ratio: float, stable: bool) -> None:
    """The spectral radius of the undamped step map (u, u_old) -> (2 u - h^2 A u - u_old, u)."""
    system = block(2)
    h = ratio * CriticalStep.of(system).lanczos
    A = system.K[system.free][:, system.free].toarray() / system.masses[system.free][:, None]
    one = np.eye(len(A))
    radius = np.abs(np.linalg.eigvals(np.block([[2 * one - h * h * A, -one], [one, 0 * one]])))
    assert (radius.max() < 1 + 1e-6) == stable
    assert stable or radius.max() > 1.05


@pytest.mark.parametrize("d", [2, 3])
def test_a_single_cell_is_its_own_bound(d: int) -> None:
    corners = np.vstack([np.zeros(d), np.diag([0.3, 0.2, 0.1][:d])])
    kind = "tri3" if d == 2 else "tet4"
    mesh = Mesh(corners, np.arange(d + 1)[None], kind, {})  # type: ignore[arg-type]
    system = build(Scene(mesh, GEL))
    found = CriticalStep.of(system)
    assert found.element == pytest.approx(exact_limit(system), rel=1e-12)
    assert found.lanczos == pytest.approx(found.element, rel=1e-9)
    c = np.sqrt((GEL.bulk_modulus + 4 / 3 * GEL.shear_modulus) / 1000)
    shortest = 0.2 if d == 2 else 0.1
    height = 1 / np.sqrt((np.array([0.3, 0.2, 0.1][:d]) ** -2.0).sum())
    assert found.eq_16_edge == pytest.approx(shortest / c)
    assert found.eq_16_altitude == pytest.approx(height / c)


def test_a_sliver_is_named_and_eq_16_exaggerates_it() -> None:
    mesh = box((0.1, 0.1, 0.1), (3, 3, 3))
    cell = 40
    nodes, corners = mesh.nodes.copy(), mesh.cells[cell]
    apex, base = nodes[corners[0]], nodes[corners[1:]].mean(axis=0)
    new = len(nodes)
    # The cell is split by a node just off its base: one flat cell there, three others.
    nodes = np.vstack([nodes, base + 1e-3 * (apex - base)])
    split = [np.where(np.arange(4) == i, new, corners) for i in range(4)]
    cells = np.vstack([np.delete(mesh.cells, cell, axis=0), split])
    system = build(Scene(Mesh(nodes, cells, "tet4", dict(mesh.facets)), GEL, HELD))
    found = CriticalStep.of(system)
    assert found.cell == len(cells) - 4
    assert f"cell {len(cells) - 4} (altitude" in found.limited_by
    assert found.eq_16_altitude < 0.5 * found.lanczos
    assert found.recommended < exact_limit(system)


def test_a_stiff_region_limits_the_step() -> None:
    scene = block().scene
    stiff = Region("bone", np.array([7]), replace(GEL, E=3e6))
    found = CriticalStep.of(build(replace(scene, regions=(stiff,))))
    assert found.cell == 7
    assert found.eq_16_altitude == pytest.approx(0.1 * CriticalStep.of(block()).eq_16_altitude)
    assert element_frequencies(scene).max() < 0.2 * 2 / (found.element or np.inf)


def five_tets(n: int, size: float) -> Mesh:
    """A cube of n^3 boxes of five tetrahedra, mirrored from box to box."""
    nodes = box((size, size, size), (n, n, n)).nodes
    even = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)])
    cells = []
    for place in product(range(n), repeat=3):
        core = even if sum(place) % 2 == 0 else 1 - even
        cells.append(core + place)
        for tip in 1 - core:
            near = core[np.abs(core - tip).sum(axis=1) == 1]
            cells.append(np.vstack([tip, near]) + place)
    corners = np.array(cells) @ np.array([1, n + 1, (n + 1) ** 2])
    x = nodes[corners]
    turned = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    corners[turned] = corners[turned][:, [0, 1, 3, 2]]
    facets = boundary_facets(corners, 3)
    return Mesh(nodes, corners, "tet4", {"z0": facets[nodes[facets][..., 2].max(axis=1) < 1e-9]})


def test_eq_16_is_no_safe_step_on_a_regular_mesh() -> None:
    """An earlier study: the least altitude allows 283 us, the limit is 268.7 us."""
    found = CriticalStep.of(build(Scene(five_tets(9, 0.1), GEL, HELD)))
    assert found.eq_16_altitude == pytest.approx(283e-6, abs=0.5e-6)
    assert found.lanczos == pytest.approx(268.7e-6, abs=0.05e-6)
    assert found.eq_16_edge == pytest.approx(1.8 * found.lanczos, rel=0.05)
    assert 0.22 < 1 - found.gershgorin / found.lanczos < 0.26
    assert found.recommended == pytest.approx(0.92 * found.lanczos, rel=1e-5)


def test_frequencies_of_paper_001s_block() -> None:
    """An earlier study: 264.08 and 43191 rad/s with the consistent mass."""
    mesh = box((0.004, 0.004, 0.007), (4, 4, 7))
    lowest, highest = frequency_range(build(Scene(mesh, Material(1e4, 0.47, rho=1068.0), HELD)))
    assert lowest == pytest.approx(264.08, abs=0.005)
    assert highest == pytest.approx(43191.0, abs=0.5)


def test_the_limit_of_a_stretched_body_is_lower() -> None:
    """St. Venant-Kirchhoff at a stretch of 1.3 in every direction: -38 % (an earlier study)."""
    scene = replace(block().scene, material=replace(GEL, law="svk"))
    system, body = build(scene), Body(scene)
    free, masses = system.free, system.masses[system.free]

    def limit(u: Floats) -> float:
        K = body.tangent(u)[free][:, free]
        return CriticalStep.by_lanczos(lambda x: K @ x, masses).limit

    rest = limit(np.zeros(scene.mesh.nodes.size))
    assert rest == pytest.approx(CriticalStep.of(system).lanczos, rel=1e-9)
    assert limit(0.3 * scene.mesh.nodes.ravel()) / rest == pytest.approx(0.62, abs=0.005)


def test_a_missing_density_is_named() -> None:
    with pytest.raises(SceneError, match="set rho kg/m3"):
        CriticalStep.of(build(Scene(box((1.0, 1.0, 1.0), (1, 1, 1)), Material(1e4, 0.3), HELD)))


def test_what_has_no_critical_step_is_reported() -> None:
    assert module._density(Material(1.0, 0.3, rho=5.0)) == 5.0
    with pytest.raises(SceneError, match=r"a critical step needs.*kg/m3"):
        module._density(Material(1.0, 0.3))
    scene = SimpleNamespace(
        mesh=SimpleNamespace(kind="tet4"), material=Material(1.0, 0.3, "svk"), regions=(),
        membranes=(None,), dilatation="pointwise",
    )  # fmt: skip
    with pytest.raises(SceneError, match="membranes are linear only: remove"):
        explicit._require(scene)  # type: ignore[arg-type]
