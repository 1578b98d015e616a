"""Pressure laws beside the incompressible one, and every update of the loop beside the exact."""

import math

import numpy as np
import pytest
from fluid_steps import NINE, pressures, stepped, volume_ratios
from hypothesis import given, settings
from hypothesis import strategies as st
from phantoms import phantom_responses

from validate.errors import SceneError
from validate.fem.system import Responses
from validate.solve.fluid.cavities import MMHG, ElasticPressure, ExactPressure, PulsePressure
from validate.solve.fluid.pressure_curve import RATIOS, cubic, pressure_at_volume, still, tuned_gain
from validate.solve.fluid.pressure_loop import (
    PressureLoop,
    UpdateName,
    gain_matrix,
)

UPDATES: tuple[UpdateName, ...] = (
    "proportional", "retuned", "piecewise", "secant", "newton", "golden",
)  # fmt: skip


@pytest.mark.parametrize("update", UPDATES)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-6])
def test_every_update_ends_at_the_exact_pressure(
    phantom: Responses, update: UpdateName, tolerance: float
) -> None:
    exact = stepped(ExactPressure(), phantom, NINE)
    state = stepped(PressureLoop(update=update, tolerance=tolerance), phantom, NINE)
    assert state.failure is None
    assert abs(volume_ratios(phantom, state)[0] - 1) <= tolerance
    assert pressures(state) == pytest.approx(pressures(exact), abs=3e4 * tolerance)
    if tolerance < 1e-3:
        assert 0 < state.updates < (60 if update == "golden" else 8)


def test_newton_squares_the_error_and_the_others_do_not(phantom: Responses) -> None:
    """Updates to 1e-12 from a cold start, with the tool where the cavity is squeezed by 8 %."""
    counts = {
        name: stepped(
            PressureLoop(update=name, tolerance=1e-12, warm_start=False), phantom, NINE
        ).updates
        for name in UPDATES
        if name != "golden"
    }
    assert counts["newton"] <= 4 < counts["proportional"]
    assert counts["newton"] <= counts["secant"] < counts["proportional"]


def test_one_newton_update_is_the_cubics_tangent(phantom: Responses) -> None:
    z = still(phantom)
    z[1] = NINE[0]
    a, b, c, d = cubic(phantom.volumes[0], z, 2)
    assert d + c * 500.0 + b * 500.0**2 + a * 500.0**3 == pytest.approx(
        phantom.volumes[0] @ (z + [0, 0, 500.0]) @ (z + [0, 0, 500.0]) @ (z + [0, 0, 500.0]),
        rel=1e-13,
    )
    # the worst error after one update is still above this tolerance, so that two are not made
    one = stepped(PressureLoop(update="newton", max_updates=1, tolerance=1e-9), phantom, NINE)
    assert pressures(one)[0] == pytest.approx((phantom.rest_volumes[0] - d) / c, rel=1e-12)


def test_the_line_of_the_curve_moves_with_the_tool(phantom: Responses) -> None:
    """Kp is tuned without the tool but used with it (findings on paper 000)."""
    z = still(phantom)
    z[1] = NINE[0]
    assert tuned_gain(phantom, 0, z) != pytest.approx(tuned_gain(phantom), rel=1e-3)
    curve = pressure_at_volume(phantom, RATIOS, 0, z)
    assert np.interp(1.0, RATIOS, curve) == pytest.approx(
        pressures(stepped(ExactPressure(), phantom, NINE))[0], rel=1e-9
    )


def test_gains_of_several_cavities(two_cavities: Responses) -> None:
    own = np.array([tuned_gain(two_cavities, i) for i in (0, 1)])
    assert np.diag(gain_matrix(two_cavities, PressureLoop(gains="common"))) == pytest.approx(
        np.full(2, own.mean())
    )
    rest = still(two_cavities)
    assert PressureLoop(gains="matrix").spectral_radius(two_cavities, rest) < 1e-12
    assert PressureLoop(gains="own").spectral_radius(two_cavities, rest) > 0.01


