"""Newton dynamics and statics under loads at large strain."""

from dataclasses import replace

import numpy as np
import pytest
from explicit_scenes import pressed, pulled, ran, rise

from validate.errors import SceneError
from validate.fem.hyperelastic import Body
from validate.fem.system import build
from validate.scene.scene import LawName
from validate.solve.implicit import NewtonDynamics, RateRule
from validate.solve.newton import StaticNewton


@pytest.mark.parametrize(("rule", "order"), [("average", 2), ("backward_euler", 1)])
def test_the_rules_converge_with_their_order(rule: RateRule, order: int) -> None:
    system, T = pulled(cells=2), 0.04
    u = [ran(NewtonDynamics(T / n, rule), system, rise(n, 15.0), T / n).u[0] for n in (20, 40, 80)]
    ratio = np.linalg.norm(u[0] - u[1]) / np.linalg.norm(u[1] - u[2])
    assert ratio == pytest.approx(2**order, rel=0.15)


def test_statics_is_in_balance_with_the_load() -> None:
    system = pulled("neo_hooke")
    run = ran(NewtonDynamics(rule="static"), system, np.array([20.0, 40.0]), 0.01)
    assert run.finished
    residual = Body(system.scene).force(run.u[0].ravel()) - 40.0 * system.loads[:, 0]
    assert np.abs(residual[system.free]).max() < 1e-8
    assert run.u[0][:, 0].max() > 0.01


@pytest.mark.parametrize("law", ["svk", "neo_hooke"])
def test_driven_statics_is_that_of_static_newton(law: LawName) -> None:
    system = pressed(law)
    drives = np.array([0.01, 0.02])
    here = ran(NewtonDynamics(rule="static"), system, drives, 0.01)
    there = ran(StaticNewton(), system, drives, 0.01)
    assert np.abs(here.u - there.u).max() < 1e-9
    force = here.traces["plate.force"].y
    assert force == pytest.approx(there.traces["plate.force"].y, rel=1e-8)
    if law == "svk":
        assert force == pytest.approx([25.65, 43.20], rel=1e-8)


def test_consistent_and_lumped_masses_swing_alike() -> None:
    """The mesh is coarse: masses change the swing by little, and by something."""
    runs = [
        ran(NewtonDynamics(0.001, mass=mass), pulled(), np.full(20, 5.0), 0.001).u[0]
        for mass in ("lumped", "consistent")
    ]
    apart = np.abs(runs[0] - runs[1]).max() / np.abs(runs[0]).max()
    assert 1e-4 < apart < 0.2


def test_average_acceleration_keeps_the_energy() -> None:
    """A small swing after the load is gone: Newmark's trapezoidal rule loses nothing."""
    system, load = pulled(cells=2), np.concatenate([np.ones(20), np.zeros(60)])
    traces = ran(NewtonDynamics(0.001), system, load, 0.001).traces
    energy = traces["energy.strain"].y + traces["energy.kinetic"].y
    assert np.ptp(energy[21:]) < 2e-3 * energy[21:].mean()


def test_a_load_beyond_the_law_finds_no_equilibrium() -> None:
    system = pulled(cells=2)
    run = ran(NewtonDynamics(rule="static", cuts=3), system, np.array([-10.0, -4000.0]), 0.01)
    assert (run.outcome.state, run.outcome.step) == ("not_converged", 1)
    assert "of the step's load was reached" in run.outcome.why


def test_a_loose_body_is_refused() -> None:
    loose = build(replace(pulled().scene, supports=()))
    with pytest.raises(SceneError, match="not positive definite"):
        NewtonDynamics(rule="static").prepare(loose)
    assert NewtonDynamics().prepare(loose)
