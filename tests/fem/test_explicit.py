"""The compiled element loops against the numpy body, and what must hold whatever the body."""

from dataclasses import replace

import numpy as np
import pytest
from law_samples import NAMES, sample
from scipy import sparse

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.kernels.laws import principal
from validate.fem.kernels.points import inverse_cube_root
from validate.fem.large_strain.explicit import ExplicitBody
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.scene import Foundation, Scene

STRETCH = np.array([[0.2, 0.3, 0.0], [-0.2, -0.3, 0.1], [0.1, 0.0, 0.4]])


def jittered(cells: tuple[int, int, int] = (3, 4, 5)) -> Mesh:
    """A block whose inner grid is shaken; 360 cells, which fill 22 blocks and a half."""
    mesh = box((0.1, 0.08, 0.12), cells)
    shift = 0.004 * np.random.default_rng(7).uniform(-1, 1, mesh.nodes.shape)
    return replace(mesh, nodes=mesh.nodes + shift)


def material(law: str, E: float = 30e3, nu: float = 0.45) -> Material:
    return replace(sample(law, E, nu), rho=1000.0)


def scene(law: str) -> Scene:
    return Scene(jittered(), material(law))


# Each law's kernel is compiled anew, which takes seconds.
COMPILED = [n if n == "neo_hooke" else pytest.param(n, marks=pytest.mark.slow) for n in NAMES]


def deformed(mesh: Mesh, size: float = 1.0) -> Floats:
    noise = 1e-3 * np.random.default_rng(3).standard_normal(mesh.nodes.shape)
    u: Floats = (size * (mesh.nodes @ STRETCH.T + noise)).ravel()
    return u


def apart(a: Floats, b: Floats) -> float:
    """Largest difference over the largest value of b."""
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.parametrize("law", COMPILED)
@pytest.mark.parametrize("size", [1.0, 0.1, 1e-3])
def test_forces_are_those_of_the_numpy_body(law: str, size: float) -> None:
    body, u = scene(law), deformed(jittered(), size)
    # The reference itself loses digits as strains fall: eps / strain for neo-Hooke.
    tolerance = 1e-13 if law == "svk" or size == 1.0 else 1e-14 / size
    assert apart(ExplicitBody(body).force(u), Body(body).force(u)) < tolerance


@pytest.mark.parametrize("law", COMPILED)
def test_tangents_are_those_of_the_numpy_body(law: str) -> None:
    body, u = scene(law), deformed(jittered())
    fast, K = ExplicitBody(body), Body(body).tangent(u)
    n = len(body.mesh.nodes)
    f, d = fast.force_and_diagonal(u)
    assert apart(f, fast.force(u)) < 1e-14
    assert apart(d, K.diagonal()) < 1e-13
    six = fast.force_and_blocks(u)[1]  # xx, yy, zz, xy, xz, yz
    blocks = six[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3)
    own = K.toarray().reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]
    assert apart(blocks, own) < 1e-13
    v = np.random.default_rng(5).standard_normal(len(u))
    assert apart(fast.tangent_product(u, v), K @ v) < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("law", ["svk", "neo_hooke"])
@pytest.mark.parametrize("size", [1.0, 0.1, 1e-3])
def test_single_precision_has_seven_digits(law: str, size: float) -> None:
    """Displacements are rounded to 6e-8 of their size, which edges feel as many times larger as
    the body is longer than they are; rounding of 24 cells' forces besides."""
    body, u = scene(law), deformed(jittered(), size)
    single, double = ExplicitBody(body, precision="single"), ExplicitBody(body)
    assert 1e-9 < apart(single.force(u), double.force(u)) < 2e-6
    f, d = single.force_and_diagonal(u)
    assert apart(f, double.force(u)) < 2e-6
    assert apart(d, double.force_and_diagonal(u)[1]) < 2e-6
    assert apart(single.force_and_blocks(u)[1], double.force_and_blocks(u)[1]) < 2e-6
    assert single.look(u) == double.look(u)


def test_single_precision_is_for_two_laws() -> None:
    with pytest.raises(SceneError, match="single precision supports tet4"):
        ExplicitBody(scene("ogden"), precision="single")


def test_more_springs_leave_a_body_as_it_was() -> None:
    body = ExplicitBody(scene("svk"))
    before, u = body.packed, deformed(jittered())
    stiff = body.sprung(sparse.csr_array(sparse.eye_array(body.size)))
    assert stiff.packed[4].size == body.size
    assert body.packed is before
    assert stiff.force_and_diagonal(u)[1] == pytest.approx(body.force_and_diagonal(u)[1] + 1)


