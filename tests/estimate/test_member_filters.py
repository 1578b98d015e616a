"""Filters of several runs: exact truths of their parts, and what they say they know."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filter_scenes import CENTRE, at_nodes, plain, ramp, unmeasured
from filter_scenes import cube as explicit_cube
from filter_scenes import run as explicit_run
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from validate.arrays import Floats
from validate.errors import UsageError
from validate.estimate.consistency import nis_consistency
from validate.estimate.ensemble import members
from validate.estimate.ensemble.ensemble_kf import EnsembleKf, along_mesh, gaspari_cohn, reached
from validate.estimate.ensemble.member_filter import MemberModel, MemberStepper
from validate.estimate.ensemble.members import doubts, parts
from validate.estimate.ensemble.roukf import Roukf, reduced_update, spread, unit_points
from validate.estimate.filterpy.classes import UnscentedKalmanFilter
from validate.estimate.kalman.formulas import (
    Gaussian,
    Reach,
    ensemble_update,
    kf_predict,
    kf_update,
)
from validate.estimate.measurements import Measurements
from validate.fem.assembly.assemble import stiffness
from validate.fem.critical import CriticalStep
from validate.fem.system import System, build
from validate.scene.geometries.box import box, centroids
from validate.scene.material import Region
from validate.scene.scene import Foundation
from validate.solve.dynamic.newmark import Newmark
from validate.solve.march import march
from validate.solve.types import Outcome, Run
from validate.testing.pulled_cube import DT, PAPER, SMALL, TOP, PulledCase, case, cube

# private: _basis, _moved: called alone, case by case.
# private: _corrected: replaced, to bring a case about.

# --- sigma points ---------------------------------------------------------------------------------


@given(st.sampled_from(["simplex", "canonical"]), st.integers(1, 6))
def test_unit_points_have_mean_zero_and_covariance_one(name: str, p: int) -> None:
    unit = unit_points(name, p)  # type: ignore[arg-type]
    assert len(unit) == (p + 1 if name == "simplex" else 2 * p)
    assert np.abs(unit.mean(axis=0)).max() < 1e-12
    assert unit.T @ unit / len(unit) == pytest.approx(np.eye(p), abs=1e-12)


@pytest.mark.parametrize("name", ["simplex", "canonical"])
def test_on_a_linear_model_the_reduced_filter_is_kalmans(name: str) -> None:
    """x' = A x + B b with two unknown constant loads b: P has rank 2, and both are equal."""
    rng, n, p, m = np.random.default_rng(3), 5, 2, 3
    A, B = 0.4 * rng.normal(size=(n, n)), rng.normal(size=(n, p))
    whole = np.block([[A, B], [np.zeros((p, n)), np.eye(p)]])
    H, R = np.hstack([rng.normal(size=(m, n)), np.zeros((m, p))]), 0.2 * np.eye(m)
    unit = unit_points(name, p)  # type: ignore[arg-type]
    Z = np.hstack([np.zeros((len(unit), n)), unit * [0.5, 2.0]])
    other = Gaussian(np.zeros(n + p), np.diag([0.0] * n + [0.25, 4.0]))
    for k in range(30):
        Z, other = Z @ whole.T, kf_predict(other, whole, np.zeros_like(whole))
        z = rng.normal(0, 0.5, m)
        if k % 5 == 2:
            z[0] = np.nan
        done, wanted = reduced_update(Z, Z @ H.T, z, R, unit), kf_update(other, z, H, R)
        Z, other = done.members, wanted.posterior
        assert done.innovation.nis == pytest.approx(wanted.innovation.nis, rel=1e-9)
        assert Z.mean(axis=0) == pytest.approx(other.x, abs=1e-10)
        L = spread(Z, unit)
        assert pytest.approx(other.P, abs=1e-10) == L @ L.T


class _OnAxes:
    """filterpy's door for sigma points: ours, plus and minus the square root of P."""

    def num_sigmas(self) -> int:
        return 2

    def sigma_points(self, x: Floats, P: Floats) -> Floats:
        return np.asarray(x + unit_points("simplex", 1) * np.sqrt(P[0, 0]))

    Wm = Wc = np.full(2, 0.5)