@pytest.mark.parametrize("gains", ["own", "common", "matrix"])
def test_spectral_radius_is_the_rate_of_the_loop(two_cavities: Responses, gains: str) -> None:
    """Small volume errors shrink by it; the matrix of the rest shape is the fastest."""
    loop = PressureLoop(gains=gains, tolerance=1e-13)  # type: ignore[arg-type]
    state = stepped(loop, two_cavities, 0.01)
    G = gain_matrix(two_cavities, loop)
    z = np.concatenate([[1.0], state.inner.z])
    z[-1] *= 1.001
    errors = []
    for _ in range(3):
        error = 1 - (two_cavities.volumes @ z @ z @ z) / two_cavities.rest_volumes
        errors.append(float(np.abs(error).max()))
        z[2:] += G @ error
    rate = errors[2] / errors[1]
    assert rate <= 1.05 * loop.spectral_radius(two_cavities, z) + 1e-6


def test_a_compressible_fluid_is_between_an_empty_cavity_and_a_full_one(phantom: Responses) -> None:
    found = [pressures(stepped(ExactPressure(1.0, K), phantom, NINE))[0]
             for K in (1.0, 1e4, 1e9)]  # fmt: skip
    exact = pressures(stepped(ExactPressure(), phantom, NINE))[0]
    assert 0 < found[0] < found[1] < found[2] < exact
    assert found[2] == pytest.approx(exact, rel=1e-4)


@settings(max_examples=40)
@given(st.floats(0.9, 1.1), st.floats(1e3, 1e7), st.floats(0, 0.012))
def test_a_compressible_fluid_has_its_own_law(ratio: float, K: float, drive: float) -> None:
    """P = -K (V / (ratio V0) - 1), whatever the tool does."""
    r = phantom_responses()
    state = stepped(ExactPressure(ratio, K), r, drive)
    V = volume_ratios(r, state)[0]
    assert pressures(state)[0] == pytest.approx(-K * (V / ratio - 1), abs=2e-12 * K + 1e-9)


@pytest.mark.parametrize("times", [0.5, 3.0, 100.0])
def test_an_elastic_reservoir_by_newton_whatever_its_stiffness(
    phantom: Responses, times: float
) -> None:
    """P = Pe - B (V/V0 - 1); substitution diverges for B beyond the slope, Newton takes few."""
    slope = float(phantom.rest_volumes[0] / (3 * phantom.volumes[0, 0, 0, 2]))
    B, Pe = times * slope, 800.0
    state = stepped(ElasticPressure(Pe, B), phantom, NINE)
    V = volume_ratios(phantom, state)[0]
    assert state.failure is None
    assert state.updates <= 5
    assert pressures(state)[0] == pytest.approx(Pe - B * (V - 1), rel=1e-9)


def test_an_elastic_reservoir_of_two_cavities(two_cavities: Responses) -> None:
    state = stepped(ElasticPressure(300.0, 2e4), two_cavities, 0.006)
    V = volume_ratios(two_cavities, state)
    assert pressures(state) == pytest.approx(300.0 - 2e4 * (V - 1), rel=1e-9)


def test_a_reservoir_that_feeds_itself_beyond_the_bodys_stiffness_has_no_stable_root(
    phantom: Responses, two_cavities: Responses
) -> None:
    """dP/dV of the law against that of the body: below it a little more volume brings too little
    pressure to stay, above it too much."""
    slope = float(phantom.rest_volumes[0] / (3 * phantom.volumes[0, 0, 0, 2]))
    mild = stepped(ElasticPressure(100.0, -0.5 * slope), phantom, 0.001)
    wild = stepped(ElasticPressure(100.0, -4 * slope), phantom, 0.001)
    assert mild.failure is None
    V = volume_ratios(phantom, mild)[0]
    assert pressures(mild)[0] == pytest.approx(100.0 + 0.5 * slope * (V - 1), rel=1e-9)
    assert wild.failure is not None
    assert wild.failure[0] == "not_converged"
    assert "unstable: it rises faster" in wild.failure[1]
    mild, wild = (stepped(ElasticPressure(100.0, B), two_cavities, 0.0005) for B in (-1e3, -1e6))
    assert mild.failure is None
    assert wild.failure is not None
    assert "unstable: they rise faster" in wild.failure[1]


