"""How a static solution ends, the constrained inertia, and the fluid's constraint."""

import numpy as np
import pytest
from newton_scenes import cube, phantom_system, prepared, pressed, two_cavities, two_cavity_system
from phantoms import grid_mesh
from scipy.linalg import null_space

from validate.fem.cavity import volume_hessian
from validate.fem.system import build
from validate.scene.material import Material
from validate.scene.scene import Cavity, Drive, Scene, Support
from validate.solve.march import march
from validate.solve.static.newton import NewtonStepper, StaticNewton, equilibrium

STILL = np.zeros(1)  # the drive

# Outcomes


@pytest.mark.parametrize(("iterations", "cuts"), [(1, 0), (1, 3), (2, 0)])
def test_limit_of_iterations_is_an_outcome(iterations: int, cuts: int) -> None:
    settings = StaticNewton(max_iterations=iterations, max_cuts=cuts)
    stepper = prepared(cube("neo_hooke", 0.45, "bonded"), settings)
    run = march("n", stepper, np.arange(2.0), np.array([[0.0], [0.03]]), np.array([0]), 0.0)
    assert (run.outcome.state, run.outcome.step) == ("not_converged", 1)
    assert f"after {iterations} iterations, tolerance 1.0e-09" in run.outcome.why
    assert "last good load" in run.outcome.why


def test_cuts_reach_what_one_step_does_not() -> None:
    scene = cube("neo_hooke", 0.45, "bonded")
    whole = pressed(prepared(scene, StaticNewton(max_cuts=0)), 0.08)
    halves = pressed(prepared(scene), 0.08)
    slowly = pressed(prepared(scene), *np.linspace(0.01, 0.08, 8))
    assert whole.failure is not None
    assert halves.failure is None
    assert slowly.numbers["stage.force"] == pytest.approx(halves.numbers["stage.force"], rel=1e-8)


def test_inverted_cells_are_invalid_and_named() -> None:
    """The prediction of one huge step turns cells inside out, and no cut is allowed."""
    stepper = prepared(cube("neo_hooke", 0.45, "bonded"), StaticNewton(max_cuts=0))
    state = pressed(stepper, 0.01)
    failed = stepper.step(state, np.array([0.15]))
    assert failed.failure is not None
    ending, why = failed.failure
    assert ending == "invalid"
    count, total = (int(why.split()[i]) for i in (0, 2))
    assert 0 < count <= total == 162
    assert "quadrature points inverted (det F <= 0), first in element" in why
    assert why.endswith(
        "last good load 10 mm (0 % of the step); take more cuts or smaller steps, or a finer mesh "
        "there"
    )
    assert failed.inner.inputs.tolist() == [0.01]
    assert failed.inner.u is state.inner.u


def test_end_of_the_law_is_invalid_with_the_last_good_load() -> None:
    """Slipping plates: the homogeneous stretch reaches 1/sqrt(3) at 42.26 mm."""
    stepper = prepared(cube("svk", 0.49, n=3))
    failed = pressed(stepper, 0.04, 0.06)
    assert failed.failure is not None
    assert failed.failure[0] == "invalid"
    assert failed.failure[1].startswith("beyond the law's validity: principal stretch 0.57")
    assert "is below 0.577; last good load 4" in failed.failure[1]
    assert failed.inner.inputs[0] == pytest.approx(0.042265, abs=0.02 / 2**6)
    assert failed.inner.inputs[0] < 0.042265


@pytest.mark.slow
def test_no_static_solution_beyond_a_load() -> None:
    """Bonded plates: Newton stops near stretch .69 to .75."""
    stepper = prepared(cube("svk", 0.4, "bonded", n=6, dilatation="nodal_mean"))
    state, d = stepper.rest(), 0.0
    while state.failure is None and d < 0.04:
        d += 0.005
        good, state = state, stepper.step(state, np.array([d]))
    assert state.failure is not None
    ending, why = state.failure
    assert ending == "not_converged"
    assert why.startswith(
        f"no static solution was found beyond {1e3 * state.inner.inputs[0]:.4g} mm ("
    )
    assert "% of the step): tangent not positive definite" in why
    assert "negative pivots" in why
    assert why.endswith("if the body snaps through there, use NewtonDynamics")
    assert 0.69 < 1 - state.inner.inputs[0] / 0.1 < 0.76
    assert state.inner.inputs[0] >= good.inner.inputs[0]
    assert state.numbers["stage.force"] > good.numbers["stage.force"] * 0.99


def test_loss_of_definiteness_is_traced() -> None:
    """Between slipping plates the homogeneous state goes on, but no longer stable."""
    stepper = prepared(cube("svk", 0.3, n=5))
    state = stepper.rest()
    pivots = []
    for d in (0.01, 0.02, 0.03, 0.04, 0.042):
        state = stepper.step(state, np.array([d]))
        assert state.failure is None
        pivots.append(state.numbers["tangent.negative_pivots"])
    assert pivots[:2] == [0, 0]
    assert pivots[-1] > 0
    K = stepper.problem.body.tangent(stepper.step(state, np.array([0.042])).inner.u)
    free = stepper.problem.system.free
    assert pivots[-1] == (np.linalg.eigvalsh(K[free][:, free].toarray()) < 0).sum()


# The constraint


