"""The compiled element loops against the numpy body, and what must hold whatever the body."""

from dataclasses import replace

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.explicit import ExplicitBody
from validate.fem.explicit_kernels import _inverse_cube_root
from validate.fem.hyperelastic import Body
from validate.fem.system import build
from validate.scene.box import box
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import Foundation, LawName, Material, Region, Scene

LAWS: tuple[LawName, ...] = ("svk", "neo_hooke")
STRETCH = np.array([[0.2, 0.3, 0.0], [-0.2, -0.3, 0.1], [0.1, 0.0, 0.4]])


def jittered(cells: tuple[int, int, int] = (3, 4, 5)) -> Mesh:
    """A block whose inner grid is shaken; 360 cells, which fill 22 blocks and a half."""
    mesh = box((0.1, 0.08, 0.12), cells)
    shift = 0.004 * np.random.default_rng(7).uniform(-1, 1, mesh.nodes.shape)
    return replace(mesh, nodes=mesh.nodes + shift)


def scene(law: LawName, nu: float = 0.45) -> Scene:
    return Scene(jittered(), Material(30e3, nu, law, 1000.0))


def deformed(mesh: Mesh, size: float = 1.0) -> Floats:
    noise = 1e-3 * np.random.default_rng(3).standard_normal(mesh.nodes.shape)
    u: Floats = (size * (mesh.nodes @ STRETCH.T + noise)).ravel()
    return u


def apart(a: Floats, b: Floats) -> float:
    """Largest difference over the largest value of b."""
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("size", [1.0, 0.1, 1e-3])
def test_forces_are_those_of_the_numpy_body(law: LawName, size: float) -> None:
    body, u = scene(law), deformed(jittered(), size)
    # The reference itself loses digits as strains fall: eps / strain for neo-Hooke.
    tolerance = 1e-13 if law == "svk" or size == 1.0 else 1e-14 / size
    assert apart(ExplicitBody(body).force(u), Body(body).force(u)) < tolerance


@pytest.mark.parametrize("law", LAWS)
def test_tangents_are_those_of_the_numpy_body(law: LawName) -> None:
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


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_share_the_cells(threads: int) -> None:
    body, u = scene("svk"), deformed(jittered())
    body = replace(body, foundations=(Foundation("x0", (0, 2), 1e6),))
    shared = ExplicitBody(body, threads)
    one = shared.force(u)
    assert apart(one, ExplicitBody(body).force(u)) < 1e-14
    assert np.array_equal(shared.force(u), one)


@pytest.mark.parametrize("law", LAWS)
def test_blocks_do_not_remember(law: LawName) -> None:
    """The workspace keeps what was there before: a state beyond all numbers must leave nothing."""
    body, u = scene(law), deformed(jittered())
    fast = ExplicitBody(body)
    f, d = fast.force_and_diagonal(u)
    fast.force_and_blocks(np.full_like(u, np.nan))
    again = fast.force_and_diagonal(u)
    assert np.array_equal(again[0], f)
    assert np.array_equal(again[1], d)


@pytest.mark.parametrize("law", LAWS)
def test_the_look_knows_energy_and_det_f(law: LawName) -> None:
    body, u = scene(law), deformed(jittered())
    look, reference = ExplicitBody(body).look(u), Body(body)
    assert look.energy == pytest.approx(reference.energy(u), rel=1e-13)
    assert look.det_F == pytest.approx(reference.jacobians(u).min(), rel=1e-13)
    assert (look.inverted, look.cells) == (0, 360)
    u[0] += 0.2
    bad = reference.inverted(u)
    assert bad is not None
    assert ExplicitBody(body).look(u).inverted == bad.count


@pytest.mark.parametrize("law", LAWS)
def test_a_turned_body_feels_nothing(law: LawName) -> None:
    body = scene(law)
    Q, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    Q *= np.sign(np.linalg.det(Q))
    u = (body.mesh.nodes @ (Q - np.eye(3)).T).ravel()
    fast = ExplicitBody(body)
    unit = Body(body).unit_force
    assert np.abs(fast.force(u)).max() < 1e-13 * unit
    assert np.abs(fast.force(u + 1e-3 * np.tile([1.0, 2.0, 3.0], len(u) // 3))).max() < 1e-12 * unit


@pytest.mark.parametrize("law", LAWS)
def test_small_strains_keep_their_digits(law: LawName) -> None:
    """At a strain of 1e-8 forces are K u and energies u.K u/2 to the strain squared, not to eps."""
    body = replace(scene(law), mesh=box((0.1, 0.08, 0.12), (3, 4, 5)))
    u = deformed(body.mesh, 1e-8)
    K = build(body).K
    fast = ExplicitBody(body)
    assert apart(fast.force(u), K @ u) < 1e-7
    assert fast.look(u).energy == pytest.approx(u @ (K @ u) / 2, rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_regions_have_their_own_moduli(law: LawName) -> None:
    """Two regions of one scene feel like two bodies that share the nodes."""
    whole = scene(law)
    hard = np.arange(100, 250)
    mixed = replace(whole, regions=(Region("hard", hard, Material(90e3, 0.3, law, 1000.0)),))
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
    found = np.array([_inverse_cube_root(value) for value in x])
    assert np.abs(found * np.cbrt(x) - 1).max() < 1e-15
    assert np.isnan([_inverse_cube_root(value) for value in (0.0, -1.0, np.nan)]).all()


def test_an_inverted_neo_hookean_cell_has_no_force() -> None:
    body = scene("neo_hooke")
    u = deformed(body.mesh)
    u[0] += 0.2
    assert np.isnan(ExplicitBody(body).force(u)).any()


def test_what_has_no_explicit_form_is_refused() -> None:
    body = scene("svk")
    with pytest.raises(SceneError, match="0 threads: take 1"):
        ExplicitBody(body, threads=0)
    with pytest.raises(SceneError, match="tet10 have no explicit form"):
        ExplicitBody(replace(body, mesh=quadratic(body.mesh)))
    with pytest.raises(SceneError, match="law 'linear' has no form"):
        ExplicitBody(replace(body, material=Material(30e3, 0.3)))
    with pytest.raises(SceneError, match="dilatation='pointwise'"):
        ExplicitBody(replace(body, dilatation="nodal_mean"))
