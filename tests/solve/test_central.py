"""Explicit dynamics: order, energy, the critical step, and how runs end that should end."""

import re
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from explicit_scenes import marched, pressed, pulled, ran, rise
from law_samples import NAMES
from scipy.linalg import eigh

from validate.errors import SceneError
from validate.fem.kernels.threads import Team, ThreadChoice
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import System
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.explicit.central import CentralDifference, CentralStepper, Damping
from validate.solve.static.newton import StaticNewton
from validate.solve.types import State

# private: _beta: called alone, case by case.

LAWS = [
    "svk",
    "neo_hooke",
    *(pytest.param(n, marks=pytest.mark.slow) for n in NAMES if n not in ("svk", "neo_hooke")),
]


def limit(system: System) -> float:
    stepper = CentralDifference().prepare(system)
    assert isinstance(stepper, CentralStepper)
    return stepper.start.limit


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.slow
def test_it_converges_to_implicit_dynamics_with_order_two(law: str) -> None:
    system, T = pulled(law), 0.02
    exact = ran(NewtonDynamics(T / 200), system, rise(200, 15.0), T / 200).u[0]
    errors = []
    for n in (20, 40):
        run = ran(CentralDifference(T / n), system, rise(n, 15.0), T / n)
        assert run.finished
        errors.append(float(np.abs(run.u[0] - exact).max()))
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.25)
    assert errors[1] < 2e-3 * np.abs(exact).max()


def test_substeps_are_steps_with_inputs_linear_between() -> None:
    system, dt = pulled(), 5e-4
    fine = np.linspace(0, 10.0, 81)[1:]
    one = ran(CentralDifference(dt), system, fine, dt)
    four = ran(CentralDifference(4 * dt, substeps=4), system, fine[3::4], 4 * dt)
    assert np.abs(one.u - four.u).max() < 1e-14
    assert four.traces["updates"].y.tolist() == [4.0] * 20


@pytest.mark.slow
def test_threads_change_no_more_than_rounding() -> None:
    """Also where a run begins with two and goes on with one."""
    system, dt = pressed(), 3e-4
    inputs = rise(200, 0.02)
    one = ran(CentralDifference(dt, watch=1), system, inputs, dt)
    for seconds in (1.0, 0.0):  # of one thread's step: two stay, or take longer from the start
        stepper = CentralDifference(dt, watch=1).prepare(system)
        assert isinstance(stepper, CentralStepper)
        team = Team(ThreadChoice(2, 2, {1: seconds, 2: seconds / 2}))
        stepper.body.share(2)
        two = marched(replace(stepper, team=team), inputs, dt)
        assert team.threads == (2 if seconds else 1)
        assert two.said[-1] == team.said
        assert np.abs(two.u - one.u).max() < 1e-12 * np.abs(one.u).max()
        force, other = (run.traces["plate.force"].y for run in (one, two))
        assert np.abs(other - force).max() < 1e-10 * np.abs(force).max()


def test_no_threads_run_where_no_core_is_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("validate.solve.explicit.central.idle_cores", lambda: 1)
    system, dt = pressed(), 3e-4
    run = ran(CentralDifference(dt, threads=2), system, rise(20, 0.02), dt)
    assert run.said == ("threads: 1 of 2; no other core is idle",)
    alone = ran(CentralDifference(dt), system, rise(20, 0.02), dt)
    assert np.array_equal(run.u, alone.u)
    assert alone.said == ()


@pytest.mark.slow
def test_a_measured_number_of_threads_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("validate.solve.explicit.central.idle_cores", lambda: 2)
    run = ran(CentralDifference(3e-4, threads=2), pressed(), rise(20, 0.02), 3e-4)
    assert re.match(r"threads: [12] of 2, pilot 1: \S+ us, 2: \S+ us", run.said[0])


@pytest.mark.slow
@pytest.mark.parametrize("law", ["svk", "neo_hooke"])
def test_single_precision_stays_near_over_many_steps(law: str) -> None:
    """Increments add up in doubles: after 800 steps the motion still has six digits."""
    system = pulled(law)
    dt = 0.5 * limit(system)
    single, double = (
        ran(CentralDifference(dt, precision=p), system, rise(800, 15.0), dt)
        for p in ("single", "double")
    )
    apart = np.abs(single.u - double.u).max() / np.abs(double.u).max()
    assert single.finished
    assert 1e-12 < apart < 1e-6


@pytest.mark.parametrize("law", LAWS)
def test_energy_is_what_the_load_brought(law: str) -> None:
    system = pulled(law)
    dt = 0.3 * limit(system)
    traces = ran(CentralDifference(dt, watch=1), system, np.full(400, 15.0), dt).traces
    held = traces["energy.strain"].y + traces["energy.kinetic"].y - traces["energy.external"].y
    assert np.abs(held).max() < 5e-3 * traces["energy.external"].y.max()