def test_one_parameter_through_a_bent_sensor_is_filterpys_unscented_filter() -> None:
    """One parameter, no state: the whole filter is the update."""
    R, x, unit = 0.01, np.array([0.3]), unit_points("simplex", 1)

    def h(x: Floats) -> Floats:
        return np.array([np.exp(-x[0]), np.sin(x[0])])

    ukf = UnscentedKalmanFilter(1, 2, 1.0, h, lambda x, _: x, _OnAxes())
    ukf.x, ukf.P, ukf.Q, ukf.R = x.copy(), np.eye(1) * 0.2, np.zeros((1, 1)), R * np.eye(2)
    Z, rng = x + unit * np.sqrt(0.2), np.random.default_rng(1)
    for _ in range(20):
        z = h(np.array([0.7])) + 0.1 * rng.normal(size=2)
        ukf.predict()
        ukf.update(z)
        Z = reduced_update(Z, np.array([h(r) for r in Z]), z, R * np.eye(2), unit).members
        assert Z.mean() == pytest.approx(float(ukf.x[0]), abs=1e-12)
        assert (spread(Z, unit) ** 2)[0, 0] == pytest.approx(float(ukf.P[0, 0]), rel=1e-10)


# --- the ensemble ---------------------------------------------------------------------------------


def _linear_ensemble(runs: int, seed: int, deterministic: bool) -> tuple[Gaussian, Gaussian]:
    """The end of 12 steps of a linear model by an ensemble, and by Kalman's recursion."""
    rng, n, m = np.random.default_rng(0), 4, 2
    A, H, R = 0.5 * rng.normal(size=(n, n)), rng.normal(size=(m, n)), np.diag([0.2, 0.3])
    z = rng.normal(size=(12, m))
    exact, draws = Gaussian(np.zeros(n), np.eye(n)), np.random.default_rng(seed)
    members = draws.normal(size=(runs, n))
    for row in z:
        exact = kf_update(kf_predict(exact, A, 0.1 * np.eye(n)), row, H, R).posterior
        members = members @ A.T + np.sqrt(0.1) * draws.normal(size=(runs, n))
        noise = draws.normal(size=(runs, m)) * np.sqrt(np.diag(R))
        noise_or_none = None if deterministic else noise
        members = ensemble_update(members, members @ H.T, row, R, noise_or_none).members
    x = members.mean(axis=0)
    return Gaussian(x, (members - x).T @ (members - x) / (runs - 1)), exact


def test_many_members_come_to_kalmans_answer_as_one_over_the_root() -> None:
    def off(runs: int) -> float:
        pairs = [_linear_ensemble(runs, seed, False) for seed in range(12)]
        return float(np.sqrt(np.mean([np.sum((a.x - b.x) ** 2) for a, b in pairs])))

    order = np.log(off(100) / off(6400)) / np.log(64)
    assert 0.35 < order < 0.65  # 1/2; the sample of 12 seeds scatters by .06
    assert off(6400) < 0.02


def test_without_draws_the_mean_comes_there_too_but_its_spread_is_first_order() -> None:
    """Half the gain leaves G H P H^T G^T / 4 too much: the claim is never too small."""
    found, exact = _linear_ensemble(20_000, 1, True)
    assert np.trace(found.P) > np.trace(exact.P)
    found, exact = _linear_ensemble(20_000, 1, False)
    assert pytest.approx(exact.P, abs=0.01) == found.P


def test_where_nothing_reaches_nothing_moves() -> None:
    """Exactly: not a bit of a far number changes, and with full reach all do."""
    rng = np.random.default_rng(1)
    Z, R = rng.normal(size=(8, 5)), np.eye(1)
    reach = Reach(np.array([[1.0], [0.5], [0.0], [1e-3], [0.0]]), np.ones((1, 1)))
    args = (Z, Z[:, :1], np.array([3.0]), R, rng.normal(size=(8, 1)))
    near = ensemble_update(*args, reach).members
    assert np.array_equal(near[:, [2, 4]], Z[:, [2, 4]])
    assert (near[:, [0, 1, 3]] != Z[:, [0, 1, 3]]).all()
    assert (ensemble_update(*args).members != Z).all()


