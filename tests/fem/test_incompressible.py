"""nu = 0.5 in mixed cells: exact states, the limit from below, orders of convergence, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import mean_divergence, rule, values_at, volumes_at
from validate.fem.assembly.volume_constraints import keep_volumes, mixed_static
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import build
from validate.scene.geometries.box import box, grid
from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material, Region
from validate.scene.mesh import Mesh
from validate.scene.meshless import MaterialPoint
from validate.scene.scene import Drive, Load, Scene, Support
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.newmark import Newmark
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic

# private: _PENALTY: another penalty for the same body.

E = 3000.0  # Pa
MU = E / 3
KINDS = ("hex8", "hex27", "tet10")
every = pytest.mark.parametrize("kind", KINDS)


def made(kind: str, size: tuple[float, ...], cells: tuple[int, ...]) -> Mesh:
    mesh = box(size, cells) if kind in ("tet10", "tri6") else grid(size, cells)
    return mesh if kind in ("hex8", "quad4") else mesh.quadratic()


def rollers(d: int = 3) -> tuple[Support, ...]:
    return tuple(Support(f"{'xyz'[c]}0", (c,)) for c in range(d))


def bonded(kind: str, nu: float, law: LawName, cells: int = 2) -> Scene:
    """A cube between bonded plates, the upper one driven up."""
    mesh = made(kind, (1.0, 1.0, 1.0), (cells,) * 3)
    held = (Support("z0", (0, 1, 2)), Support("z1", (0, 1)))
    pull = (Drive("pull", "z1", (0.0, 0.0, 1.0)),)
    material = Material(2 * MU * (1 + nu), nu, law)
    return Scene(mesh, material, held, drives=pull, dilatation="mixed")


# Exact states


@every
@pytest.mark.parametrize("stretch", [0.6, 1.5])
def test_a_neo_hookean_block_under_uniaxial_stress(kind: str, stretch: float) -> None:
    """P = mu (l - 1/l^2) exactly, in steps of any number."""
    mesh = made(kind, (1.0, 1.0, 1.0), (2, 1, 1))
    drive = (Drive("pull", "x1", (1.0, 0.0, 0.0)),)
    scene = Scene(mesh, Material(E, 0.5, "neo_hooke"), rollers(), drives=drive, dilatation="mixed")
    stepper = StaticNewton().prepare(build(scene))
    state = stepper.rest()
    for share in (0.5, 1.0):
        state = stepper.step(state, np.array([share * (stretch - 1)]))
        assert state.failure is None
    expected = MU * (stretch - 1 / stretch**2)
    assert state.numbers["pull.force"] == pytest.approx(expected, rel=1e-8)
    side = stepper.field(state)[mesh.facet_nodes("y1"), 1]
    assert side == pytest.approx(stretch**-0.5 - 1, abs=1e-9)


@pytest.mark.parametrize("kind", [*KINDS, "tri6", "quad4"])
def test_a_linear_block_under_uniaxial_stress(kind: str) -> None:
    """F = E' A d/L, in plane strain E' = E / (1 - nu^2), driven and loaded."""
    d = 2 if kind in ("tri6", "quad4") else 3
    mesh = made(kind, (1.0, 2.0, 1.5)[:d], (2,) * d)
    along = (1.0, 0.0, 0.0)[:d]
    modulus, area = E / (1 if d == 3 else 0.75), 3.0 if d == 3 else 2.0
    base = Scene(mesh, Material(E, 0.5), rollers(d), dilatation="mixed")
    driven = QuasiStatic().prepare(build(replace(base, drives=(Drive("pull", "x1", along),))))
    state = driven.step(driven.rest(), np.array([0.01]))
    assert state.numbers["pull.force"] == pytest.approx(modulus * area * 0.01, rel=1e-9)
    loaded = QuasiStatic().prepare(build(replace(base, loads=(Load("pull", "x1", along),))))
    u = loaded.field(loaded.step(loaded.rest(), np.array([10.0])))
    assert u[mesh.facet_nodes("x1"), 0] == pytest.approx(10 / (modulus * area), rel=1e-9)


def test_a_softer_compressible_region_keeps_its_own_volume_change() -> None:
    """Two halves in series between rollers: the ends move by the sum of both, F L/(2 E A)."""
    mesh = made("hex8", (1.0, 1.0, 1.0), (2, 1, 1))
    half = Region("half", np.flatnonzero(mesh.nodes[mesh.cells, 0].mean(axis=1) > 0.5),
                  Material(E, 0.5))  # fmt: skip
    walls = (*rollers(), Support("y1", (1,)))
    scene = Scene(mesh, Material(E, 0.3), walls, regions=(half,), dilatation="mixed")
    scene = replace(scene, loads=(Load("pull", "x1", (1.0, 0.0, 0.0)),))
    stepper = QuasiStatic().prepare(build(scene))
    u = stepper.field(stepper.step(stepper.rest(), np.array([1.0])))
    D, weights = mean_divergence(scene)
    theta = (D @ u.ravel()).reshape(weights.shape)
    assert np.abs(theta[half.cells]).max() < 1e-10 * np.abs(u).max()
    assert np.abs(theta[np.setdiff1d([0, 1], half.cells)]).min() > 0.05 * np.abs(u).max()


# The volume, and the limit


@every
@pytest.mark.parametrize("law", ["neo_hooke", "mooney_rivlin", "ogden"])
def test_every_cell_keeps_its_volume(kind: str, law: LawName) -> None:
    """Between bonded plates at 20 %; the deformed cells are integrated anew. However
    loose the tolerance of forces is, volumes are kept."""
    parts = {"mooney_rivlin": Coefficients(C01=100.0),
             "ogden": Coefficients(ogden_alpha=(2.0,))}  # fmt: skip
    scene = bonded(kind, 0.5, law)
    material = replace(scene.material, coefficients=parts.get(law, Coefficients()))
    scene = replace(scene, material=material)
    stepper = StaticNewton(tolerance=1e-2).prepare(build(scene))
    state = stepper.step(stepper.rest(), np.array([0.2]))
    assert state.failure is None
    body, u = Body(scene), stepper.field(state).ravel()
    volumes = (body.weights * body.jacobians(u)).sum(axis=1) / body.weights.sum(axis=1)
    assert volumes == pytest.approx(1.0, abs=1e-10)
    assert np.abs(body.jacobians(u) - 1).max() > 1e-3  # kept in the mean alone


def force(kind: str, nu: float, law: LawName) -> float:
    scheme = QuasiStatic() if law == "linear" else StaticNewton(tolerance=1e-11)
    stepper = scheme.prepare(build(bonded(kind, nu, law)))
    state = stepper.step(stepper.rest(), np.array([0.1]))
    assert state.failure is None
    return state.numbers["pull.force"]


@every
@pytest.mark.parametrize("law", ["linear", "neo_hooke"])
def test_it_is_the_limit_of_finite_bulk_moduli(kind: str, law: LawName) -> None:
    """The difference to nu = .4999 is ten times that to .49999: linear in 1 - 2 nu."""
    limit = force(kind, 0.5, law)
    off = [abs(force(kind, nu, law) - limit) for nu in (0.499, 0.4999, 0.49999)]
    assert off[0] > off[1] > off[2] > 0
    assert off[1] / off[2] == pytest.approx(10, rel=0.02)
    assert off[2] < 1e-3 * abs(limit)


@pytest.mark.parametrize("law", ["linear", "neo_hooke"])
def test_the_penalty_is_not_in_the_result(law: LawName, monkeypatch: pytest.MonkeyPatch) -> None:
    before = force("hex27", 0.5, law)
    monkeypatch.setattr("validate.scene.material._PENALTY", 300.0)
    assert force("hex27", 0.5, law) == pytest.approx(before, rel=1e-8)


def test_stepping_on_from_a_state_takes_up_its_pressures() -> None:
    """A small step from a state that the stepper no longer remembers takes few iterations."""
    stepper = StaticNewton().prepare(build(bonded("hex8", 0.5, "neo_hooke")))
    first = stepper.step(stepper.rest(), np.array([0.1]))
    stepper.step(first, np.array([0.2]))
    again = stepper.step(first, np.array([0.1 + 1e-9]))
    assert again.updates <= 2  # 5 from pressures of zero
    expected = first.numbers["pull.force"]
    assert again.numbers["pull.force"] == pytest.approx(expected, rel=1e-7)


@every
def test_beside_a_compressible_region_it_is_the_limit_too(kind: str) -> None:
    """At large strain: only cells with nu = .5 have multipliers."""
    forces = []
    for nu in (0.4999, 0.49999, 0.5):
        scene = bonded(kind, nu, "neo_hooke")
        soft = Region("soft", np.arange(3), Material(E / 2, 0.3, "neo_hooke"))
        stepper = StaticNewton(tolerance=1e-11).prepare(build(replace(scene, regions=(soft,))))
        state = stepper.step(stepper.rest(), np.array([0.1]))
        assert state.failure is None
        forces.append(state.numbers["pull.force"])
    off = np.abs(np.array(forces[:2]) - forces[2])
    assert off[0] / off[1] == pytest.approx(10, rel=0.02)
    assert off[1] < 1e-3 * abs(forces[2])


# Convergence


def curled(x: Floats) -> tuple[Floats, Floats]:
    """u (..., 3) m without divergence, zero all round the unit cube, and f = -mu lap u + grad p."""
    P, k = 20 * MU, 2 * np.pi
    S, T = np.sin(np.pi * x) ** 2, np.sin(k * x)
    dS, dT = k**2 / 2 * np.cos(k * x), -(k**2) * T  # second derivatives
    g, dg = S[..., 2], dS[..., 2]
    a, b = S[..., 0] * T[..., 1], -T[..., 0] * S[..., 1]
    lap_a = dS[..., 0] * T[..., 1] + S[..., 0] * dT[..., 1]
    lap_b = -dT[..., 0] * S[..., 1] - T[..., 0] * dS[..., 1]
    zero = np.zeros_like(a)
    lap = np.stack([lap_a * g + a * dg, lap_b * g + b * dg, zero], axis=-1)
    c, s = np.cos(np.pi * x), np.pi * np.sin(np.pi * x)
    grad = -P * np.stack([s[..., 0] * c[..., 1], c[..., 0] * s[..., 1], zero], axis=-1)
    return np.stack([a * g, b * g, zero], axis=-1), -MU * lap + grad


def error(kind: str, n: int) -> float:
    """L2 norm of u_h - u on the unit cube, held all round."""
    mesh = made(kind, (1.0, 1.0, 1.0), (n, n, n))
    held = tuple(Support(f"{c}{e}", (0, 1, 2)) for c in "xyz" for e in "01")
    scene = Scene(mesh, Material(E, 0.5), held, dilatation="mixed")
    at = rule(mesh, 4)
    w, x = volumes_at(mesh, at), values_at(mesh, at, mesh.nodes)
    f = np.zeros_like(mesh.nodes)
    np.add.at(f, mesh.cells, np.einsum("eq,qa,eqi->eai", w, at.N, curled(x)[1]))
    system = build(scene)
    factor, columns = system.factor(), np.zeros((mesh.nodes.size, 1))
    columns[system.free, 0] = factor.solve(f.ravel()[system.free])
    u, _ = keep_volumes(system, factor, columns, f.reshape(-1, 1))
    found = values_at(mesh, at, u.reshape(-1, 3))
    return float(np.sqrt((w[..., None] * (found - curled(x)[0]) ** 2).sum()))


@pytest.mark.parametrize(
    ("kind", "order", "sides"), [("hex8", 2, (6, 9)), ("hex27", 3, (3, 5)), ("tet10", 1.6, (3, 5))]
)
def test_observed_order(kind: str, order: float, sides: tuple[int, int]) -> None:
    """Under a smooth body force with a pressure of twenty mu. Constant pressures leave quadratic
    tetrahedra 1.6 to 1.7 on up to eight cells a side, towards 2."""
    coarse, fine = (error(kind, n) for n in sides)
    observed = np.log(coarse / fine) / np.log(sides[1] / sides[0])
    assert order - 0.15 < observed < order + 0.35


@pytest.mark.parametrize("size", [(1.0, 2.0), (1.0, 2.0, 1.5)])
def test_taylor_hood_elements_are_exact_in_uniaxial_stress(size: tuple[float, ...]) -> None:
    """Their p / lambda vanishes: the end moves by F L/(E' A)."""
    d = len(size)
    pull = (Load("pull", "x1", (1.0, 0.0, 0.0)[:d]),)
    mesh = grid(size, (2,) * d)
    scene = Scene(mesh, Material(E, 0.5), rollers(d), loads=pull, dilatation="mixed")
    modulus = E / 0.75 if d == 2 else E
    expected = size[0] / modulus / float(np.prod(size[1:]))
    assert mixed_static(scene).compliances[0] == pytest.approx(expected, rel=1e-10)


@pytest.mark.slow
def test_taylor_hood_elements_agree_within_the_mesh() -> None:
    """A bonded block under a pull: continuous pressures on the same cells. The bond's edges are
    singular: both still move by more with the mesh than they differ."""
    ours, theirs = [], []
    for n in (2, 4):
        mesh = grid((1.0, 1.0, 1.0), (n,) * 3)
        base = Scene(mesh, Material(E, 0.5), (Support("z0", (0, 1, 2)),), dilatation="mixed",
                     loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),))  # fmt: skip
        theirs.append(mixed_static(base).compliances[0])
        system = build(replace(base, body=mesh.quadratic()))
        stepper = QuasiStatic().prepare(system)
        u = stepper.field(stepper.step(stepper.rest(), np.array([1.0]))).ravel()
        ours.append(float(system.loads[:, 0] @ u))
    assert ours == pytest.approx(theirs, rel=1.5e-3)
    assert theirs[1] / theirs[0] - 1 > 3e-3
    assert ours[1] / ours[0] - 1 > 3e-3


