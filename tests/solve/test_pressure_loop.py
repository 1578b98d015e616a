"""The paper's proportional law: its claims, its gain, and every way it can fail to converge."""

from dataclasses import replace

import numpy as np
import pytest
from fluid_steps import NINE, pressures, slope_at, stepped, volume_ratios

from validate.fem.system import Responses
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.fluid.pressure_curve import tuned_gain
from validate.solve.fluid.pressure_loop import PressureLoop


@pytest.mark.parametrize("strain", [0.003, 0.01, 0.03, 0.05, 0.08, 0.1, 0.12, 0.15])
def test_one_percent_in_at_most_one_update(phantom: Responses, strain: float) -> None:
    """Paper 000's claim, cold start; the note: residual at most 0.37 % where an update was made."""
    state = stepped(PressureLoop(warm_start=False), phantom, 0.06 * strain)
    error = abs(volume_ratios(phantom, state)[0] - 1)
    assert state.failure is None
    assert state.updates <= 1
    assert error <= (0.0037 if state.updates else 0.01)


def test_loop_tends_to_the_exact_pressure(phantom: Responses) -> None:
    exact = stepped(ExactPressure(), phantom, NINE)
    for tolerance in (1e-3, 1e-6, 1e-9):
        loop = stepped(PressureLoop(tolerance=tolerance), phantom, NINE)
        error = abs(volume_ratios(phantom, loop)[0] - 1)
        assert error <= tolerance
        assert pressures(loop) == pytest.approx(pressures(exact), abs=30e3 * tolerance)


def test_a_volume_that_is_just_within_the_tolerance_is_left_alone(phantom: Responses) -> None:
    off = abs(volume_ratios(phantom, stepped(PressureLoop(tolerance=1.0), phantom, NINE))[0] - 1)
    exact = abs(1 - (phantom.volumes @ np.array([1.0, *NINE, 0.0]) @ np.array([1.0, *NINE, 0.0])
                     @ np.array([1.0, *NINE, 0.0]))[0] / phantom.rest_volumes[0])  # fmt: skip
    assert off == exact
    assert stepped(PressureLoop(tolerance=exact), phantom, NINE).updates == 0
    assert stepped(PressureLoop(tolerance=0.999 * exact), phantom, NINE).updates > 0


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.5])
def test_tolerance_zero_ends_by_stagnation(phantom: Responses, factor: float) -> None:
    exact = stepped(ExactPressure(), phantom, NINE)
    loop = PressureLoop(gain=factor * slope_at(phantom, exact), tolerance=0.0)
    state = stepped(loop, phantom, NINE)
    assert state.failure is None
    assert state.updates < 100
    assert pressures(state) == pytest.approx(pressures(exact), rel=1e-10)


@pytest.mark.parametrize("gain", [0.0, -1e3, -24_500.0, -1e7])
def test_gain_without_or_against_effect_is_reported(phantom: Responses, gain: float) -> None:
    """A negative gain can settle on a root of the collapsed cavity: no solution either."""
    failure = stepped(PressureLoop(gain=gain), phantom, NINE).failure
    assert failure is not None
    assert failure[0] in ("not_converged", "diverged")
    assert gain != 0 or failure[0] == "not_converged"


def test_limit_of_the_gain_is_twice_the_slope_at_the_solution(phantom: Responses) -> None:
    exact = stepped(ExactPressure(), phantom, NINE)
    slope = slope_at(phantom, exact)
    near = replace(exact, inner=replace(exact.inner, z=exact.inner.z * [1.0, 1.01]))
    loop = PressureLoop(tolerance=1e-7, max_updates=4000)
    below = replace(loop, gain=1.99 * slope).on(phantom).step(near, NINE)
    above = replace(loop, gain=2.01 * slope).on(phantom).step(near, NINE)
    assert below.failure is None
    assert pressures(below) == pytest.approx(pressures(exact), abs=30e3 * 1e-7)
    assert above.failure is not None
    assert above.failure[0] == "not_converged"
    assert "4000 updates" in above.failure[1]


def test_gain_far_too_large_diverges_and_keeps_the_last_state(phantom: Responses) -> None:
    stepper = PressureLoop(gain=1e6).on(phantom)
    state = stepper.step(stepper.rest(), NINE)
    assert state.failure is not None
    assert state.failure[0] == "diverged"
    assert not state.inner.z.any()


@pytest.mark.parametrize("limit", [0, 1])
def test_limit_of_updates_is_an_outcome(phantom: Responses, limit: int) -> None:
    state = stepped(PressureLoop(max_updates=limit, tolerance=1e-6), phantom, NINE)
    assert state.failure is not None
    assert state.failure[0] == "not_converged"
    assert state.updates == limit


def test_warm_start_saves_updates(phantom: Responses) -> None:
    path = np.linspace(0, 0.009, 10)[1:, None]
    total = {}
    for warm in (True, False):
        stepper = PressureLoop(tolerance=1e-3, warm_start=warm).on(phantom)
        state, updates = stepper.rest(), 0
        for drives in path:
            state = stepper.step(state, drives)
            updates += state.updates
        total[warm] = updates
        assert abs(volume_ratios(phantom, state)[0] - 1) <= 1e-3
    assert total[True] < total[False]


def test_gain_of_each_cavity_is_its_own(two_cavities: Responses) -> None:
    stepper = PressureLoop().on(two_cavities)
    own = [tuned_gain(two_cavities, i) for i in (0, 1)]
    assert np.diag(stepper.gains).tolist() == own  # type: ignore[attr-defined]
    assert own[0] > 1.2 * own[1]  # the smaller cavity is stiffer
    state = stepped(PressureLoop(tolerance=1e-6), two_cavities, 0.006)
    exact = stepped(ExactPressure(), two_cavities, 0.006)
    assert state.failure is None
    assert pressures(state) == pytest.approx(pressures(exact), rel=1e-4)