# --- localisation ---------------------------------------------------------------------------------


def test_gaspari_and_cohns_taper_is_theirs() -> None:
    """1, 5/24 and 0 at 0, c and 2 c; value, slope and curvature meet at c and at 2 c."""
    c, h = 0.02, 1e-4
    assert gaspari_cohn(np.array([0.0, c, 2 * c, 5 * c, np.inf]), c) == pytest.approx(
        [1, 5 / 24, 0, 0, 0], abs=1e-15
    )
    for meet in (c, 2 * c):
        r = meet + h * c * np.arange(-3, 4)
        y = gaspari_cohn(r, c)
        for order in (0, 1, 2):
            below, above = np.diff(y[:4], order) / h**order, np.diff(y[3:], order) / h**order
            assert below[-1] == pytest.approx(above[0], abs=20 * h)
    falling = gaspari_cohn(np.linspace(0, 2 * c, 200), c)
    assert (np.diff(falling) < 0).all()
    with pytest.raises(UsageError, match="radius 0 m"):
        gaspari_cohn(np.zeros(1), 0.0)


def test_a_slit_is_walked_around() -> None:
    """Two arms of a fork, 1 cell apart: along the mesh they are as far as the way round."""
    mesh = box((0.006, 0.003, 0.001), (6, 3, 1))
    middle = centroids(mesh)
    slit = (middle[:, 1] > 0.001) & (middle[:, 1] < 0.002) & (middle[:, 0] > 0.001)
    fork = replace(mesh, cells=mesh.cells[~slit], facets={})
    a, b = (mesh.nearest_node(np.array([0.006, y, 0.0])) for y in (0.001, 0.002))
    row = sparse.csr_array((np.ones(1), ([0], [3 * a])), shape=(1, mesh.nodes.size))
    assert along_mesh(mesh, row)[b, 0] == pytest.approx(0.001)
    assert along_mesh(fork, row)[b, 0] > 0.009
    assert along_mesh(fork, row)[a, 0] == 0.0