# Refusals


def test_other_cells_refuse_it_in_one_line() -> None:
    mesh = grid((1.0, 1.0, 1.0), (2, 2, 2))
    with pytest.raises(SceneError, match=r"nu = 0\.5 in hex8 .* nu <= 0\.4999"):
        Scene(mesh, Material(E, 0.5))
    core = Region("core", np.array([0]), Material(E, 0.5))
    with pytest.raises(SceneError, match=r"nu = 0.5 in hex8"):
        Scene(mesh, Material(E, 0.3), regions=(core,))
    with pytest.raises(SceneError, match=r"material point: expected nu < 0.5"):
        MaterialPoint(Material(E, 0.5, "neo_hooke"), "uniaxial")


@pytest.mark.parametrize("material", [
    Material(E, 0.5, "svk"), Material(E, 0.5, "neo_hooke",
                                      coefficients=Coefficients(volumetric="coupled")),
])  # fmt: skip
def test_laws_without_an_incompressible_form_are_refused(material: Material) -> None:
    with pytest.raises(SceneError, match="no incompressible form; use linear"):
        Scene(grid((1.0, 1.0, 1.0), (2, 2, 2)), material, dilatation="mixed")


@pytest.mark.parametrize(("scheme", "law"), [
    (Newmark(1e-3), "linear"), (NewtonDynamics(1e-3), "neo_hooke"),
])  # fmt: skip
def test_dynamic_schemes_refuse_it(scheme: Newmark | NewtonDynamics, law: LawName) -> None:
    scene = bonded("hex8", 0.5, law)
    scene = replace(scene, material=replace(scene.material, rho=1000.0))
    with pytest.raises(SceneError, match=r"nu <= 0.4999.*0.5; use"):
        scheme.prepare(build(scene))


def test_a_body_whose_volume_is_prescribed_has_no_solution() -> None:
    """Held all round and driven in: the volume would have to change."""
    mesh = grid((1.0, 1.0, 1.0), (2, 2, 2))
    held = (Support("y1", (1,)), Support("z1", (2,)), *rollers())
    scene = Scene(mesh, Material(E, 0.5), held, dilatation="mixed",
                  drives=(Drive("push", "x1", (-1.0, 0.0, 0.0)),))  # fmt: skip
    with pytest.raises(SceneError, match="allow no motion of constant volume"):
        QuasiStatic().prepare(build(scene))
