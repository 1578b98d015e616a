"""Newmark's family: order, energy, stability, limits, forces of drives, paper 001's block."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from inertial_scenes import TOTAL, cube, driven, exact, orders, small

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses, System, build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Drive, Load, Scene
from validate.solve.dynamic.linear import excitation
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.dynamic.newmark_rule import Rule, RuleName, propagation
from validate.solve.march import march
from validate.solve.static.linear_solvers import SolverName, solver_of
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Run, State

RULES: tuple[RuleName, ...] = get_args(RuleName)
ORDER = {"average": 2, "backward_euler": 1, "generalised_alpha": 2}
COUNTS = (400, 800, 1600)
END = 0.1


def run(scheme: Newmark | QuasiStatic, system: System, inputs: Floats, dt: float = 0.002) -> Run:
    t = dt * np.arange(1, len(inputs) + 1)
    return march("m", scheme.prepare(system), t, inputs, np.array([len(t) - 1]), 0.0)


def last(scheme: Newmark, system: System, inputs: Floats) -> State:
    stepper = scheme.prepare(system)
    state = stepper.rest()
    for value in inputs:
        state = stepper.step(state, value)
    assert state.failure is None
    return state


def error(state: State, system: System, truth: Floats) -> float:
    """Relative error of u and v of the free unknowns, the worse."""
    m = len(system.free)
    pairs = ((state.inner.u, truth[:m]), (state.inner.v, truth[m:]))
    return max(float(np.abs(x - y).max() / np.abs(y).max()) for x, y in pairs)


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_order_under_a_load_that_is_switched_on(rule: RuleName) -> None:
    system = small()
    truth = exact(system, system.loads[system.free], np.zeros((1, 1)), np.ones(1), END)

    def off(n: int) -> float:
        return error(last(Newmark(END / n, rule), system, np.ones((n, 1))), system, truth)

    assert orders(off, COUNTS) == pytest.approx([ORDER[rule]] * 2, abs=0.15)
    assert off(COUNTS[-1]) < (0.15 if rule == "backward_euler" else 0.002)


@pytest.mark.parametrize("rule", RULES)
def test_order_under_a_load_that_grows_from_nothing(rule: RuleName) -> None:
    """sin(40 t): the signal is half of a rotation, and a0 = 0 is the truth."""
    system = small()
    turn = np.array([[0.0, 40.0], [-40.0, 0.0]])
    forces = system.loads[system.free] @ np.array([[1.0, 0.0]])
    truth = exact(system, forces, turn, np.array([0.0, 1.0]), END)

    def off(n: int) -> float:
        load = np.sin(40 * END / n * np.arange(1, n + 1))[:, None]
        return error(last(Newmark(END / n, rule, "zero"), system, load), system, truth)

    assert orders(off, COUNTS) == pytest.approx([ORDER[rule]] * 2, abs=0.15)


@pytest.mark.parametrize("rule", ["average", "generalised_alpha"])
def test_order_under_a_drive(rule: RuleName) -> None:
    """q = t^3: q, q', q'' push by K, C, M; lumped masses couple no prescribed unknown."""
    system = build(replace(driven().scene, loads=()))
    columns = excitation(system, Rule.of(rule, 1.0), "lumped")
    assert np.abs(columns.mass).max() == 0.0
    power = np.diag([3.0, 2.0, 1.0], 1)  # (t^3, t^2, t, 1)
    q = np.array([[1.0, 0, 0, 0], [0, 3.0, 0, 0]])
    forces = -columns.stiffness @ q[:1] - columns.damping @ q[1:]
    truth = exact(system, forces, power, np.array([0.0, 0, 0, 1.0]), END, "lumped")

    def off(n: int) -> float:
        moves = (END / n * np.arange(1, n + 1))[:, None] ** 3
        scheme = Newmark(END / n, rule, "zero", mass="lumped")
        return error(last(scheme, system, moves), system, truth)

    assert orders(off, (100, 200, 400)) == pytest.approx([2.0, 2.0], abs=0.2)


def test_average_acceleration_conserves_energy() -> None:
    """Pulled for ten steps, then let go, undamped: kinetic + strain energy stays to rounding."""
    system = small(0.0, 0.0)
    stepper = Newmark(0.003).prepare(system)
    K, M = (X[system.free][:, system.free] for X in (system.K, system.M))
    state, energies = stepper.rest(), []
    for k in range(400):
        state = stepper.step(state, np.array([1.0 if k < 10 else 0.0]))
        u, v = state.inner.u, state.inner.v
        energies.append(float(u @ (K @ u) + v @ (M @ v)) / 2)
    # The step that lets go does work still; from the next one on nothing does.
    assert np.ptp(energies[10:]) < 1e-12 * energies[10]
    assert energies[10] > 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("dt", [1e-5, 2e-3, 10.0])