@pytest.mark.parametrize("damping", [{"mass_damping": 30.0}, {"stiffness_damping": 1e-3}])
def test_damping_takes_what_is_missing_and_statics_is_left(damping: dict[str, float]) -> None:
    system = pressed("svk", **damping)
    inputs = np.concatenate([rise(1500, 0.02), np.full(3000, 0.02)])
    run = ran(CentralDifference(3e-4, damping="lagged"), system, inputs, 3e-4)
    last = {name: trace.y[-1] for name, trace in run.traces.items()}
    assert last["plate.force"] == pytest.approx(43.20, rel=1e-6)
    left = last["energy.external"] - last["energy.strain"] - last["energy.damped"]
    assert abs(left) < 1e-5 * last["energy.external"]
    assert last["energy.damped"] > 1e-7


def test_mass_damping_decays_as_it_should() -> None:
    """Free swing of a pulled cube: energy falls by exp(-alpha t)."""
    alpha, dt = 20.0, 5e-4
    inputs = np.concatenate([np.ones(40), np.zeros(400)])
    traces = ran(CentralDifference(dt, watch=1), pulled(mass_damping=alpha), inputs, dt).traces
    energy = traces["energy.strain"].y + traces["energy.kinetic"].y
    slope = np.polyfit(dt * np.arange(400), np.log(energy[40:]), 1)[0]
    assert slope == pytest.approx(-alpha, rel=0.02)


@pytest.mark.parametrize("law", LAWS)
def test_the_critical_step_is_where_runs_part(law: str) -> None:
    system = pulled(law)
    dt = limit(system)
    for share, ending in ((0.98, "finished"), (1.02, "diverged")):
        scheme = CentralDifference(share * dt, beyond_limit="run", margin=0.0)
        run = ran(scheme, system, np.full(1500, 0.1), share * dt)
        assert run.outcome.state == ending
        assert np.isfinite(run.u).all()


def test_a_step_beyond_the_limit_is_refused_with_its_ratio() -> None:
    system = pulled()
    dt = limit(system)
    run = ran(CentralDifference(3 * dt), system, np.zeros(3), 3 * dt)
    assert (run.outcome.state, run.outcome.step) == ("refused", 0)
    assert "3 times the critical step" in run.outcome.why
    assert "substeps=4" in run.outcome.why
    assert ran(CentralDifference(3 * dt, substeps=4), system, np.zeros(3), 3 * dt).finished


def test_lagged_damping_lowers_the_limit() -> None:
    """To (2/omega)(sqrt(1 + xi^2) - xi), xi = beta omega/2."""
    free = limit(pulled())
    beta = 0.5 * free
    system = pulled(stiffness_damping=beta)
    stepper = CentralDifference(damping="lagged").prepare(system)
    assert isinstance(stepper, CentralStepper)
    assert stepper.start.limit == pytest.approx(free * (np.sqrt(1.25) - 0.5), rel=1e-9)
    for share, ending in ((0.99, "finished"), (1.03, "diverged")):
        dt = share * stepper.start.limit
        scheme = CentralDifference(dt, damping="lagged", beyond_limit="run", margin=0.0)
        assert ran(scheme, system, np.full(1500, 0.1), dt).outcome.state == ending


def test_divergence_is_seen_before_numbers_are_lost() -> None:
    system = pulled()
    dt = 4 * limit(system)
    run = ran(CentralDifference(dt, beyond_limit="run", watch=1), system, np.full(50, 0.1), dt)
    assert run.outcome.state == "diverged"
    assert "times the work done" in run.outcome.why
    assert "of the critical step" in run.outcome.why
    blind = CentralDifference(dt, beyond_limit="run", watch=1000)
    late = ran(blind, system, np.full(50, 0.1), dt)
    assert late.outcome.state == "diverged"
    assert run.outcome.step < late.outcome.step


@pytest.mark.parametrize(("energy", "failed"), [(2.09, False), (2.12, True), (np.nan, True)])
def test_five_percent_beyond_the_most_work_done_is_the_alarm(energy: float, failed: bool) -> None:
    """A body at rest that has given back what it was brought, and damping that took more."""
    stepper = CentralDifference(1e-6).prepare(pulled())
    assert isinstance(stepper, CentralStepper)
    past = replace(stepper.start, work=2.0, taken=energy, most=2.0)
    failure = stepper.step(State(0, past), np.zeros(1)).failure
    assert (failure is not None) == failed
    if energy == 2.12:
        assert failure is not None
        assert "energy 1.06 times the work done" in failure[1]


