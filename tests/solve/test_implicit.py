"""Newton dynamics and statics under loads at large strain."""

from types import SimpleNamespace

import numpy as np
import pytest
from explicit_scenes import pulled, ran, rise

from validate.errors import SceneError
from validate.solve.dynamic.implicit import ImplicitStepper, NewtonDynamics, RateRule

# private: _correction: replaced, to bring a case about.
# private: _rates: called alone, case by case.


@pytest.mark.slow
@pytest.mark.parametrize(("rule", "order"), [("average", 2), ("backward_euler", 1)])
def test_the_rules_converge_with_their_order(rule: RateRule, order: int) -> None:
    system, T = pulled(cells=2), 0.04
    u = [ran(NewtonDynamics(T / n, rule), system, rise(n, 15.0), T / n).u[0] for n in (20, 40, 80)]
    ratio = np.linalg.norm(u[0] - u[1]) / np.linalg.norm(u[1] - u[2])
    assert ratio == pytest.approx(2**order, rel=0.15)


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


def test_a_step_that_finds_no_end_says_what_to_do() -> None:
    """Pressed by 4 kN at once, and one iteration only."""
    system = pulled(cells=2)
    for load, limit in ((-4000.0, 20), (5.0, 1)):
        run = ran(NewtonDynamics(max_iterations=limit), system, np.array([0.0, load]), 0.01)
        assert run.outcome.state in ("not_converged", "invalid")
        assert run.outcome.step == 1
        assert run.outcome.why.startswith("step 2: ")
        assert run.outcome.why.endswith("; take a smaller dt")


def test_a_tangent_that_vanishes_ends_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    def vanished(*_: object) -> None:
        raise SceneError("a pivot of 0")

    stepper = NewtonDynamics(0.001).prepare(pulled())
    monkeypatch.setattr(type(stepper), "_correction", vanished)
    after = stepper.step(stepper.rest(), np.array([5.0]))
    assert after.failure == ("not_converged", "step 1: a pivot of 0; take a smaller dt")


@pytest.mark.parametrize(
    ("rule", "speed", "acceleration"),
    [
        ("backward_euler", 4.0, 2.0),  # v' = d/dt, a' = (v' - v)/dt
        ("average", 5.0, 7.0),  # v' = 2 d/dt - v, a' = 4 d/dt^2 - 4 v/dt - a
    ],
)
def test_rates_at_the_end_of_a_step_by_hand(
    rule: RateRule, speed: float, acceleration: float
) -> None:
    """A node of speed 3 m/s and acceleration 1 m/s2 goes 2 m in half a second."""
    stepper = SimpleNamespace(
        settings=NewtonDynamics(0.5, rule), system=SimpleNamespace(moves=np.zeros((1, 0)))
    )
    last = SimpleNamespace(v=np.array([3.0]), a=np.array([1.0]))
    rates = ImplicitStepper._rates(stepper, last)  # type: ignore[arg-type]
    assert rates.p * 2.0 + rates.v == pytest.approx([speed], rel=1e-14)
    assert rates.q * 2.0 + rates.a == pytest.approx([acceleration], rel=1e-14)
