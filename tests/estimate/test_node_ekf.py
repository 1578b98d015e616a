"""The node-level filter of paper 003: exact truths of its scalar recursion, and where it fails."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filter_scenes import CENTRE, at_nodes, cube, plain, ramp, run, unmeasured
from filterpy.kalman import ExtendedKalmanFilter

from validate.arrays import Floats
from validate.errors import ComparisonError, SceneError, UsageError
from validate.estimate.extended.kernels import HUGE, clip
from validate.estimate.extended.node_ekf import NodeEKF
from validate.estimate.measurements import Measurements
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import System, build
from validate.scene.scene import Drive, Support

H = 4e-4  # s, half the critical step of the meshes here
SD = np.sqrt(1e-9)  # m: the paper's .001, read as mm^2
BLOCKS = ("component", "node", "companion")


@pytest.fixture(scope="module")
def system() -> System:
    return cube()


def node_a(system: System) -> int:
    return system.scene.mesh.nearest_node(np.array(CENTRE))


def noisy(system: System, truth: Floats, nodes: list[int], every: int = 1) -> Measurements:
    """Displacements of nodes with noise at every `every`-th step of a truth (steps, N)."""
    steps = np.arange(every - 1, len(truth), every)
    dofs = (3 * np.array(nodes)[:, None] + np.arange(3)).ravel()
    z = truth[steps][:, dofs] + SD * np.random.default_rng(3).normal(size=(len(steps), len(dofs)))
    return at_nodes(system, nodes, H * (steps + 1), z, SD)


@pytest.mark.parametrize("block", BLOCKS)
def test_without_noise_and_trust_it_is_the_plain_explicit_run(block: Any) -> None:
    """Also with mass damping, and with the numpy body as the reference of the compiled one."""
    system = cube(mass_damping=4.0)
    inputs = ramp(H, 60, 3.0, 0.01)
    truth = plain(system, H, inputs)
    measured = noisy(system, 2 * truth, [node_a(system)])
    settings = NodeEKF(H, P0=0.0, Qp=0.0, Qm=1e300, block=block)
    found = run(settings.prepare(system, measured), H, inputs)
    assert found.finished
    assert np.abs(truth).max() > 1e-4
    scale = np.abs(truth).max()
    assert np.abs(found.u.reshape(60, -1) - truth).max() < 1e-12 * scale
    assert found.sd is not None
    assert found.sd.max() == 0.0


@pytest.mark.parametrize(("block", "width"), [("component", 1), ("node", 3)])
def test_filterpy_node_by_node_on_a_cube_of_eight_nodes(block: Any, width: int) -> None:
    """filterpy's extended filters, one for each node or component, as the oracle."""
    system = cube((1, 1, 1))
    inputs = ramp(H, 40, 2.0, 0.01)
    nodes = sorted({int(i) // 3 for i in system.free})
    truth = 1.1 * plain(system, H, inputs)
    measured = noisy(system, truth, nodes)
    settings = NodeEKF(H, block=block, covariance="joseph")
    found = run(settings.prepare(system, measured), H, inputs)
    assert found.sd is not None
    u, P = _by_filterpy(system, measured, inputs, width)
    scale = np.abs(u).max()
    assert np.abs(found.u.reshape(len(inputs), -1) - u).max() < 3e-15 * max(scale, 1.0)
    assert np.abs(found.u.reshape(len(inputs), -1) - u).max() < 1e-12 * scale
    assert np.abs(found.sd.reshape(len(inputs), -1) ** 2 - P).max() < 1e-12 * P.max()


def _by_filterpy(
    system: System, measured: Measurements, inputs: Floats, width: int
) -> tuple[Floats, Floats]:
    """Displacements and variances (steps, N) of separate filters of `width` components."""
    body, settings = Body(system.scene), NodeEKF(H)
    groups = system.free.reshape(-1, width)
    filters = []
    for _ in groups:
        ekf = ExtendedKalmanFilter(width, width)
        ekf.x, ekf.P = np.zeros(width), settings.P0 * np.eye(width)
        ekf.Q, ekf.R = settings.Qp * np.eye(width), settings.Qm * np.eye(width)
        filters.append(ekf)
    u, before = np.zeros(len(system.moves)), np.zeros(len(system.moves))
    us, Ps, last = [], [], np.zeros(1)
    place = {int(dof): m for m, dof in enumerate(measured.H.indices)}
    for z, inputs_now in zip(measured.z, inputs, strict=True):
        R, K = body.force(u), body.tangent(u).toarray()
        forces, new = system.loads @ last, np.zeros_like(u)
        variances = np.zeros_like(u)
        for group, ekf in zip(groups, filters, strict=True):
            c = H * H / system.masses[group]
            prior = 2 * u[group] - c * R[group] + c * forces[group] - before[group]
            ekf.F = 2 * np.eye(width) - c[:, None] * K[np.ix_(group, group)]
            ekf.predict_x = lambda _, ekf=ekf, prior=prior: setattr(ekf, "x", prior)
            ekf.predict()
            seen = np.array([z[place[int(dof)]] for dof in group])
            ekf.update(seen, lambda x: np.eye(len(x)), lambda x: x)
            new[group], variances[group] = ekf.x, np.diag(ekf.P)
        u, before, last = new, u, inputs_now
        us.append(u)
        Ps.append(variances)
    return np.array(us), np.array(Ps)


@pytest.mark.slow
@pytest.mark.parametrize("block", ["component", "node", "companion"])
def test_forces_of_single_precision_leave_six_digits(system: System, block: Any) -> None:
    """Covariances are doubles whatever the forces are."""
    inputs = ramp(H, 60, 0.5, 0.02)
    seen = noisy(system, plain(system, H, inputs), [node_a(system)])
    single, double = (
        run(NodeEKF(H, block=block, precision=p).prepare(system, seen), H, inputs)
        for p in ("single", "double")
    )
    assert single.sd is not None
    assert double.sd is not None
    assert single.sd.dtype == np.float64
    assert 0 < np.abs(single.u - double.u).max() < 1e-6 * np.abs(double.u).max()
    assert np.abs(single.sd - double.sd).max() < 1e-5 * double.sd.max()


@pytest.mark.parametrize("block", ["component", "node"])
def test_the_printed_gain_at_the_measured_node_is_99_percent(system: System, block: Any) -> None:
    """P = K R after an update: .990 leaves 99 % of the noise in."""
    inputs = ramp(H, 120, 0.5, 0.04)
    truth = plain(system, H, inputs)
    a = node_a(system)
    found = run(NodeEKF(H, block=block).prepare(system, noisy(system, truth, [a])), H, inputs)
    assert found.sd is not None
    assert found.sd[40:, a] ** 2 / 1e-9 == pytest.approx(0.990, abs=6e-4)
    rms = np.sqrt(((found.u[:, a] - truth[:, 3 * a : 3 * a + 3]) ** 2).mean())
    assert rms == pytest.approx(0.99 * SD, rel=0.08)  # 360 readings: 4 % is one sigma


def test_without_process_noise_the_gain_cannot_fall_below_1_minus_1_over_a2(
    system: System,
) -> None:
    """The scalar Riccati equation P = a^2 P R/(a^2 P + R) has the fixed point K = 1 - 1/a^2."""
    nodes = sorted({int(i) // 3 for i in system.free})
    a = 2 - H * H * system.K.diagonal() / system.masses
    still = at_nodes(system, nodes, H * np.arange(1, 401), np.zeros((400, 3 * len(nodes))), SD)
    found = run(NodeEKF(H, Qp=0.0).prepare(system, still), H, np.zeros((400, 1)))
    assert found.sd is not None
    gains = found.sd[-1].ravel() ** 2 / 1e-9
    fast = np.abs(a) > 1.05  # those near 1 settle slowly
    fast[system.held] = False
    assert fast.sum() > 20
    assert gains[fast] == pytest.approx(1 - 1 / a[fast] ** 2, rel=1e-9)


def test_variances_grow_like_a_to_the_2k_where_nothing_is_measured(system: System) -> None:
    a = 2 - H * H * system.K.diagonal() / system.masses
    inputs = np.zeros((40, 1))
    found = run(NodeEKF(H, Qp=0.0).prepare(system, unmeasured(system)), H, inputs)
    assert found.sd is not None
    free = system.free
    assert found.sd[-1].ravel()[free] ** 2 == pytest.approx(1e-9 * a[free] ** 80, rel=1e-9)
    assert np.abs(a[free]).max() > 1.5


@pytest.mark.parametrize("block", ["component", "node"])
def test_overflow_of_the_covariance_is_an_outcome_and_never_a_nan(
    system: System, block: Any
) -> None:
    """At 1e300 m^2, by the step between steps 500 and 620; "hold" goes on with the same field."""
    inputs = ramp(H, 700, 0.5, 0.1)
    settings = NodeEKF(H, block=block)
    stopped = run(settings.prepare(system, unmeasured(system)), H, inputs)
    assert stopped.outcome.state == "diverged"
    assert 500 <= stopped.outcome.step <= 620
    assert "a^(2k)" in stopped.outcome.why
    held = run(replace(settings, overflow="hold").prepare(system, unmeasured(system)), H, inputs)
    assert held.outcome.state == "invalid"  # nothing was measured
    assert held.outcome.step == 700
    assert held.traces["covariance.held"].y[500] == 0
    assert held.traces["covariance.held"].y[-1] > 0
    assert np.array_equal(held.u[: len(stopped.u)], stopped.u)


def test_the_companion_form_keeps_variances_small(system: System) -> None:
    """Of (U_t, U_{t-dt}) together they grow like a polynomial: both roots lie on the circle."""
    inputs = np.zeros((2000, 1))
    settings = NodeEKF(H, block="companion")
    found = run(settings.prepare(system, unmeasured(system)), H, inputs)
    assert found.outcome.step == 2000
    assert found.sd is not None
    squares = found.sd.reshape(2000, -1).max(axis=1) ** 2
    assert squares[-1] < 1e-2  # m^2, where the printed form passes 1e300
    assert squares[-1] / squares[499] < 4.5**3


@pytest.mark.parametrize("block", BLOCKS)
def test_a_late_first_measurement_leaves_nothing_of_the_printed_covariance(
    system: System, block: Any
) -> None:
    """P - K H P is 0 where P >> R; Joseph's form leaves R."""
    h, late = H, 60
    a = node_a(system)
    start = 1e12 if block == "companion" else 1e-9  # that one grows slowly
    measured = at_nodes(system, [a], np.array([late * h]), np.zeros((1, 3)), SD)
    for covariance, left in (("printed", 0.0), ("joseph", 1e-9)):
        settings = NodeEKF(h, P0=start, Qp=0.0, block=block, covariance=covariance)  # type: ignore[arg-type]
        found = run(settings.prepare(system, measured), h, np.zeros((late, 1)))
        assert found.sd is not None
        assert found.sd[late - 2, a].min() > 1e3
        assert found.sd[-1, a] ** 2 == pytest.approx(left, rel=1e-6, abs=1e-20)


@pytest.mark.parametrize("every", [3, 4, 5])
def test_measured_every_few_steps_it_diverges_unless_both_states_are_corrected(
    system: System, every: int
) -> None:
    """Correcting U_t alone is a kick of y/dt at every measurement."""
    inputs = ramp(H, 500, 0.5, 0.1)
    truth = plain(system, H, inputs)
    measured = noisy(system, truth, [node_a(system)], every)
    settings = NodeEKF(H, overflow="hold")
    printed = run(settings.prepare(system, measured), H, inputs)
    assert printed.outcome.state == "diverged"
    assert "body of 0.1 m" in printed.outcome.why
    both = run(replace(settings, correct_previous=True).prepare(system, measured), H, inputs)
    assert both.finished
    a = node_a(system)
    assert np.abs(both.u[:, a] - truth[:, 3 * a : 3 * a + 3]).max() < 5 * SD


@pytest.mark.parametrize("block", BLOCKS)
def test_no_information_reaches_other_nodes(system: System, block: Any) -> None:
    """One update moves the measured node only, and leaves every other covariance as it was."""
    inputs = ramp(H, 8, 0.5, 0.01)
    a = node_a(system)
    far = at_nodes(system, [a], np.array([8 * H]), np.full((1, 3), 1e-3), SD)
    settings = NodeEKF(H, block=block)
    seen, blind = (run(settings.prepare(system, m), H, inputs) for m in (far, unmeasured(system)))
    others = np.arange(len(system.scene.mesh.nodes)) != a
    assert seen.sd is not None
    assert blind.sd is not None
    assert np.array_equal(seen.u[-1, others], blind.u[-1, others])
    assert np.array_equal(seen.sd[-1, others], blind.sd[-1, others])
    assert seen.u[-1, a] == pytest.approx(1e-3, rel=0.02)
    assert seen.sd[-1, a].max() < 0.1 * blind.sd[-1, a].min()


def test_innovations_and_nis_are_those_of_the_prior(system: System) -> None:
    """NIS = y^2/S over what was seen; a missing component counts nothing."""
    a = node_a(system)
    z = np.array([[1e-4, np.nan, -2e-4]])
    measured = at_nodes(system, [a], np.array([H]), z, SD)
    traces = run(NodeEKF(H).prepare(system, measured), H, np.zeros((2, 1))).traces
    growth = (2 - H * H * system.K.diagonal() / system.masses)[3 * a : 3 * a + 3] ** 2
    S = growth * 1e-9 + 1e-7 + 1e-9
    assert traces["nis.dof"].y.tolist() == [2.0, 0.0]
    assert traces["nis"].y[0] == pytest.approx(1e-8 / S[0] + 4e-8 / S[2])
    assert traces[f"innovation.n{a}.z"].y.tolist() == [-2e-4, 0.0]
    assert traces[f"innovation.n{a}.z.sd"].y[0] == pytest.approx(np.sqrt(S[2]))
    assert traces[f"innovation.n{a}.y.sd"].y.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("block", BLOCKS)
def test_substeps_are_steps(system: System, block: Any) -> None:
    """Inputs linear in time: 4 substeps give every 4th of the single steps, updates included."""
    inputs = ramp(H, 40, 2.0, 1.0)
    truth = plain(system, H, inputs)
    measured = noisy(system, truth, [node_a(system)])
    settings = NodeEKF(H, block=block)
    single = run(settings.prepare(system, measured), H, inputs)
    parts = replace(settings, dt=4 * H, substeps=4).prepare(system, measured)
    grouped = run(parts, 4 * H, inputs[3::4])
    assert grouped.u == pytest.approx(single.u[3::4], rel=1e-9, abs=1e-15)
    assert grouped.traces["nis.dof"].y.tolist() == [12.0] * 10
    assert grouped.traces["nis"].y.sum() == pytest.approx(single.traces["nis"].y.sum(), rel=1e-9)


def test_a_driven_plate_moves_as_it_is_told(system: System) -> None:
    scene = system.scene
    held = (Support("z0", (0, 1, 2)), Support("z1", (0, 1)))
    driven = build(
        replace(scene, supports=held, drives=(Drive("plate", "z1", (0.0, 0.0, -1.0)),), loads=())
    )
    inputs = np.linspace(0, 1e-3, 51)[1:, None]
    found = run(NodeEKF(H).prepare(driven, unmeasured(driven)), H, inputs)
    top = scene.mesh.facet_nodes("z1")
    assert found.u[:, top, 2] == pytest.approx(np.repeat(-inputs, len(top), axis=1), rel=1e-12)
    assert found.sd is not None
    assert np.abs(found.sd[:, top]).max() == 0.0
    assert np.abs(found.u[-1]).max() < 2e-3


def test_a_step_above_the_critical_one_is_refused_with_its_ratio(system: System) -> None:
    inputs = ramp(2e-3, 100, 0.5, 0.1)
    refused = run(NodeEKF(2e-3).prepare(system, unmeasured(system)), 2e-3, inputs)
    assert (refused.outcome.state, refused.outcome.step) == ("refused", 0)
    assert "times the critical step" in refused.outcome.why
    settings = NodeEKF(2e-3, beyond_limit="run", overflow="hold")
    diverged = run(settings.prepare(system, unmeasured(system)), 2e-3, inputs)
    assert diverged.outcome.state == "diverged"
    assert diverged.outcome.step < 60


def test_what_it_cannot_filter_is_refused_in_words(system: System) -> None:
    measured = unmeasured(system)
    mixed = replace(measured, H=0.5 * measured.H)
    with pytest.raises(ComparisonError, match="is not a component of a node"):
        NodeEKF(H).prepare(system, mixed)
    damped = replace(system.scene.material, stiffness_damping=1e-3)
    with pytest.raises(SceneError, match="couples the nodes"):
        NodeEKF(H).prepare(build(replace(system.scene, material=damped)), measured)
    with pytest.raises(UsageError, match="both must be positive"):
        NodeEKF(0.0)
    with pytest.raises(UsageError, match="P0 and Qp must be >= 0"):
        NodeEKF(H, Qm=0.0)


@pytest.mark.parametrize("rows", [1, 3, 6])
def test_a_held_covariance_keeps_its_shape_and_leaves_no_nan(rows: int) -> None:
    P = np.full((rows, 4), 1.0)
    P[:, 1], P[:, 2], P[0, 3] = 4e302, np.inf, np.nan
    assert clip(P) == 3
    assert np.array_equal(P[:, 0], np.ones(rows))
    assert np.array_equal(P[:, 1], np.full(rows, HUGE))
    variances = {1: [0], 3: [0, 2], 6: [0, 1, 2]}[rows]
    assert np.array_equal(P[variances, 2], np.full(len(variances), HUGE))
    assert np.isfinite(P).all()