@pytest.mark.parametrize("kind", ["shock", "release", "noise"])
@pytest.mark.parametrize("make", [pulled, pressed])
def test_no_alarm_where_all_is_well(kind: str, make: Callable[[], System]) -> None:
    """Shocks close below the limit put much of the energy into the fastest modes."""
    system = make()
    dt = 0.9 * limit(system)
    noise = np.random.default_rng(0).standard_normal(200)
    inputs = {"shock": np.eye(200)[3], "release": np.repeat([1.0, 0.0], 100), "noise": noise}
    size = 1e-4 if system.scene.drives else 1.0
    run = ran(CentralDifference(dt, watch=1), system, size * inputs[kind], dt)
    assert run.finished, run.outcome


def test_inverted_elements_are_counted() -> None:
    system = pulled(cells=4, nu=0.3)
    dt = 0.2 * limit(system)
    run = ran(CentralDifference(dt, watch=1), system, np.full(4000, -400.0), dt)
    assert run.outcome.state == "invalid"
    assert "of 384 elements inverted (det F <= 0)" in run.outcome.why


def test_the_limit_is_taken_anew_as_the_body_deforms() -> None:
    """A neo-Hookean cube stretched by 1.4: its limit is that of the tangent it has there."""
    inputs = np.concatenate([rise(1000, -0.04), np.full(10, -0.04)])
    system = pressed("neo_hooke", mass_damping=20.0)
    run = ran(CentralDifference(8e-4), system, inputs, 8e-4)
    assert run.finished
    limits = run.traces["critical_step"]
    K = Body(system.scene).tangent(run.u[0].ravel()).toarray()[np.ix_(system.free, system.free)]
    top = eigh(K, np.diag(system.masses[system.free]), eigvals_only=True)[-1]
    assert limits.unit == "s"
    assert limits.y[-1] == pytest.approx(2 / np.sqrt(top), rel=0.01)
    assert limits.y[-1] < 0.9 * limits.y[0]


def test_a_run_that_reaches_its_moving_limit_stops() -> None:
    system = pressed("neo_hooke", mass_damping=20.0)
    dt = 0.94 * limit(system)
    run = ran(CentralDifference(dt), system, rise(400, -0.04), dt)
    assert run.outcome.state == "refused"
    assert run.outcome.step > 20
    assert "as deformed" in run.outcome.why


def test_a_slow_pull_swings_about_statics() -> None:
    """nu .49: the mean of a slow explicit run is the static state under the load."""
    system = pulled(nu=0.49)
    static = ran(StaticNewton(), system, np.array([5.0]), 1.0)
    load = np.concatenate([rise(2000, 5.0), np.full(2000, 5.0)])
    run = ran(CentralDifference(3e-4, watch=1), system, load, 3e-4)
    assert run.finished
    strain = run.traces["energy.strain"].y[2000:].mean()
    assert strain == pytest.approx(Body(system.scene).energy(static.u[0].ravel()), rel=1e-3)


def test_settings_that_make_no_sense_are_refused() -> None:
    with pytest.raises(SceneError, match="0 substeps"):
        CentralDifference(substeps=0)
    with pytest.raises(SceneError, match="damping='lagged'"):
        CentralDifference().prepare(pulled(stiffness_damping=1e-3))
    assert CentralDifference(damping="none").prepare(pulled(stiffness_damping=1e-3))


@pytest.mark.parametrize("damping", ["mass", "lagged"])
def test_what_rests_damped_under_its_load_has_balanced_energies(damping: Damping) -> None:
    """Half the load's work is stored, damping took the rest, however long it hangs there."""
    beta = 1e-3 if damping == "lagged" else 0.0
    system = pulled("neo_hooke", 2, mass_damping=40.0, stiffness_damping=beta)
    stepper = CentralDifference(dt=5e-4, damping=damping).prepare(system)
    state, left = stepper.rest(), []
    for k in range(1, 601):
        state = stepper.step(state, np.array([0.5 * min(k / 200, 1.0)]))
        assert state.failure is None
        n = state.numbers
        stored = n["energy.strain"] + n["energy.kinetic"]
        left.append(n["energy.external"] - stored - n["energy.damped"])
    assert abs(left[-1]) < 0.01 * state.numbers["energy.external"]
    assert left[-1] == pytest.approx(left[450], abs=1e-4 * state.numbers["energy.external"])


def test_lagged_damping_is_for_one_stiffness_damping() -> None:
    scheme = CentralDifference(1e-3, damping="lagged")
    for betas, expected in (([0.1, 0.1], 0.1), ([0.0, 0.0], 0.0)):
        scene = SimpleNamespace(per_cell=lambda of, betas=betas: np.array(betas))
        assert scheme._beta(scene) == expected  # type: ignore[arg-type]
    scene = SimpleNamespace(per_cell=lambda of: np.array([0.2, 0.1]))
    with pytest.raises(SceneError, match=r"stiffness damping.*0\.1.*0\.2.*\] s"):
        scheme._beta(scene)  # type: ignore[arg-type]