@pytest.mark.slow
@pytest.mark.parametrize("threads", [2, 3])
def test_threads_share_the_cells(threads: int) -> None:
    body, u = scene("svk"), deformed(jittered())
    body = replace(body, foundations=(Foundation("x0", (0, 2), 1e6),))
    shared = ExplicitBody(body, threads)
    one = shared.force(u)
    assert apart(one, ExplicitBody(body).force(u)) < 1e-14
    assert np.array_equal(shared.force(u), one)


@pytest.mark.parametrize("law", COMPILED)
def test_blocks_do_not_remember(law: str) -> None:
    """The workspace keeps what was there before: a state beyond all numbers must leave nothing."""
    body, u = scene(law), deformed(jittered())
    fast = ExplicitBody(body)
    f, d = fast.force_and_diagonal(u)
    fast.force_and_blocks(np.full_like(u, np.nan))
    again = fast.force_and_diagonal(u)
    assert np.array_equal(again[0], f)
    assert np.array_equal(again[1], d)


@pytest.mark.parametrize("law", COMPILED)
def test_the_look_knows_energy_and_det_f(law: str) -> None:
    body, u = scene(law), deformed(jittered())
    look, reference = ExplicitBody(body).look(u), Body(body)
    assert look.energy == pytest.approx(reference.energy(u), rel=1e-13)
    assert look.det_F == pytest.approx(reference.jacobians(u).min(), rel=1e-13)
    assert (look.inverted, look.cells) == (0, 360)
    u[0] += 0.2
    bad = reference.inverted(u)
    assert bad is not None
    assert ExplicitBody(body).look(u).inverted == bad.count