def test_a_localised_measurement_leaves_far_nodes_alone() -> None:
    pulled = case(shape=PAPER)
    settings = EnsembleKf(parameters=("bias.pull",), coordinates="nodes", radius=0.001)
    stepper = settings.prepare(pulled.system, pulled.measured(1, every=60))
    assert isinstance(stepper, MemberStepper)
    state = stepper.rest()
    for f in pulled.inputs[:59]:
        state = stepper.step(state, f)
    before = stepper._moved(state.inner, pulled.inputs[58], 60)
    after, _ = stepper._corrected(before, state.inner, stepper.sight.times.z[60], 60)
    moved = np.abs(after.X - before.X).max(axis=0)[: len(pulled.system.free)].reshape(-1, 3)
    mesh = pulled.system.scene.mesh
    distance = along_mesh(mesh, pulled.rows())[:, 0][pulled.system.free[::3] // 3]
    assert (moved[distance >= 0.002] == 0).all()
    assert (moved[distance < 0.0015].max(axis=1) > 0).all()
    reach = reached(stepper.members, pulled.measured(1), 0.001)
    assert reach.seen == pytest.approx(np.ones((3, 3)))  # three components of one node


def test_shapes_are_nowhere_and_are_not_localised() -> None:
    pulled = case()
    with pytest.raises(UsageError, match="set coordinates = nodes"):
        EnsembleKf(radius=0.001).prepare(pulled.system, pulled.measured(1))


# --- members --------------------------------------------------------------------------------------


def in_regions(contrast: float = 1.0, springs: float = 0.0, shape: tuple = SMALL) -> System:  # type: ignore[type-arg]
    """The small cube whose upper half is a region, held or on springs."""
    scene = cube(shape=shape).scene
    upper = np.flatnonzero(centroids(scene.mesh)[:, 2] > scene.mesh.nodes[:, 2].max() / 2)
    stiff = replace(scene.material, E=contrast * scene.material.E)
    changed = replace(scene, regions=(Region("upper", upper, stiff),))
    if springs:
        changed = replace(changed, supports=(), foundations=(Foundation("z0", (0, 1, 2), springs),))
    return build(changed)


def truth(system: System, steps: int, f: float = 0.048, **settings: str) -> PulledCase:
    inputs = np.full((steps, 1), f)
    t = DT * np.arange(1, steps + 1)
    fem = Newmark(DT, **settings)  # type: ignore[arg-type]
    run = march("fem", fem.prepare(system), t, inputs, np.array([steps - 1]), 0.0)
    return PulledCase(system, inputs, run)


def both_nodes(pulled: PulledCase, sd: float) -> Measurements:
    """The top node and the one below."""
    top, rng = pulled.measured(1, sd=sd), np.random.default_rng(2)
    low = pulled.probe("below") + sd * rng.normal(size=(len(pulled.t), 3))
    return replace(
        top,
        H=sparse.csr_array(sparse.vstack([top.H, pulled.rows("below")])),
        z=np.hstack([top.z, low]),
        sd=np.full(6, sd),
        names=(*top.names, "below.x", "below.y", "below.z"),
    )


def test_parts_add_up_to_the_stiffness_whatever_scales_them() -> None:
    """K(x) from parts equals K assembled with those moduli, to rounding."""
    system = in_regions(springs=2e6)
    names = ("stiffness.upper", "stiffness.body", "support.z0")
    of = doubts(system.scene, names, (0.3,), 0.1)
    x = np.log([[2.0, 0.5, 3.0]])
    members = Roukf(parameters=names, coordinates="nodes").members(system)
    p = members.projected  # type: ignore[attr-defined]
    factors = [1.0, *(float(part.factor(x)[0]) for part in parts(system.scene, of))]
    K = np.tensordot(factors, p.K, axes=1)
    scene = system.scene
    (region,), (springs,) = scene.regions, scene.foundations
    other = replace(
        scene,
        material=replace(scene.material, E=0.5 * scene.material.E),
        regions=(replace(region, material=replace(region.material, E=2 * region.material.E)),),
        foundations=(replace(springs, stiffness=3 * springs.stiffness),),
    )
    wanted = stiffness(other)[system.free][:, system.free].toarray()
    assert np.abs(K - wanted).max() < 1e-12 * np.abs(wanted).max()
    assert of.stiffest(x) == pytest.approx(3.0)


def test_a_member_is_newmarks_run_of_its_own_stiffness() -> None:
    """In all nodes to rounding; in shapes to a thousandth."""
    system, names = in_regions(), ("stiffness.upper", "load.pull")
    pulled, x = truth(system, 40), np.log([[2.0, 1.5]])
    wanted = truth(in_regions(contrast=2.0), 40, f=1.5 * 0.048)
    for coordinates, within in (("nodes", 1e-9), ("shapes", 1e-3)):
        settings = Roukf(parameters=names, coordinates=coordinates)  # type: ignore[arg-type]
        members = settings.members(system)
        X, ready, f = np.zeros((1, members.size)), members.ready(x), pulled.inputs[0]
        for k in range(40):
            X = members.step(ready, X, x, f, f, k + 1)
        u = (X[:, : X.shape[1] // 3] @ members.displaced).ravel()  # type: ignore[operator]
        exact = wanted.truth.u[-1].ravel()
        assert np.abs(u - exact).max() < within * np.abs(exact).max()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"parameters": ("stiffness.core",)},
            "not in this scene, which has stiffness, load.pull, bias.pull",
        ),
        ({"parameters": ("stiffness", "stiffness")}, "named twice"),
        ({"sd": (0.1, 0.2)}, "one sd for all or one for each"),
        ({"parameters": ()}, "of 0 parameters"),
        ({"R": 0.0}, "a variance above 0"),
    ],
)
def test_what_cannot_be_doubted_is_refused_in_words(change: dict, words: str) -> None:  # type: ignore[type-arg]
    pulled = case()
    with pytest.raises(UsageError, match=words):
        replace(Roukf(), **change).prepare(pulled.system, pulled.measured(1))