@pytest.mark.parametrize("rule", RULES)
def test_nothing_diverges_without_damping(rule: RuleName, dt: float) -> None:
    """alpha_1 from .1 to 0: at most twice the static u where a mode is alone."""
    system = cube(0.0)
    z = run(Newmark(dt, rule), system, np.full((300, 1), TOTAL), dt).traces["top.z"].y
    assert len(z) == 300
    assert np.abs(z).max() < 2.5 * 1.8708e-3


@pytest.mark.parametrize("rule", RULES)
def test_a_load_that_stays_ends_in_statics(rule: RuleName) -> None:
    system = driven()
    inputs = np.tile([0.002, 1.0], (800, 1))
    state, static = last(Newmark(0.002, rule, "zero"), system, inputs), responses_of(system)
    u = static @ inputs[0]
    assert np.abs(state.inner.u - u[system.free]).max() < 1e-5 * np.abs(u).max()
    still = QuasiStatic().prepare(system)
    assert still.field(still.step(still.rest(), inputs[0])).ravel() == pytest.approx(u, abs=1e-15)
    force = still.step(still.rest(), inputs[0]).numbers["press.force"]
    assert state.numbers["press.force"] == pytest.approx(force, rel=1e-4)


def responses_of(system: System) -> Floats:
    """Static columns (N, 2) of drive and load by a dense solution."""
    free = system.free
    K = system.K[free][:, free].toarray()
    columns = np.hstack([system.moves, 0 * system.loads])
    forces = np.hstack([-(system.K @ system.moves), system.loads])
    columns[free] = np.linalg.solve(K, forces[free])
    return columns


def test_the_quasi_static_force_is_that_of_the_response_columns() -> None:
    scene = replace(driven().scene, loads=(), copies=4)
    system = build(scene)
    stepper = QuasiStatic().prepare(system)
    force = stepper.step(stepper.rest(), np.array([0.003])).numbers["press.force"]
    assert force == pytest.approx(0.003 * Responses.of(system).reactions[0, 0], rel=1e-12)
    assert force > 0


def test_a_load_on_the_plate_is_not_the_plates() -> None:
    """A weight of 2 N on the driven side takes 2 N off what the plate has to push."""
    scene = replace(driven().scene, loads=(Load("weight", "z1", (0.0, 0.0, -1.0)),))
    system = build(scene)
    for scheme in (QuasiStatic(), Newmark(), Modal()):
        stepper = scheme.prepare(system)
        bare, loaded = (
            stepper.step(stepper.rest(), np.array([0.003, w])).numbers["press.force"]
            for w in (0.0, 2.0)
        )
        assert bare - loaded == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("copies", [1, 2])
def test_a_pushed_free_block_has_the_force_of_its_mass(copies: int, mass: str) -> None:
    """q = g t^2/2 pushes 1 kg that is held nowhere: m (g + alpha_0 g t), compression positive."""
    g, dt, n = 9.81, 0.005, 400
    system = build(
        Scene(
            box((0.1, 0.1, 0.1), (2, 2, 2)),
            Material(1e5, 0.3, rho=1000.0, mass_damping=0.5, stiffness_damping=0.01),
            drives=(Drive("push", "z0", (0.0, 0.0, 1.0)),),
            copies=copies,
        )
    )
    q = g / 2 * (dt * np.arange(1, n + 1)) ** 2
    force = (
        run(
            Newmark(dt, "backward_euler", mass=mass),  # type: ignore[arg-type]
            system,
            q[:, None],
            dt,
        )
        .traces["push.force"]
        .y
    )
    assert force[-1] == pytest.approx(copies * g * (1 + 0.5 * n * dt), rel=2e-3)


def test_average_acceleration_rings_on_a_ramp_by_its_rule_alone() -> None:
    """By the rule a'' of a ramp alternates and grows with every step; differences settle."""
    system = build(replace(driven().scene, loads=()))
    ramp = 1e-5 * np.arange(1, 201)[:, None]
    by = {
        rates: run(Newmark(drive_rates=rates), system, ramp).traces["press.force"].y
        for rates in ("difference", "rule")
    }
    static = run(QuasiStatic(), system, ramp).traces["press.force"].y
    assert np.abs(np.diff(by["difference"], 2)[-50:]).max() < 0.01 * static[-1]
    assert np.abs(np.diff(by["rule"], 2)[-50:]).max() > 0.1 * static[-1]


def test_the_numbers_of_paper_001s_block() -> None:
    """An earlier study: 500 steps of 2 ms against u_static (1 - exp(-t/.1)), and both a0."""
    system, load = cube(), np.full((500, 1), TOTAL)
    t = 0.002 * np.arange(1, 501)
    z = run(Newmark(), system, load).traces["top.z"].y
    static = 1.8707896467e-3
    assert np.abs(z - static * (1 - np.exp(-t / 0.1))).max() < 4e-4 * static
    assert z[49] == pytest.approx(1.182641e-3, abs=5e-10)
    zero = run(Newmark(a0="zero"), system, load).traces["top.z"].y
    assert zero[49] == pytest.approx(1.175634e-3, abs=5e-10)
    assert zero[0] == pytest.approx(z[0] / 2, rel=0.01)