@pytest.mark.parametrize("law", COMPILED)
def test_a_turned_body_feels_nothing(law: str) -> None:
    body = scene(law)
    Q, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    Q *= np.sign(np.linalg.det(Q))
    u = (body.mesh.nodes @ (Q - np.eye(3)).T).ravel()
    fast = ExplicitBody(body)
    unit = Body(body).unit_force
    assert np.abs(fast.force(u)).max() < 1e-13 * unit
    assert np.abs(fast.force(u + 1e-3 * np.tile([1.0, 2.0, 3.0], len(u) // 3))).max() < 1e-12 * unit


@pytest.mark.parametrize("law", COMPILED)
def test_small_strains_keep_their_digits(law: str) -> None:
    """At a strain of 1e-8 forces are K u and energies u.K u/2 to the strain squared, not to eps."""
    body = replace(scene(law), body=box((0.1, 0.08, 0.12), (3, 4, 5)))
    u = deformed(body.mesh, 1e-8)
    K = build(body).K
    fast = ExplicitBody(body)
    assert apart(fast.force(u), K @ u) < 1e-7
    assert fast.look(u).energy == pytest.approx(u @ (K @ u) / 2, rel=1e-6)


@pytest.mark.parametrize("law", COMPILED)
def test_regions_have_their_own_moduli(law: str) -> None:
    """Two regions of one scene feel like two bodies that share the nodes."""
    whole = scene(law)
    hard = np.arange(100, 250)
    mixed = replace(whole, regions=(Region("hard", hard, material(law, 90e3, 0.42)),))
    u = deformed(whole.mesh)
    rest = np.setdiff1d(np.arange(360), hard)
    parts = [(rest, whole.material), (hard, mixed.regions[0].material)]
    forces = [
        Body(Scene(replace(whole.mesh, cells=whole.mesh.cells[c], facets={}), m)).force(u)
        for c, m in parts
    ]
    assert apart(ExplicitBody(mixed).force(u), sum(forces[1:], forces[0])) < 1e-13


def test_foundations_are_springs() -> None:
    body = replace(scene("svk"), foundations=(Foundation("x0", (0, 2), 1e6),))
    u, reference = deformed(body.mesh), Body(body)
    fast = ExplicitBody(body)
    assert apart(fast.force(u), reference.force(u)) < 1e-13
    assert apart(fast.force_and_diagonal(u)[1], reference.tangent(u).diagonal()) < 1e-13
    assert apart(fast.tangent_product(u, u), reference.tangent(u) @ u) < 1e-13
    assert fast.look(u).energy == pytest.approx(reference.energy(u), rel=1e-13)


def test_uniaxial_st_venant_kirchhoff() -> None:
    """A 0.1 m cube of E 30 kPa between slip plates: E/2 (s^3 - s) A, whatever nu."""
    mesh = box((0.1, 0.1, 0.1), (2, 2, 2))
    nu, face = 0.45, mesh.facet_nodes("x1")
    fast = ExplicitBody(Scene(mesh, Material(30e3, nu, "svk", 1000.0)))
    for stretch, newtons in ((0.9, 25.65), (0.8, 43.20)):
        side = np.sqrt(1 + nu * (1 - stretch**2))
        u = mesh.nodes * (np.array([stretch, side, side]) - 1)
        force = fast.force(u.ravel()).reshape(-1, 3)
        assert -force[face, 0].sum() == pytest.approx(newtons, rel=1e-12)
        assert np.abs(force[:, 1:]).max() < 1e-12 * newtons


def test_the_inverse_cube_root_is_exact_to_rounding() -> None:
    x = np.concatenate([10.0 ** np.linspace(-30, 30, 2001), np.linspace(0.2, 3, 5001)])
    found = np.array([inverse_cube_root(value) for value in x])
    assert np.abs(found * np.cbrt(x) - 1).max() < 1e-15
    assert np.isnan([inverse_cube_root(value) for value in (0.0, -1.0, np.nan)]).all()


@pytest.mark.parametrize("law", COMPILED[1:])  # svk bears it
def test_an_inverted_cell_has_no_force(law: str) -> None:
    body = scene(law)
    u = deformed(body.mesh)
    u[0] += 0.2
    assert np.isnan(ExplicitBody(body).force(u)).any()


def test_principal_directions_of_equal_and_small_eigenvalues() -> None:
    """Jacobi's rotations keep the digits that the closed form of the cubic would lose."""
    Q, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))
    for values in ([1.0, 1.0, 1.0], [0.3, 0.3, -0.2], [0.3, 0.3 + 1e-9, -0.2], [1e-9, 2e-9, 0.0]):
        A = Q @ np.diag(values) @ Q.T
        found, flat = principal((A[0, 0], A[1, 1], A[2, 2], A[0, 1], A[0, 2], A[1, 2]))
        N = np.reshape(flat, (3, 3))
        size = np.abs(values).max()
        assert np.sort(found) == pytest.approx(np.sort(values), abs=2e-15 * size)
        assert pytest.approx(np.eye(3), abs=2e-15) == N.T @ N
        assert N @ np.diag(found) @ N.T == pytest.approx(A, abs=2e-15 * size)


def test_terms_of_regions_may_differ_in_number() -> None:
    """A cell of two terms beside cells of three: the card is filled up with none."""
    whole = scene("ogden")
    two = replace(Material.ogden((4e3, 1e3), (2.0, 3.0), 0.45), rho=1000.0)
    mixed = replace(whole, regions=(Region("other", np.arange(100, 250), two),))
    u, rest = deformed(whole.mesh), np.setdiff1d(np.arange(360), np.arange(100, 250))
    parts = [(rest, whole.material), (np.arange(100, 250), two)]
    forces = [
        Body(Scene(replace(whole.mesh, cells=whole.mesh.cells[c], facets={}), m)).force(u)
        for c, m in parts
    ]
    assert apart(ExplicitBody(mixed).force(u), sum(forces[1:], forces[0])) < 1e-13


def test_what_has_no_explicit_form_is_refused() -> None:
    body = scene("svk")
    with pytest.raises(SceneError, match="0 threads: use 1"):
        ExplicitBody(body, threads=0)
    with pytest.raises(SceneError, match="tet10 have no explicit form"):
        ExplicitBody(replace(body, body=body.mesh.quadratic()))
    with pytest.raises(SceneError, match="law 'linear' has no large-strain form"):
        ExplicitBody(replace(body, material=Material(30e3, 0.3)))
    with pytest.raises(SceneError, match="use 'pointwise'"):
        ExplicitBody(replace(body, dilatation="nodal_mean"))
    other = Region("core", np.array([0]), Material(30e3, 0.3, "neo_hooke"))
    svk = replace(body, material=Material(30e3, 0.3, "svk"), regions=(other,))
    with pytest.raises(SceneError, match=r"one law in one form, not .'neo_hooke"):
        ExplicitBody(svk)