# --- what they find -------------------------------------------------------------------------------


def last(run: Run, name: str) -> float:
    return float(run.traces[name].y[-1])


def off_by(run: Run, name: str, true: float) -> float:
    """Error of a scale at the end, over its claimed sd."""
    found, high = (last(run, f"estimate.{name}{end}") for end in ("", ".high"))
    return float(np.log(found / true) / (np.log(high / found) / 1.96))


@pytest.mark.parametrize(
    "settings", [Roukf(), Roukf(points="canonical"), EnsembleKf(runs=20)], ids=repr
)
def test_a_wrong_modulus_is_found_and_every_node_gains(settings: MemberModel) -> None:
    """The model is 20 % too stiff; nodes that nobody measured come as near as the measured one.
    (Of seed 1 least squares itself is 3.4 sd off.)"""
    pulled = case(100, PAPER)
    stiff = cube(1.2e4, PAPER)
    run = pulled.march(settings.prepare(stiff, pulled.measured(2)))
    plain = pulled.march(Newmark(DT).prepare(stiff))
    assert abs(off_by(run, "stiffness", 1e4)) < 3.3
    assert last(run, "estimate.stiffness.high") < 1.02 * last(run, "estimate.stiffness")
    assert last(run, "estimate.stiffness.left") < 0.03
    for node in (TOP, "below", "corner"):
        assert pulled.nrmse(run, node) < 0.15 * pulled.nrmse(plain, node)
    assert nis_consistency(run.traces["nis"].y, run.traces["nis.dof"].y).holds


@pytest.mark.slow
def test_the_claim_on_a_parameter_holds_over_many_truths() -> None:
    """Truths drawn from the start's law: errors over the claimed sd are chi-square (20 truths), and
    NIS too."""
    rng, scaled, nis, dof = np.random.default_rng(5), [], 0.0, 0.0
    for seed in range(20):
        x = 0.25 * rng.normal()
        pulled = truth(cube(1e4 * float(np.exp(x))), 20)
        run = pulled.march(Roukf().prepare(cube(), pulled.measured(seed)))
        scaled.append(off_by(run, "stiffness", 1e4 * float(np.exp(x))) ** 2)
        nis, dof = nis + run.traces["nis"].y.sum(), dof + run.traces["nis.dof"].y.sum()
    assert 0.27 < np.mean(scaled) < 2.37  # 99.9 % of chi-square(20)/20
    assert 0.88 < nis / dof < 1.12


def test_load_and_stiffness_cannot_be_told_apart_by_one_creeping_node() -> None:
    """All modes of the cube creep alike, whatever its modulus: only the ratio is seen."""
    pulled = case(100)
    names = ("stiffness", "load.pull")
    run = pulled.march(Roukf(parameters=names).prepare(pulled.system, pulled.measured(1)))
    assert last(run, "correlation.stiffness~load.pull") > 0.99
    assert last(run, "estimate.stiffness.left") > 0.6
    assert last(run, "estimate.load.pull.left") > 0.6


def on_springs(springs: float, rho: float, cell: float, damping: float) -> System:
    """The small cube, so many times as large, on an elastic foundation."""
    scene = cube().scene
    mesh = replace(scene.mesh, nodes=cell * scene.mesh.nodes)
    probes = tuple(replace(p, point=tuple(cell * x for x in p.point)) for p in scene.probes)
    material = replace(scene.material, rho=rho, stiffness_damping=damping)
    foundations = (Foundation("z0", (0, 1, 2), springs),)
    return build(
        replace(scene, body=mesh, probes=probes, material=material, supports=(),
                foundations=foundations)
    )  # fmt: skip


NAMES = ("load.pull", "support.z0")


