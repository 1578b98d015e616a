"""The reduced filter: exact on its own linear model, and what it gains where the model is wrong."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from filter_scenes import CENTRE, at_nodes, cube, plain, ramp, run, unmeasured
from filterpy.kalman import KalmanFilter
from scipy.stats import chi2

from validate.arrays import Floats
from validate.errors import ComparisonError, UsageError
from validate.estimate.extended.explicit_filter import explicit_step
from validate.estimate.measurements import Measurements
from validate.estimate.reduced import reduced_ekf
from validate.estimate.reduced.reduced_ekf import ReducedEKF, modes, pod, shapes_covariance
from validate.fem.system import System

# private: _directions: called alone, case by case.

H = 2e-4  # s
SD = 3e-5  # m
PLAIN = 0.966  # mm: the error of the model 25 % too stiff on the small cube, stored


@pytest.fixture(scope="module")
def small() -> System:
    """Twelve free unknowns: all their modes are few."""
    return cube((1, 1, 1))


def every(system: System, node: int, h: float, gap: int, z: Floats, sd: float) -> Measurements:
    t = h * gap * np.arange(1, len(z) + 1)
    return at_nodes(system, [node], t, z, sd)


@pytest.mark.parametrize("basis", ["modes", "pod"])
def test_shapes_are_orthonormal_and_uncouple_the_stiffness(basis: str) -> None:
    system = cube()
    steps = explicit_step(system, H, 1)
    found = modes(system, 6) if basis == "modes" else pod(steps, 6, 5.0)
    Phi = found.Phi
    assert Phi.T @ (system.masses[:, None] * Phi) == pytest.approx(np.eye(6), abs=1e-10)
    K = Phi.T @ (system.K @ Phi)
    assert np.abs(K - np.diag(found.squares)).max() < 1e-9 * K.max()
    assert np.abs(Phi[system.held]).max() == 0.0
    assert (np.diff(found.squares) > 0).all()


def test_few_modes_are_the_lowest_of_all() -> None:
    """The sparse solver of larger bodies against the dense one."""
    system = cube((5, 5, 6))
    assert len(system.free) > 400
    few = modes(system, 5)
    scale = 1 / np.sqrt(system.masses[system.free])
    K = system.K[system.free][:, system.free].toarray()
    squares = np.linalg.eigvalsh(scale[:, None] * K * scale)[:5]
    assert few.squares == pytest.approx(squares, rel=1e-9)


def test_without_measurements_it_is_the_plain_explicit_run() -> None:
    system = cube(mass_damping=4.0)
    inputs = ramp(H, 60, 3.0, 0.01)
    truth = plain(system, H, inputs)
    found = run(ReducedEKF(H, shapes=6).prepare(system, unmeasured(system)), H, inputs)
    assert found.outcome.state == "invalid"
    assert np.abs(found.u.reshape(60, -1) - truth).max() < 1e-12 * np.abs(truth).max()


@pytest.mark.parametrize("noise", ["white", "load"])
def test_with_all_modes_it_is_the_kalman_filter_of_the_linear_body(
    small: System, noise: Any
) -> None:
    """filterpy's dense filter over (U_t, U_{t-h}, bias) of all unknowns, at tiny displacements."""
    settings = ReducedEKF(H, shapes=12, noise=noise, load_walk=1e-5, load_sd=1e-6, process=1e-9)
    z = 1e-8 * np.random.default_rng(5).normal(size=(8, 3))
    node = int(small.free[0]) // 3
    measured = every(small, node, H, 5, z, 1e-9)
    inputs = ramp(H, 40, 1e-5, 0.004)
    found = run(settings.prepare(small, measured), H, inputs)
    u, sd, nis = _by_filterpy(small, settings, measured, inputs)
    assert found.sd is not None
    scale = np.abs(u).max()
    assert np.abs(found.u[:, small.free[::3] // 3].reshape(40, 12) - u).max() < 1e-6 * scale
    assert np.abs(found.sd[:, small.free[::3] // 3].reshape(40, 12) - sd).max() < 1e-9 * sd.max()
    assert found.traces["nis"].y[4::5] == pytest.approx(nis, rel=1e-5)


def _by_filterpy(
    system: System, settings: ReducedEKF, measured: Measurements, inputs: Floats
) -> tuple[Floats, Floats, Floats]:
    """Displacements and their sd (steps, 12) m of the free unknowns, NIS of the updates."""
    free = system.free
    n, over = len(free), H * H / system.masses[free]
    K, f = system.K[free][:, free].toarray(), system.loads[free, 0]
    steps = explicit_step(system, H, 1)
    Q = shapes_covariance(settings, steps, modes(system, n), measured).Q
    Phi = modes(system, n).Phi[free]
    kf = KalmanFilter(2 * n + 1, 3)
    kf.F = np.eye(2 * n + 1)
    kf.F[:n, :n], kf.F[:n, n : 2 * n] = 2 * np.eye(n) - over[:, None] * K, -np.eye(n)
    kf.F[:n, -1], kf.F[n : 2 * n, :n] = over * f, np.eye(n)
    kf.F[n : 2 * n, n : 2 * n] = 0
    kf.Q = np.zeros_like(kf.F)
    kf.Q[:n, :n], kf.Q[-1, -1] = Phi @ Q[:n, :n] @ Phi.T, Q[-1, -1]
    kf.P = np.zeros_like(kf.F)
    kf.P[-1, -1] = settings.load_sd**2
    kf.H = np.hstack([measured.H[:, free].toarray(), np.zeros((3, n + 1))])
    kf.R, kf.B = np.diag(measured.sd**2), np.concatenate([over * f, np.zeros(n + 1)])[:, None]
    us, sds, nis, last = [], [], [], 0.0
    for k, value in enumerate(inputs[:, 0]):
        kf.predict(u=np.array([[last]]))
        last = float(value)
        if (k + 1) % 5 == 0:
            kf.update(measured.z[(k + 1) // 5 - 1][:, None])
            nis.append((kf.y.T @ kf.SI @ kf.y).item())
        us.append(kf.x[:n, 0])
        sds.append(np.sqrt(np.diag(kf.P)[:n]))
    return np.array(us), np.array(sds), np.array(nis)


def test_what_a_second_adds_is_as_declared_whatever_the_step(small: System) -> None:
    """Rms displacements by mass (1000 kg/m3 of a 0.1 m cube is 1 kg) and newtons, by hand."""
    seen = unmeasured(small)
    for noise, walk in (("white", 4.0 * np.eye(12)), ("load", None)):
        settings = ReducedEKF(H, shapes=12, noise=noise, load_walk=3.0, load_sd=7.0, process=2.0)  # type: ignore[arg-type]
        for parts in (1, 3):
            steps = explicit_step(small, H, parts)
            claim = shapes_covariance(settings, steps, modes(small, 12), seen)
            second = claim.Q * parts / H
            assert second[-1, -1] == pytest.approx(9.0)
            assert claim.P0[-1, -1] == pytest.approx(49.0)
            assert np.trace(second[:12, :12]) == pytest.approx(4.0 if walk is None else 48.0)
            assert walk is None or second[:12, :12] == pytest.approx(walk)
            assert not claim.Q[12:24, :].any()


@pytest.mark.slow
def test_on_truths_of_its_own_model_it_is_consistent(small: System) -> None:
    """NIS over 30 seeds x 30 measurements within the 99.9 % band of chi-square, and NEES."""
    settings = ReducedEKF(H, shapes=12, load_walk=1e-5, load_sd=1e-6, process=1e-8)
    node, nis, nees = int(small.free[0]) // 3, 0.0, 0.0
    for seed in range(30):
        truth, z = _drawn(small, settings, node, np.random.default_rng(seed))
        stepper = settings.prepare(small, every(small, node, H, 5, z, 1e-9))
        found = run(stepper, H, np.zeros((150, 1)))
        nis += found.traces["nis"].y.sum()
        assert found.traces["nis.dof"].y.sum() == 90
        assert found.sd is not None
        e = (found.u[-1] - truth).ravel()[small.free] / found.sd[-1].ravel()[small.free]
        nees += float(e @ e)
    low, high = chi2.ppf([0.0005, 0.9995], 30 * 90)
    assert low < nis < high
    assert 0.6 < nees / (30 * 12) < 1.5  # components are correlated: no chi-square, but near 1


def _drawn(
    system: System, settings: ReducedEKF, node: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """A truth of the reduced model: the last field (n, 3) m, measurements (30, 3) m."""
    blank = every(system, node, H, 5, np.zeros((30, 3)), 1e-9)
    steps = explicit_step(system, H, 1)
    basis = modes(system, 12)
    model = shapes_covariance(settings, steps, basis, blank)
    root = np.linalg.cholesky(model.Q + 1e-40 * np.eye(25))
    x, z = np.sqrt(np.diag(model.P0)) * rng.normal(size=25), []
    for k in range(150):
        x = model.A @ x + root @ rng.normal(size=25)
        if (k + 1) % 5 == 0:
            z.append(model.H @ x + 1e-9 * rng.normal(size=3))
    return (basis.Phi @ x[:12]).reshape(-1, 3), np.array(z)


@pytest.fixture(scope="module")
def wrong_model() -> tuple[System, Floats, Measurements, Floats]:
    """The filter's body, 25 % too stiff; every 25th field of the truth (k, n, 3); A at 200 Hz;
    inputs."""
    return _wrong((3, 3, 4), ramp(H, 1750, 12.0, 0.2))


def _wrong(
    cells: tuple[int, int, int], inputs: Floats
) -> tuple[System, Floats, Measurements, Floats]:
    true, stiff = cube(cells), cube(cells, E=1.25 * 30e3)
    u = run(ReducedEKF(H, shapes=1).prepare(true, unmeasured(true)), H, inputs, 25).u
    node = true.scene.mesh.nearest_node(np.array(CENTRE))
    z = u[:, node] + SD * np.random.default_rng(0).normal(size=(len(u), 3))
    return stiff, u, every(stiff, node, H, 25, z, SD), inputs


def error(u: Floats, truth: Floats) -> float:
    """rms over nodes and steps of the distance, mm."""
    return 1e3 * float(np.sqrt(((u - truth) ** 2).sum(axis=2).mean()))


FORMS = {
    "modes": ReducedEKF(H),
    "modes steady": ReducedEKF(H, gains="steady"),
    "pod": ReducedEKF(H, basis="pod", shapes=5, snapshot_load=12.0),
    "pod steady": ReducedEKF(H, basis="pod", shapes=5, snapshot_load=12.0, gains="steady"),
    "rank 1": ReducedEKF(H, noise="load", process=1e-5),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_one_measured_node_corrects_the_whole_field_of_a_wrong_model(
    wrong_model: tuple[System, Floats, Measurements, Floats], form: str
) -> None:
    """E 25 % too stiff, one node at 200 Hz: at least an eighth of the error,
    at all nodes, and a bias of a quarter of the load."""
    stiff, truth, measured, inputs = wrong_model
    settings = FORMS[form]
    alone = replace(settings, gains="sequence").prepare(stiff, unmeasured(stiff))
    blind = run(alone, H, inputs, 25)
    seen = run(settings.prepare(stiff, measured), H, inputs, 25)
    assert error(blind.u, truth) == pytest.approx(PLAIN, abs=0.02)
    assert error(seen.u, truth) < error(blind.u, truth) / 8
    far = [stiff.scene.mesh.nearest_node(np.array([0.1, 0.1, 0.1]))]
    assert error(seen.u[:, far], truth[:, far]) < error(blind.u[:, far], truth[:, far]) / 6
    assert seen.traces["push.bias"].y[-1] == pytest.approx(3.0, abs=1.0)
    per_dof = seen.traces["nis"].y.sum() / seen.traces["nis.dof"].y.sum()
    assert per_dof < 3


def test_the_steady_gain_is_what_the_recursion_settles_to() -> None:
    system = cube(mass_damping=10.0)
    node = system.scene.mesh.nearest_node(np.array(CENTRE))
    measured = every(system, node, H, 25, np.zeros((200, 3)), SD)
    inputs, settings = np.zeros((5000, 1)), ReducedEKF(H, shapes=6)
    both = [
        run(replace(settings, gains=gains).prepare(system, measured), H, inputs, 25)
        for gains in ("sequence", "steady")
    ]
    assert both[0].sd is not None
    assert both[1].sd is not None
    assert both[0].sd[-1] == pytest.approx(both[1].sd[-1], rel=1e-5, abs=1e-12)
    assert np.abs(both[0].sd[1] - both[1].sd[1]).max() > 1e-6


def test_missing_late_and_partial_measurements_are_steps_of_the_prediction() -> None:
    """NaN rows change nothing; one component alone counts one degree of freedom."""
    system = cube()
    node = system.scene.mesh.nearest_node(np.array(CENTRE))
    z = np.full((8, 3), np.nan)
    z[2], z[6, 1] = 1e-4, -1e-4
    inputs = ramp(H, 40, 3.0, 0.01)
    settings = ReducedEKF(H, shapes=6)
    gaps = run(settings.prepare(system, every(system, node, H, 5, z, SD)), H, inputs)
    t = H * np.array([15, 35])
    two = run(settings.prepare(system, at_nodes(system, [node], t, z[[2, 6]], SD)), H, inputs)
    assert np.array_equal(gaps.u, two.u)
    assert gaps.traces["nis.dof"].y[[14, 34]].tolist() == [3.0, 1.0]
    assert gaps.traces["nis.dof"].y.sum() == 4
    assert gaps.traces[f"innovation.n{node}.x"].y[34] == 0.0


def test_substeps_of_the_reduced_filter_are_steps() -> None:
    system = cube()
    node = system.scene.mesh.nearest_node(np.array(CENTRE))
    inputs = ramp(H, 60, 3.0, 1.0)
    measured = every(system, node, H, 5, np.full((12, 3), 1e-4), SD)
    settings = ReducedEKF(H, shapes=6)
    single = run(settings.prepare(system, measured), H, inputs)
    parts = replace(settings, dt=10 * H, substeps=10).prepare(system, measured)
    grouped = run(parts, 10 * H, inputs[9::10])
    assert grouped.u == pytest.approx(single.u[9::10], rel=1e-9, abs=1e-14)
    assert grouped.sd is not None
    assert single.sd is not None
    assert grouped.sd == pytest.approx(single.sd[9::10], rel=1e-9, abs=1e-14)
    assert grouped.traces["nis.dof"].y.tolist() == [6.0] * 6


def test_between_measurements_the_claim_widens(
    wrong_model: tuple[System, Floats, Measurements, Floats],
) -> None:
    stiff, _, measured, inputs = wrong_model
    found = run(ReducedEKF(H).prepare(stiff, measured), H, inputs[:326])
    assert found.sd is not None
    node = stiff.scene.mesh.nearest_node(np.array(CENTRE))
    x = found.sd[:, node, 0]
    assert x[299] < 0.9 * x[298]
    assert x[323] > 1.2 * x[299]


def test_what_has_no_reduced_filter_is_refused_in_words(small: System) -> None:
    measured = every(small, int(small.free[0]) // 3, H, 5, np.zeros((4, 3)), SD)
    with pytest.raises(UsageError, match="13 modes of a body with 12"):
        ReducedEKF(H, shapes=13).prepare(small, measured)
    with pytest.raises(ComparisonError, match="no steady gain"):
        ReducedEKF(H, shapes=6, gains="steady", process=0.0, load_walk=0.0).prepare(small, measured)
    with pytest.raises(UsageError, match="standard deviations"):
        ReducedEKF(H, process=-1.0)
    with pytest.raises(UsageError, match="POD basis needs a load"):
        ReducedEKF(H, basis="pod", shapes=61).prepare(small, measured)
    refused = run(
        ReducedEKF(5e-3, shapes=6).prepare(small, unmeasured(small)), 5e-3, np.ones((3, 1))
    )
    assert (refused.outcome.state, refused.outcome.step) == ("refused", 0)
    with pytest.raises(UsageError, match="take fewer shapes or smaller steps"):
        ReducedEKF(1e-2, shapes=12, beyond_limit="run").prepare(small, unmeasured(small))
    wild = ReducedEKF(5e-3, shapes=6, beyond_limit="run").prepare(small, unmeasured(small))
    assert run(wild, 5e-3, np.ones((300, 1))).outcome.state == "diverged"


@pytest.mark.slow
def test_the_table_of_the_science_note_at_3840_tetrahedra() -> None:
    """Plain field error 1.0 mm; a POD of 5 below .06, 20 modes below .15 (large displacements)."""
    stiff, truth, measured, inputs = _wrong((8, 8, 10), ramp(H, 3000, 11.0, 0.3))
    blind = run(FORMS["modes"].prepare(stiff, unmeasured(stiff)), H, inputs, 25)
    assert error(blind.u, truth) == pytest.approx(1.2, abs=0.3)
    for form, limit in (("pod", 0.06), ("pod steady", 0.06), ("modes", 0.15)):
        seen = run(FORMS[form].prepare(stiff, measured), H, inputs, 25)
        assert error(seen.u, truth) < limit


def test_noise_of_loads_that_move_no_shape_and_steps_that_are_none() -> None:
    still = SimpleNamespace(
        masses=np.ones(6), loads=np.zeros((6, 1)),
        scene=SimpleNamespace(mesh=SimpleNamespace(dimension=3)),
    )  # fmt: skip
    basis = SimpleNamespace(Phi=np.eye(6)[:, :2], squares=np.ones(2))
    white = reduced_ekf._directions(ReducedEKF(dt=1e-3), still, basis)  # type: ignore[arg-type]
    assert white.tolist() == [[2.0, 0.0], [0.0, 2.0]]
    with pytest.raises(UsageError, match="noise='load' needs"):
        reduced_ekf._directions(ReducedEKF(dt=1e-3, noise="load"), still, basis)  # type: ignore[arg-type]
    for wrong in ({"dt": 0.0}, {"dt": 1e-3, "substeps": 0}):
        with pytest.raises(UsageError, match=r"dt .* in . substeps: .* positive"):
            ReducedEKF(**wrong)  # type: ignore[arg-type]
