"""Smoothing against filterpy, against the posterior of all looks at once, and on draws of its own
model; then through every filter that has it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filter_scenes import CENTRE, at_nodes, cube, plain, ramp, run
from filterpy.kalman import KalmanFilter

from validate.arrays import Floats
from validate.errors import UsageError
from validate.estimate.consistency import nees_consistency
from validate.estimate.extended.explicit_filter import ExplicitFilterStepper
from validate.estimate.filterpy.filters import FilterpyFilter
from validate.estimate.filters import FILTERS, Filter
from validate.estimate.kalman.covariance import Dense
from validate.estimate.kalman.kf_fem import KfFem
from validate.estimate.kalman.modal_kf import ModalKf
from validate.estimate.reduced.load_scale import LoadScale, ScaleCore
from validate.estimate.reduced.reduced_ekf import ReducedEKF, ShapesCore
from validate.estimate.reduced.reduced_kf import (
    LoadDoubt,
    ReducedKf,
    dense_covariance,
    reduced_model,
)
from validate.estimate.smoother import Look, Note, Smoothed, smoothed
from validate.testing.pulled_cube import DT, PulledCase, case

LINEAR: tuple[Any, ...] = (
    KfFem(),
    KfFem(gains="every_step"),
    KfFem(structure="load"),
    ModalKf(),
    ModalKf(gains="shared", recursion="posterior"),
    ReducedKf(),
    ReducedKf(load_start=0.0, load_jitter=0.02),
    LoadScale(),
    LoadScale(walk=0.3, Q=1e-12),
    FilterpyFilter(),
)


@pytest.fixture(scope="module")
def pulled() -> PulledCase:
    return case()


def small(rng: np.random.Generator, n: int = 5, m: int = 2, rank: int | None = None) -> Dense:
    """A stable system whose noise and start may be singular."""
    r = rank or n
    A = np.linalg.qr(rng.normal(size=(n, n)))[0] * 0.97
    B, C = rng.normal(size=(n, r)), rng.normal(size=(n, r))
    return Dense(A, 0.1 * B @ B.T, rng.normal(size=(m, n)), np.full(m, 0.3), C @ C.T)


def filtered(model: Dense, z: Floats) -> tuple[list[Note], Floats, list[Floats]]:
    """Notes, means (steps, n) and covariances of a filter that starts at zero."""
    claim, x = model.start(), np.zeros(len(model.A))
    notes, means, covariances = [], [], []
    for row in z:
        claim, x, look = model.predict(claim), model.A @ x, None
        seen = np.isfinite(row)
        if seen.any():
            gain, claim = model.update(claim, tuple(seen.tolist()))
            look = Look(gain, (row - model.H @ x)[seen])
            x = x + gain.G @ look.y
        notes.append(Note(look, framed=True))
        means.append(x)
        covariances.append(claim.P)
    return notes, np.array(means), covariances


def covariance_of(found: Smoothed, P: Floats, step: int) -> Floats:
    PW = P @ found.roots[step]
    return np.asarray(P - PW @ PW.T)


def posterior(model: Dense, z: Floats) -> tuple[Floats, Floats]:
    """Mean (steps, n) and covariances (steps, n, n) of all states given all looks at once: the
    normal distribution of the whole path, conditioned."""
    N, n = len(z), len(model.A)
    S, P = np.zeros((N, n, N, n)), model.P0
    for k in range(N):
        P = model.A @ P @ model.A.T + model.Q
        reach = np.eye(n)
        for j in range(k, N):
            S[j, :, k], S[k, :, j] = reach @ P, (reach @ P).T
            reach = model.A @ reach
    joint, seen = S.reshape(N * n, N * n), np.isfinite(z).ravel()
    H = np.kron(np.eye(N), model.H)[seen]
    R = np.tile(model.R, N)[seen]
    gain = np.linalg.solve(H @ joint @ H.T + np.diag(R), H @ joint).T
    after = (joint - gain @ H @ joint).reshape(N, n, N, n)
    mean = gain @ z.ravel()[seen]
    return mean.reshape(N, n), np.array([after[k, :, k] for k in range(N)])


def gappy(rng: np.random.Generator, steps: int, m: int) -> Floats:
    z = rng.normal(size=(steps, m))
    z[::4] = np.nan
    z[5, 0] = np.nan
    return np.asarray(z)


def test_it_is_filterpys() -> None:
    rng = np.random.default_rng(2)
    model = small(rng)
    z = gappy(rng, 30, 2)
    notes, means, covariances = filtered(model, z)
    found = smoothed(model, notes)
    kf = KalmanFilter(5, 2)
    kf.F, kf.Q, kf.H, kf.R = model.A, model.Q, model.H, np.diag(model.R)
    xs, Ps, _, _ = kf.rts_smoother(means, np.array(covariances))
    assert means + found.corrections == pytest.approx(xs, rel=1e-9, abs=1e-11)
    for k, P in enumerate(covariances):
        assert covariance_of(found, P, k + 1) == pytest.approx(Ps[k], rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("rank", [None, 2])
def test_it_is_the_posterior_of_all_looks(rank: int | None) -> None:
    """Also with noise and start of rank 2 of 5, where P has no inverse."""
    rng = np.random.default_rng(3)
    model = small(rng, rank=rank)
    z = gappy(rng, 25, 2)
    notes, means, covariances = filtered(model, z)
    found = smoothed(model, notes)
    mean, P = posterior(model, z)
    assert means + found.corrections == pytest.approx(mean, rel=1e-8, abs=1e-10)
    for k, claimed in enumerate(covariances):
        assert covariance_of(found, claimed, k + 1) == pytest.approx(P[k], rel=1e-7, abs=1e-9)


def test_its_claims_hold_on_draws_of_its_own_model() -> None:
    """NEES of 60 runs, each at a step of its own: chi-square of as many degrees as states."""
    rng = np.random.default_rng(5)
    model = small(rng)
    Q, P0 = (np.linalg.cholesky(X) for X in (model.Q, model.P0))
    nees = []
    for seed in range(60):
        x, truth, z = P0 @ rng.normal(size=5), [], []
        for _ in range(20):
            x = model.A @ x + Q @ rng.normal(size=5)
            truth.append(x)
            z.append(model.H @ x + np.sqrt(model.R) * rng.normal(size=2))
        notes, means, covariances = filtered(model, np.array(z))
        found, k = smoothed(model, notes), seed % 20
        e = means[k] + found.after(k + 1) - truth[k]
        nees.append(e @ np.linalg.solve(covariance_of(found, covariances[k], k + 1), e))
    assert nees_consistency(nees, np.full(60, 5.0)).holds


def test_many_looks_are_carried_in_few_columns() -> None:
    """120 states, all alike slow: what 200 looks say fits into few directions."""
    rng = np.random.default_rng(7)
    n = 120
    A = np.diag(np.exp(-np.linspace(0.01, 0.011, n)))
    model = Dense(A, 1e-3 * np.eye(n), rng.normal(size=(1, n)), np.ones(1), np.eye(n))
    notes, _, covariances = filtered(model, rng.normal(size=(200, 1)))
    found = smoothed(model, notes)
    assert found.roots[1].shape[1] < 20
    whole = np.zeros((n, n))
    for note in reversed(notes[1:]):
        assert note.look is not None
        C = np.eye(n) - note.look.gain.G @ model.H
        whole = A @ (C.T @ whole @ C + model.H.T @ model.H / note.look.gain.S_yy) @ A
    P = covariances[0]
    assert covariance_of(found, P, 1) == pytest.approx(P - P @ whole @ P, abs=1e-9)


def smooths(filter_: Any) -> bool:
    return "smooth" in filter_.__dataclass_fields__


def test_every_linear_and_reduced_filter_smooths() -> None:
    assert {f.__name__ for f in FILTERS if smooths(f)} == {
        "KfFem",
        "ModalKf",
        "ReducedKf",
        "ReducedEKF",
        "LoadScale",
        "FilterpyFilter",
    }


FRAMES = (9, 30, 45, 58, 59)


@pytest.mark.parametrize("settings", LINEAR, ids=repr)
def test_a_smoothed_run_knows_more_and_ends_like_the_filter(
    settings: Filter, pulled: PulledCase
) -> None:
    seen = pulled.measured(1, every=3)
    late = replace(settings, smooth=True)  # type: ignore[type-var]
    one, two = (pulled.march(s.prepare(pulled.system, seen), at=FRAMES) for s in (settings, late))
    assert two.finished
    assert two.step_s is None
    assert one.sd is not None
    assert two.sd is not None
    assert (two.sd <= one.sd).all()
    assert (two.sd[0] < 0.9 * one.sd[0]).any()
    assert two.u[-1] == pytest.approx(one.u[-1], abs=2e-6 * np.abs(one.u).max())
    assert two.sd[-1] == pytest.approx(one.sd[-1])
    assert np.abs(two.u[1] - one.u[1]).max() > 1e-7
    assert pulled.nrmse(two) < pulled.nrmse(one)
    for name in ("nis", "nis.dof", "innovation.top.z"):
        assert np.array_equal(two.traces[name].y, one.traces[name].y)


def test_coordinates_and_gains_beforehand_change_nothing(pulled: PulledCase) -> None:
    seen = pulled.measured(1, every=3)
    runs = [
        pulled.march(s.prepare(pulled.system, seen), at=FRAMES)
        for s in (
            KfFem(smooth=True, gains="every_step"),
            KfFem(smooth=True, settled=0.0),
            ModalKf(smooth=True),
            KfFem(smooth=True, gate=1 - 1e-15),
        )
    ]
    for other in runs[1:]:
        assert runs[0].u == pytest.approx(other.u, rel=1e-8, abs=1e-13)
        assert runs[0].sd == pytest.approx(other.sd, rel=1e-6, abs=1e-13)


def test_a_reduced_run_is_the_posterior_of_its_model(pulled: PulledCase) -> None:
    seen = pulled.measured(1, every=2)
    settings = ReducedKf(modes=4, load_walk=2.0, settled=0.0)
    late = replace(settings, smooth=True)
    found = pulled.march(late.prepare(pulled.system, seen), at=tuple(range(60)))
    model = reduced_model(pulled.system, seen, DT, 4, LoadDoubt(0.1, 2.0), seen.sd**2)
    m, x, path = model.model, model.model.x0, []
    for f in pulled.inputs:
        x = m.F @ x + m.B @ f
        path.append(x)
    z = np.full((60, 3), np.nan)
    z[1::2] = seen.z - np.array(path)[1::2] @ m.H.T
    mean, P = posterior(dense_covariance(m), z)
    free = pulled.system.free
    expected = (np.array(path) + mean) @ model.lift.T
    assert found.u.reshape(60, -1)[:, free] == pytest.approx(expected, rel=1e-7, abs=1e-12)
    sd = np.sqrt(np.einsum("ij,kjl,il->ki", model.lift, P, model.lift))
    assert found.sd is not None
    assert found.sd.reshape(60, -1)[:, free] == pytest.approx(sd, rel=1e-5, abs=1e-12)
    bias = (np.array(path) + mean)[:, -1]
    assert found.traces["load_bias.0"].y == pytest.approx(bias, rel=1e-7, abs=1e-10)


@pytest.mark.parametrize("substeps", [1, 2])
def test_a_nonlinear_run_is_the_posterior_of_its_linearisation(substeps: int) -> None:
    """At displacements so small that the body is linear, with all of its modes."""
    h, body = 2e-4, cube((1, 1, 1))
    inputs = ramp(h * substeps, 24, 1e-5, 0.003)
    truth = plain(body, h * substeps, inputs)
    node, rng = int(body.free[0]) // 3, np.random.default_rng(1)
    t = h * substeps * np.arange(2, 25, 2)
    z = truth[1::2, 3 * node : 3 * node + 3] + 1e-9 * rng.normal(size=(12, 3))
    seen = at_nodes(body, [node], t, z, 1e-9)
    settings = ReducedEKF(
        h * substeps, substeps, shapes=12, load_walk=1e-5, load_sd=1e-6, process=1e-9, smooth=True
    )
    stepper = settings.prepare(body, seen)
    assert isinstance(stepper, ExplicitFilterStepper)
    assert isinstance(stepper.core, ShapesCore)
    found = run(stepper, h * substeps, inputs)
    open_ = run(
        settings.prepare(body, replace(seen, z=np.full_like(z, np.nan))), h * substeps, inputs
    )
    u = open_.u.reshape(24, -1)
    N = 24 * substeps
    away = np.full((N, 3), np.nan)
    away[2 * substeps - 1 :: 2 * substeps] = z - u[1::2, 3 * node : 3 * node + 3]
    mean, P = posterior(stepper.core.covariance, away)
    Phi, at = stepper.core.Phi, slice(substeps - 1, None, substeps)
    expected = u + mean[at, :12] @ Phi.T
    scale = np.abs(expected).max()
    assert found.u.reshape(24, -1) == pytest.approx(expected, abs=1e-6 * scale)
    assert np.abs(expected - u).max() > 1e-3 * scale
    sd = np.sqrt(np.einsum("ij,kjl,il->ki", Phi, P[at, :12, :12], Phi))
    assert found.sd is not None
    assert found.sd.reshape(24, -1) == pytest.approx(sd, rel=1e-4, abs=1e-6 * sd.max())


def test_a_gated_run_is_smoothed_without_its_outlier(pulled: PulledCase) -> None:
    seen = pulled.two_measured(1)
    z, gone = seen.z.copy(), seen.z.copy()
    z[20, 4] += 1.0
    gone[20, 3:] = np.nan
    for settings in (KfFem(gate=0.9999, smooth=True), ReducedKf(gate=0.9999, smooth=True)):
        one, two = (
            pulled.march(settings.prepare(pulled.system, replace(seen, z=y)), at=FRAMES)
            for y in (z, gone)
        )
        assert np.array_equal(one.u, two.u)


def test_a_large_strain_run_is_nearer_to_the_truth() -> None:
    """A body a fifth softer than the model, which its looks mend."""
    h, soft = 4e-4, cube(E=24e3)
    inputs = ramp(h, 150, 3.0, 0.03)
    truth = plain(soft, h, inputs)
    node = soft.scene.mesh.nearest_node(np.array(CENTRE))
    t, rng = h * np.arange(10, 151, 10), np.random.default_rng(0)
    z = truth[9::10, 3 * node : 3 * node + 3] + 3e-5 * rng.normal(size=(15, 3))
    seen = at_nodes(soft, [node], t, z, 3e-5)
    error = {}
    for smooth in (False, True):
        settings = ReducedEKF(h, shapes=8, load_walk=3.0, smooth=smooth)
        found = run(settings.prepare(cube(), seen), h, inputs)
        error[smooth] = np.sqrt(((found.u.reshape(150, -1) - truth)[:, 3 * node] ** 2).mean())
    assert error[True] < 0.8 * error[False]


def test_a_steady_gain_is_refused(pulled: PulledCase) -> None:
    with pytest.raises(UsageError, match="smooth needs the exact gains"):
        ReducedKf(gains="steady", smooth=True).prepare(pulled.system, pulled.measured(1))


def test_only_the_linear_filterpy_filter_is_smoothed(
    pulled: PulledCase,
) -> None:
    seen = pulled.measured(1, every=3)
    ours, theirs = (
        pulled.march(s.prepare(pulled.system, seen), at=FRAMES)
        for s in (
            ReducedKf(modes=5, load_start=0.1, load_walk=0.1, settled=0.0, smooth=True),
            FilterpyFilter(smooth=True),
        )
    )
    assert theirs.u == pytest.approx(ours.u, rel=1e-6, abs=1e-11)
    assert theirs.sd == pytest.approx(ours.sd, rel=1e-4, abs=1e-12)
    for name in ("EnsembleKalmanFilter", "UnscentedKalmanFilter"):
        with pytest.raises(UsageError, match=rf"_?{name[:8]}.* does not have: take make="):
            FilterpyFilter(name, smooth=True).prepare(pulled.system, seen)


def test_a_load_scale_is_the_posterior_of_all_looks_through_a_load_that_changes() -> None:
    """Its transition is of each step's load: against the least squares of the whole path."""
    loads, rng = np.array([0.0, 3.0, 5.0, -2.0, 4.0, 1.0]), np.random.default_rng(4)
    settings = LoadScale(dt=0.1, scale_sd=0.5, walk=0.2, Q=1e-2)
    core = ScaleCore(settings, np.ones(2), np.array([1.0, 0.5]), np.full(2, 0.04), 0.6, 0.2)
    z, state, states = rng.normal(size=(6, 2)), core.start(), []
    z[2] = np.nan
    for k, load in enumerate(loads):
        look = None if np.isnan(z[k]).any() else z[k]
        state, _ = core.step(state, k + 1, np.array([load]), look)
        states.append(state)
    found = smoothed(core.transition(), [core.note(s, True) for s in states])
    late = [core.corrected(s, found.after(k + 1), found.roots[k + 1]) for k, s in enumerate(states)]
    # Rows: the start, how each step follows from the one before, what was seen; over their sds.
    rows, right = [np.eye(1, 14, 1)[0] / 0.5], [1.0 / 0.5]
    sd = np.sqrt(np.diag(core.Q))
    for k, s in enumerate(states):
        for i in range(2):
            row = np.zeros(14)
            row[2 * k : 2 * k + 2], row[2 * k + 2 + i] = -s.A[i] / sd[i], 1 / sd[i]
            rows.append(row)
            right.append(0.0)
            if not np.isnan(z[k]).any():
                rows.append(np.eye(1, 14, 2 * k + 2)[0] * core.seen[i] / 0.2)
                right.append(z[k, i] / 0.2)
    A = np.array(rows)[:, 1:]  # the amplitude starts at zero, surely
    P = np.linalg.inv(A.T @ A)
    path = (P @ A.T @ np.array(right))[1:].reshape(6, 2)
    for k, one in enumerate(late):
        assert one.x.x == pytest.approx(path[k], rel=1e-9, abs=1e-11)
        at = slice(1 + 2 * k, 3 + 2 * k)
        assert pytest.approx(P[at, at], rel=1e-8, abs=1e-11) == one.x.P