def test_an_unknown_load_on_an_unknown_support_needs_a_second_node() -> None:
    """Nearly without mass and damping, so that nothing but the end is seen: the height of one node
    shows one number of both, what two nodes move apart by is the load alone."""
    real, model = (on_springs(k, 1.0, 1.0, 1e-5) for k in (3.3e6, 3e6))
    pulled = truth(real, 60, f=1.1 * 0.048, rule="backward_euler")
    given = replace(pulled, inputs=pulled.inputs / 1.1)
    settings = Roukf(rule="backward_euler", parameters=NAMES, sd=(0.1,))
    top = pulled.measured(1, sd=3e-5)
    height = replace(top, H=top.H[2:], z=top.z[:, 2:], sd=top.sd[2:], names=top.names[2:])
    one = given.march(settings.prepare(model, height))
    two = given.march(settings.prepare(model, both_nodes(pulled, 3e-5)))
    assert last(one, "estimate.support.z0.left") > 0.8
    assert last(one, f"correlation.{NAMES[0]}~{NAMES[1]}") > 0.99
    assert last(two, "estimate.support.z0.left") < 0.2
    assert abs(off_by(two, "load.pull", 1.1)) < 3.3
    assert abs(off_by(two, "support.z0", 3.3e6)) < 3.3


def test_a_bias_of_the_load_is_found_in_newtons() -> None:
    pulled = truth(cube(), 60, f=0.048 + 0.006)
    given = replace(pulled, inputs=np.full((60, 1), 0.048))
    settings = Roukf(parameters=("bias.pull",), bias_sd=0.02)
    run = given.march(settings.prepare(cube(), pulled.measured(3)))
    assert run.traces["estimate.bias.pull"].unit == "N"
    low, high = (last(run, f"estimate.bias.pull.{end}") for end in ("low", "high"))
    assert low < 0.006 < high
    assert high - low < 0.002


@pytest.mark.slow
def test_wide_doubt_of_a_swinging_body_is_where_the_reduced_filter_lies() -> None:
    """Ten truths on springs drawn from the start's law (sd .3 and .5), squared errors over claimed
    variances, 1 expected: without inflation sigma points claim far too much, ten inflated members
    do not. Seen at 500 Hz with 32 um, swinging at about 10 Hz."""
    model, sd, found = on_springs(3e5, 1068.0, 10.0, 1e-3), np.array([0.3, 0.5]), []
    filters = (
        Roukf(parameters=NAMES, sd=(0.3, 0.5), a0="zero"),
        EnsembleKf(parameters=NAMES, sd=(0.3, 0.5), a0="zero", inflation=1.05),
    )
    for seed in range(10):
        x = sd * np.random.default_rng(100 + seed).normal(size=2)
        true = np.exp(x) * [1.0, 3e5]
        pulled = truth(on_springs(true[1], 1068.0, 10.0, 1e-3), 100, 0.48 * true[0], a0="zero")
        given = replace(pulled, inputs=np.full((100, 1), 0.48))
        runs = [given.march(f.prepare(model, pulled.measured(seed))) for f in filters]
        found.append([[off_by(r, *pair) ** 2 for pair in zip(NAMES, true, strict=True)]
                      for r in runs])  # fmt: skip
    sigma, ensemble = np.mean(found, axis=0)
    assert (sigma > 50).all()
    assert (ensemble < 4).all()


def test_a_model_of_another_kind_raises_the_alarm() -> None:
    """The truth's upper half is five times as stiff: one modulus cannot be both, and NIS says so
    where it is measured finely."""
    real = in_regions(contrast=5.0)
    pulled = truth(real, 60)
    both = both_nodes(pulled, 2e-6)
    for settings in (Roukf(), EnsembleKf()):
        run = pulled.march(settings.prepare(cube(), both))
        found = nis_consistency(run.traces["nis"].y, run.traces["nis.dof"].y)
        assert found.mean > 10
        assert "wrong model class" in found.alarm
    regions = Roukf(parameters=("stiffness.upper", "stiffness.body"), sd=(1.0,))
    run = pulled.march(regions.prepare(in_regions(), both))
    found = nis_consistency(run.traces["nis"].y, run.traces["nis.dof"].y)
    assert not found.alarm
    assert last(run, "estimate.stiffness.upper") == pytest.approx(5e4, rel=0.1)