def test_generalised_alpha_is_not_started_where_it_would_leave_an_offset() -> None:
    with pytest.raises(SceneError, match="use a0 = zero"):
        Newmark(rule="generalised_alpha").prepare(cube())
    z = run(Newmark(rule="generalised_alpha", a0="zero"), cube(), np.full((50, 1), TOTAL))
    assert z.traces["top.z"].y[49] == pytest.approx(1.1756e-3, abs=1e-7)
    same = run(Newmark(rule="generalised_alpha", rho_inf=1.0), cube(), np.full((50, 1), TOTAL))
    assert same.traces["top.z"].y[49] == pytest.approx(1.182641e-3, abs=5e-10)


@pytest.mark.parametrize("solver", get_args(SolverName))
def test_every_solver_makes_the_same_steps(solver: SolverName) -> None:
    inputs = np.array([[0.001, 2.0], [0.003, 1.0], [0.002, 0.0]])
    exactly = {"tolerance": 1e-14} if solver in ("gauss_seidel", "cg") else {}
    expected = last(Newmark(), driven(), inputs)
    got = last(Newmark(solver=solver, **exactly), driven(), inputs)
    u = expected.inner.u
    assert got.inner.u == pytest.approx(u, abs=1e-12 * np.abs(u).max())


@pytest.mark.parametrize("solver", get_args(SolverName))
def test_solvers_take_several_right_hand_sides(solver: SolverName) -> None:
    p = propagation(driven(), Rule.of("average", 0.002))
    b = np.random.default_rng(2).standard_normal((len(p.free), 2))
    nodes = driven().scene.mesh.nodes
    x = solver_of(solver, p.J, p.free // 3, nodes, 1e-12).solve(b)
    assert p.J @ x == pytest.approx(b, abs=1e-10)


@pytest.mark.parametrize("solver", ["gaussian_elimination", "dense_solve", "dense_inverse"])
def test_dense_matrices_have_a_largest_size(solver: SolverName) -> None:
    J = propagation(small(), Rule.of("average", 0.002)).J.__class__((4001, 4001))
    with pytest.raises(SceneError, match=rf"{solver} with 4001 unknowns: .* 4000"):
        solver_of(solver, J, np.arange(4001), np.zeros((4001, 3)))


@pytest.mark.parametrize("rule", RULES)
def test_the_state_equation_is_the_papers(rule: RuleName) -> None:
    """u' = J^-1 (A u + L v + M_a a + f) with the balance it stands for (paper 001, eqs 8-14)."""
    system, r = driven(), Rule.of(rule, 0.002, 0.6)
    p = propagation(system, r)
    u, v, a, f = np.random.default_rng(3).standard_normal((4, len(p.free)))
    new = p.predict(u, v, a, f)
    assert p.J @ new == pytest.approx(p.history(u, v, a) + f, abs=1e-7)
    still = np.zeros_like(u)
    assert p.A @ u == pytest.approx(p.history(u, still, still), abs=1e-7)
    v_new, a_new = p.rates(new, u, v, a)
    balance = p.M @ r.weighted_a(a_new, a) + p.C @ r.weighted(v_new, v) + p.K @ r.weighted(new, u)
    scale = np.abs(p.M @ a_new).max()
    assert np.abs(balance - f).max() < 1e-12 * scale
    assert p.transition() @ u == pytest.approx(np.linalg.solve(p.J.toarray(), p.A @ u), abs=1e-10)
    if rule == "average":
        h = 0.002
        assert p.A.toarray() == pytest.approx((4 * p.M / h**2 + 2 * p.C / h).toarray())
        assert p.history(still, v, still) == pytest.approx((4 * p.M / h + p.C) @ v)
        assert p.history(still, still, a) == pytest.approx(p.M @ a)
        assert v_new == pytest.approx(v + h * (a + a_new) / 2)
        assert new == pytest.approx(u + h * v + h**2 * (a + a_new) / 4)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"dt": 0.0}, "time step 0 s"),
        ({"dt": float("nan")}, "time step nan s"),
        ({"rule": "generalised_alpha", "rho_inf": 1.2}, r"rho_inf = 1\.2"),
    ],
)
def test_settings_that_mean_nothing_are_refused(settings: dict[str, float], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        Newmark(**settings)  # type: ignore[arg-type]


def test_an_input_that_is_no_number_ends_the_run() -> None:
    stepper = Newmark().prepare(small())
    state = stepper.step(stepper.rest(), np.array([np.nan]))
    assert state.failure == ("diverged", "accelerations are not finite at step 1")


def test_a_body_without_supports_is_refused_by_statics() -> None:
    scene = replace(small().scene, supports=(), loads=(Load("p", "z1", (1.0, 0.0, 0.0)),))
    with pytest.raises(SceneError, match="the body can move rigidly"):
        QuasiStatic().prepare(build(scene))


def test_a_step_whose_square_vanishes_is_refused() -> None:
    with pytest.raises(SceneError, match="time step 1e-300 s: its square"):
        Rule.of("average", 1e-300)