@pytest.mark.parametrize("pressure", [0.0, 500.0, 5e3, -2e4])
def test_inertia_is_that_of_the_constrained_hessian(pressure: float) -> None:
    """Against the dense Hessian on the null space of the volumes' gradients."""
    system = two_cavity_system()
    problem = equilibrium(system, True)
    rng = np.random.default_rng(0)
    u = np.zeros(system.K.shape[0])
    u[system.free] = 2e-4 * rng.normal(size=len(system.free))
    at = problem.balance(u, np.array([pressure, 0.3 * pressure]), STILL, np.ones(2))
    tangent = problem.tangent(at)
    A = problem.body.tangent(u)
    x = system.scene.mesh.nodes + u.reshape(-1, 3)
    for P, cavity in zip(at.pressures, system.cavities, strict=True):
        A = A - P * volume_hessian(cavity, x)
    A = A[system.free][:, system.free].toarray()
    Z = null_space(at.loads[:, system.free])
    assert tangent.factor.negative_pivots == (np.linalg.eigvalsh(A) < 0).sum()
    assert tangent.negative == (np.linalg.eigvalsh(Z.T @ A @ Z) < 0).sum()
    assert (tangent.negative > 0) == (pressure == -2e4)


def balloon() -> Scene:
    """A cube of thin walls around a cubic cavity, blown up by its fluid."""
    mesh = grid_mesh((8, 8, 8), 3 * (0.07,), (3 * (slice(1, 6),),))
    supports = tuple(Support(f"{letter}0", (axis,)) for axis, letter in enumerate("xyz"))
    drive, cavity = Drive("stage", "x1", (-1.0, 0.0, 0.0)), Cavity("fluid", "hole0")
    return Scene(mesh, Material(1e4, 0.3, "neo_hooke"), supports, (), (drive,), (cavity,))


@pytest.mark.slow
def test_fluid_holds_what_pressure_would_not() -> None:
    """Beyond a balloon's greatest pressure A is indefinite, yet the constrained body is stable."""
    system, found = build(balloon()), {}
    for ratio in (3.0, 5.0):
        stepper = StaticNewton(volume_ratio=ratio, watch=0.0).prepare(system)
        assert isinstance(stepper, NewtonStepper)
        state = stepper.step(stepper.rest(), np.array([1e-6]))
        assert state.failure is None
        at = stepper.problem.balance(
            state.inner.u, state.inner.pressures, state.inner.inputs, np.array([ratio])
        )
        tangent = stepper.problem.tangent(at)
        found[ratio] = (tangent.factor.negative_pivots, tangent.negative)
        assert state.numbers["tangent.negative_pivots"] == tangent.negative
    assert found == {3.0: (0, 0), 5.0: (1, 0)}


def test_bordered_system_is_the_derivative_of_the_balance() -> None:
    """Residual and volumes against central differences in displacements and pressures."""
    system = phantom_system()
    problem = equilibrium(system, True)
    rng = np.random.default_rng(1)
    N, h = system.K.shape[0], 1e-7
    u, v = 1e-4 * rng.normal(size=N), rng.normal(size=N)
    P, dP = np.array([800.0]), np.array([1e6])
    plus = problem.balance(u + h * v, P + h * dP, STILL, np.ones(1))
    minus = problem.balance(u - h * v, P - h * dP, STILL, np.ones(1))
    at = problem.balance(u, P, STILL, np.ones(1))
    x = system.scene.mesh.nodes + u.reshape(-1, 3)
    A = problem.body.tangent(u) - P[0] * volume_hessian(system.cavities[0], x)
    slope = (plus.residual - minus.residual) / (2 * h)
    expected = A @ v - dP @ at.loads
    assert slope == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    volumes = (plus.ratios - minus.ratios) / (2 * h) * problem.rest_volumes
    assert volumes == pytest.approx(at.loads @ v, rel=1e-6)


def test_newton_converges_quadratically() -> None:
    """Full Newton with the right tangent squares the error; a wrong term would show here."""
    system = two_cavity_system()
    problem = equilibrium(system, True)
    target = np.ones(2)
    at = problem.balance(np.zeros(system.K.shape[0]), np.zeros(2), STILL, target)
    at = problem.predicted(at, problem.tangent(at), np.array([0.012]), target)
    at = problem.balance(at.u, at.pressures, STILL, target)
    force, merits = at.acting, []
    for _ in range(5):
        at = problem.correction(at, problem.tangent(at), target)
        at = problem.balance(at.u, at.pressures, STILL, target)
        merits.append(at.merit(force))
    digits = -np.log10(np.maximum(merits, 1e-300))  # the last may be 0 to the bit
    assert merits[-1] < 1e-13
    assert digits[2] > 1.8 * digits[1] > 1.8 * 2
    assert digits[3] > 1.8 * digits[2]


@pytest.mark.parametrize("ratio", [1.0, 0.8, 1.3])
def test_each_fluid_keeps_its_volume(ratio: float) -> None:
    stepper = StaticNewton(volume_ratio=ratio).prepare(two_cavity_system())
    assert isinstance(stepper, NewtonStepper)
    state = stepper.rest()
    for d in (0.0, 0.002, 0.004, 0.0041):
        state = stepper.step(state, np.array([d]))
        assert state.failure is None
        for name in ("left", "right"):
            assert state.numbers[f"{name}.volume_ratio"] == pytest.approx(ratio, abs=1e-10)
    if ratio != 1:
        assert (np.sign(state.inner.pressures) == np.sign(ratio - 1)).any()


def test_two_cavities_of_saint_venant_kirchhoff() -> None:
    state = pressed(prepared(two_cavities("svk")), 0.003)
    assert state.failure is None
    assert (state.inner.pressures > 0).all()


def test_volume_is_kept_however_loose_the_forces_are() -> None:
    settings = StaticNewton(tolerance=0.5)
    state = pressed(prepared(two_cavities(), settings), 0.004)
    assert state.failure is None
    assert state.numbers["left.volume_ratio"] == pytest.approx(1.0, abs=1e-10)