# --- at large strain ------------------------------------------------------------------------------


def test_the_stiffest_member_must_bear_the_step() -> None:
    """Its critical step is the model's over the root of its stiffness: refused just beyond, before
    step 1, with what would do."""
    system, h = explicit_cube(), 4e-4
    exact = 2 * np.log(0.95 * CriticalStep.of(system).lanczos / h)
    inputs = ramp(h, 4, 1.0, 0.01)

    def found(**settings: Any) -> Outcome:
        stepper = Roukf(h, **settings).prepare(system, unmeasured(system))
        return explicit_run(stepper, h, inputs).outcome

    assert found(sd=(0.999 * exact,)).state == "invalid"  # nothing is measured
    refused = found(sd=(1.001 * exact,))
    assert (refused.state, refused.step) == ("refused", 0)
    assert "times as stiff as the model: steps of 0.0004 s are beyond" in refused.why
    assert "take substeps = 2" in refused.why
    assert found(sd=(1.001 * exact,), substeps=2).state == "invalid"
    assert found(sd=(1.001 * exact,), beyond_limit="run").state == "invalid"


def test_a_modulus_is_found_at_large_strain_and_members_are_the_explicit_run() -> None:
    """The model is 25 % too stiff, the middle of one side is seen at every fifth step."""
    h, steps = 4e-4, 150
    inputs = ramp(h, steps, 3.0, 0.03)
    soft, model = explicit_cube(E=24e3), explicit_cube()
    true, stiff = (plain(system, h, inputs) for system in (soft, model))
    node = model.scene.mesh.nearest_node(np.array(CENTRE))
    t = h * np.arange(5, steps + 1, 5)
    noise = 1e-5 * np.random.default_rng(1).normal(size=(len(t), 3))
    seen = at_nodes(model, [node], t, true[4::5, 3 * node : 3 * node + 3] + noise, 1e-5)
    for settings in (Roukf(h), EnsembleKf(h, sd=(0.15,))):
        found = explicit_run(settings.prepare(model, seen), h, inputs)
        off = np.abs(found.u[-1].ravel() - true[-1]).max()
        assert off < 0.02 * np.abs(stiff[-1] - true[-1]).max()
        assert last(found, "estimate.stiffness") == pytest.approx(24e3, rel=5e-3)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: EnsembleKf(dt=DT, runs=2), "2 members, walks .* at least 3, 0, 0"),
        (lambda: EnsembleKf(dt=DT, walk=-0.1), "walks -0.1 and .* at least 3, 0, 0"),
        (lambda: EnsembleKf(dt=DT, inflation=0.9), "inflation 0.9: 1 or more"),
        (lambda: EnsembleKf(dt=DT, R=0.0), "R = 0 m2: a variance above 0"),
        (lambda: EnsembleKf(dt=0.0), "dt 0 s in .* parameters: all must be above 0"),
    ],
)
def test_members_that_cannot_be_are_refused(make: Any, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        make()


def test_fewer_members_than_parameters_are_refused() -> None:
    small, seen = case().system, case().measured(1, every=5)
    filters = EnsembleKf(dt=DT, runs=3, parameters=("load.pull", "stiffness"))
    with pytest.raises(UsageError, match="3 members for 2 parameters: at least 4"):
        filters.prepare(small, seen)


def test_a_correction_that_is_singular_is_a_diverged_step(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object) -> None:
        raise np.linalg.LinAlgError("S_yy (3, 3) is not positive definite")

    stepper = EnsembleKf(dt=DT, runs=4).prepare(case().system, case().measured(1))
    monkeypatch.setattr(MemberStepper, "_corrected", singular)
    after = stepper.step(stepper.rest(), np.zeros(1))
    why = "step 1: S_yy (3, 3) is not positive definite"
    assert after.failure == ("diverged", why)


def test_no_shapes_make_no_basis() -> None:
    with pytest.raises(UsageError, match="0 shapes: at least 1"):
        members._basis(case().system, (), (), None, 0)  # type: ignore[arg-type]