@pytest.mark.parametrize("share", [0.2, 0.6, 0.9])
def test_a_mild_reservoir_is_what_substitution_tends_to(phantom: Responses, share: float) -> None:
    """P <- Pe - B (V/V0 - 1) settles exactly where the law is weaker than the body."""
    slope = float(phantom.rest_volumes[0] / (3 * phantom.volumes[0, 0, 0, 2]))
    B, P, z = -share * slope, 0.0, np.array([1.0, 0.0, 0.0])
    for _ in range(2000):
        z[2] = P
        V = float(phantom.volumes[0] @ z @ z @ z) / float(phantom.rest_volumes[0])
        P = 20.0 - B * (V - 1)
    state = stepped(ElasticPressure(20.0, B), phantom, 0.0)
    assert state.failure is None
    assert pressures(state)[0] == pytest.approx(P, rel=1e-8)


def test_a_pulse_is_the_pressure_asked_for(phantom: Responses) -> None:
    pulse = PulsePressure(dt=1 / 140)  # the pulse's half is at 60 steps
    stepper = pulse.on(phantom)
    state, found = stepper.rest(), []
    for _ in range(120):
        state = stepper.step(state, np.zeros(1))
        found.append(float(pressures(state)[0]) / MMHG)
    assert (max(found), min(found)) == pytest.approx((120.0, 80.0), abs=1e-9)
    assert (np.argmax(found), np.argmin(found)) == (59, 119)
    assert volume_ratios(phantom, state)[0] == pytest.approx(
        float(np.polyval(cubic(phantom.volumes[0], still(phantom), 2), 80 * MMHG))
        / phantom.rest_volumes[0]
    )


def test_a_pulse_says_where_the_linear_model_ends(phantom: Responses) -> None:
    """80 mmHg swell this body by more than half: beyond the 30 % that the paper's line spans."""
    high = stepped(PulsePressure(), phantom, 0.0)
    low = stepped(PulsePressure(low=100.0, high=200.0), phantom, 0.0)
    assert high.numbers["cyst.beyond_linear"] == 1.0
    assert low.numbers["cyst.beyond_linear"] == 0.0


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: ExactPressure(1.0, 0.0), "bulk modulus 0 Pa"),
        (lambda: ExactPressure(1.0, -5.0), "bulk modulus -5 Pa"),
        (lambda: ElasticPressure(stiffness=0.0), "a stiffness other than zero"),
        (lambda: ElasticPressure(preset=math.nan), "expected finite values"),
        (lambda: PulsePressure(rate=-1.0), "a rate of 0 or more"),
        (lambda: PulsePressure(dt=0.0), "a positive step"),
        (lambda: PulsePressure(high=math.inf), "finite numbers"),
    ],
)
def test_laws_without_sense_are_refused(made, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SceneError, match=words):
        made()


@pytest.mark.parametrize("update", ["golden", "piecewise"])
def test_a_search_over_one_pressure_is_refused_for_two(
    two_cavities: Responses, update: UpdateName
) -> None:
    with pytest.raises(SceneError, match="supports one cavity"):
        PressureLoop(update=update).on(two_cavities)


def test_a_line_search_that_cannot_reach_says_so(phantom: Responses) -> None:
    """Squeezed beyond the 30 % of volume that it looks at."""
    state = stepped(PressureLoop(update="golden"), phantom, 0.045)
    assert state.failure is not None
    assert state.failure[0] == "not_converged"
