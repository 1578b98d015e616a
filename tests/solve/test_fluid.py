"""Pressure schemes on the phantom of paper 000: its numbers, its extremes, contracts."""

from dataclasses import FrozenInstanceError, is_dataclass, replace

import numpy as np
import pytest
from fluid_steps import NINE, pressures, stepped, volume_ratios
from hypothesis import given, settings
from hypothesis import strategies as st
from phantoms import COARSE_GRID, grid_mesh, phantom_mesh, phantom_responses, phantom_scene

from validate.errors import SceneError
from validate.fem.system import Responses, build
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.fluid.cavities import ExactPressure, NoFluid, PulsePressure
from validate.solve.fluid.pressure_curve import pressure_at_volume, tuned_gain
from validate.solve.fluid.pressure_loop import PressureLoop
from validate.solve.schemes import schemes_that
from validate.solve.types import Scheme

# Contracts of every scheme


LINEAR = schemes_that(lambda h: "linear" in h.law and h.cavities and "needle" not in h.contact)


@pytest.mark.parametrize("scheme", LINEAR, ids=lambda s: s.__name__)
def test_every_scheme_prepares_rests_and_steps(scheme: type[Scheme], phantom: Responses) -> None:
    settings_ = scheme()
    stepper = settings_.on(phantom)
    assert stepper.responses is phantom
    rest = stepper.rest()
    assert not rest.inner.surface.any()
    assert not rest.inner.z.any()
    state = stepper.step(rest, NINE)
    nodes = np.unique(np.concatenate([phantom.scene.mesh.facet_nodes(n) for n in ("cavity", "x1")]))
    assert state.failure is None
    assert state.k == 1
    assert state.inner.z[0] == 0.009
    assert state.inner.z.shape == (2,)
    full = np.tensordot(state.inner.z, phantom.fields, 1)
    assert state.inner.surface == pytest.approx(full[nodes].ravel(), abs=1e-15)
    assert rest.inner.surface.shape == state.inner.surface.shape
    numbers = {"stage.force": (phantom.reactions @ state.inner.z)[0]}
    numbers |= {"cyst.pressure": state.inner.z[1]}
    numbers |= {"cyst.volume_ratio": volume_ratios(phantom, state)[0]}
    assert {k: state.numbers[k] for k in numbers} == pytest.approx(numbers, rel=1e-12)
    assert set(stepper.units) == set(state.numbers)
    for thing in (settings_, stepper, state):
        assert is_dataclass(thing)
        with pytest.raises(FrozenInstanceError):
            thing.k = None  # type: ignore[misc, union-attr]


@pytest.mark.parametrize(
    "scheme", [s for s in LINEAR if s is not PulsePressure], ids=lambda s: s.__name__
)
def test_no_drive_gives_no_pressure_and_no_update(scheme: type[Scheme], phantom: Responses) -> None:
    state = stepped(scheme(), phantom, 0.0)
    assert state.updates == 0
    assert not pressures(state).any()
    assert not state.inner.surface.any()


@pytest.mark.parametrize("scheme", LINEAR, ids=lambda s: s.__name__)
def test_every_scheme_runs_a_scene_without_cavity(scheme: type[Scheme]) -> None:
    mesh = grid_mesh((3, 3, 3))
    drives = (Drive("press", "x1", (-1.0, 0.0, 0.0)),)
    dry = Responses.of(
        build(Scene(mesh, Material(1.0, 0.3), (Support("x0", (0, 1, 2)),), (), drives))
    )
    state = stepped(scheme(), dry, 0.1)
    assert pressures(state).shape == (0,)
    assert state.inner.surface.shape == (27,)
    assert state.failure is None


@pytest.mark.parametrize("scheme", LINEAR, ids=lambda s: s.__name__)
def test_scene_that_nothing_moves_is_refused(scheme: type[Scheme]) -> None:
    held = Scene(grid_mesh((3, 3, 3)), Material(1.0, 0.3), (Support("x0", (0, 1, 2)),))
    with pytest.raises(SceneError, match="nothing moves"):
        scheme().on(Responses.of(build(held)))


@pytest.mark.parametrize(
    "scheme", [ExactPressure(), PressureLoop(tolerance=1e-6)], ids=["exact", "loop"]
)
@pytest.mark.parametrize("E", [15.2e-3, 15.2e9])
def test_modulus_moves_pressure_and_force_only(
    scheme: Scheme, phantom: Responses, E: float
) -> None:
    other = phantom_responses(E=E)
    one, two = (stepped(scheme, r, NINE) for r in (phantom, other))
    factor = E / 15_200
    assert two.inner.surface == pytest.approx(one.inner.surface, abs=1e-12)
    assert pressures(two) / factor == pytest.approx(pressures(one), rel=1e-10)
    force = phantom.reactions @ one.inner.z
    assert other.reactions @ two.inner.z / factor == pytest.approx(force, rel=1e-10)


# Numbers computed apart, with another code


def test_dry_cavity_loses_volume(phantom: Responses) -> None:
    state = stepped(NoFluid(), phantom, NINE)
    assert not pressures(state).any()
    assert volume_ratios(phantom, state)[0] == pytest.approx(0.9219, abs=1e-4)


@pytest.mark.parametrize(("stage", "pressure"), [(0.003, 480.0), (0.006, 1101.0), (0.009, 1865.0)])
def test_published_pressures(phantom: Responses, stage: float, pressure: float) -> None:
    state = stepped(ExactPressure(), phantom, stage)
    assert pressures(state)[0] == pytest.approx(pressure, rel=1e-3)


def test_published_plate_force(phantom: Responses) -> None:
    state = stepped(ExactPressure(), phantom, NINE)
    assert (phantom.reactions @ state.inner.z)[0] == pytest.approx(6.99, rel=1e-3)


def test_fluid_and_bonded_plates_resist(phantom: Responses) -> None:
    bonded = phantom_responses(bonded=True)
    force = {
        (name, s): float((r.reactions @ stepped(scheme, r, NINE).inner.z)[0])
        for name, r in (("slip", phantom), ("bonded", bonded))
        for s, scheme in (("dry", NoFluid()), ("fluid", ExactPressure()))
    }
    assert force["slip", "dry"] < force["slip", "fluid"] < force["bonded", "dry"]
    assert force["bonded", "dry"] < force["bonded", "fluid"]
    assert pressures(stepped(ExactPressure(), bonded, NINE))[0] > 2 * 1865


def test_tuned_gain_is_the_line_through_61_points(phantom: Responses) -> None:
    """Kp as section 3.3 defines it, fitted here with the normal equations on roots found here."""
    ratios = np.linspace(0.7, 1.3, 61)
    form, at = phantom.volumes[0], 2
    terms = [form[at, at, at], 3 * form[0, at, at], 3 * form[0, 0, at], form[0, 0, 0]]
    P = np.zeros(61)
    for _ in range(60):
        P -= (np.polyval(terms, P) - ratios * terms[3]) / np.polyval(np.polyder(terms), P)
    x = ratios - ratios.mean()
    assert tuned_gain(phantom) == pytest.approx((x @ P) / (x @ x), rel=1e-10)
    assert pressure_at_volume(phantom, ratios) == pytest.approx(P, rel=1e-9, abs=1e-6)
    line = np.polyval(np.polyfit(ratios, P, 1), ratios)
    assert 1 - ((P - line) ** 2).sum() / ((P - P.mean()) ** 2).sum() > 0.99
    assert pressure_at_volume(phantom, np.array([1.0]))[0] == pytest.approx(0.0, abs=1e-8)


def test_plate_work_and_fluid_work_are_strain_energy() -> None:
    """u . K u = F d + P f_p . u, with f_p . u the linear change of volume."""
    r = phantom_responses(COARSE_GRID)
    K = build(phantom_scene(phantom_mesh(COARSE_GRID))).K
    state = stepped(ExactPressure(), r, NINE)
    u = np.tensordot(state.inner.z, r.fields, 1).ravel()
    force = float((r.reactions @ state.inner.z)[0])
    swelling = float(3 * r.volumes[0, 0, 0, 1:] @ state.inner.z)
    work = force * 0.009 + pressures(state)[0] * swelling
    assert u @ (K @ u) == pytest.approx(work, rel=1e-11)


# The exact pressure


@settings(max_examples=60)
@given(st.floats(-0.02, 0.03), st.floats(-0.02, 0.03))
def test_exact_pressure_keeps_the_volume_from_any_start(first: float, second: float) -> None:
    r = phantom_responses()
    stepper = ExactPressure().on(r)
    state = stepper.rest()
    for drive in (first, second):
        state = stepper.step(state, np.array([drive]))
        assert state.failure is None
        assert abs(volume_ratios(r, state)[0] - 1) < 1e-13
    cold = stepper.step(stepper.rest(), np.array([second]))
    assert pressures(state) == pytest.approx(pressures(cold), rel=1e-9, abs=1e-8)


@pytest.mark.parametrize("ratio", [0.1, 0.7, 1.3, 3.0])
def test_exact_pressure_holds_another_volume(phantom: Responses, ratio: float) -> None:
    state = stepped(ExactPressure(ratio), phantom, 0.0)
    assert volume_ratios(phantom, state)[0] == pytest.approx(ratio, rel=1e-13)
    curve = pressure_at_volume(phantom, np.array([ratio]))
    assert pressures(state) == pytest.approx(curve, rel=1e-9)


def test_exact_pressure_of_two_cavities(two_cavities: Responses) -> None:
    """Against a hand-made fixed point with the gain matrix of the rest shape."""
    r = two_cavities
    state = stepped(ExactPressure(), r, 0.006)
    assert np.abs(volume_ratios(r, state) - 1).max() < 1e-13
    gain = np.linalg.inv(3 * r.volumes[:, 0, 0, 2:])
    z = np.array([1.0, 0.006, 0.0, 0.0])
    for _ in range(60):
        z[2:] += gain @ (r.rest_volumes - r.volumes @ z @ z @ z)
    assert pressures(state) == pytest.approx(z[2:], rel=1e-10)
    assert pressures(state)[0] != pytest.approx(pressures(state)[1], rel=0.01)
    assert state.updates <= 6


def test_two_cavities_are_reciprocal(two_cavities: Responses) -> None:
    """A pascal in one swells the other as a pascal in the other swells the first."""
    compliance = 3 * two_cavities.volumes[:, 0, 0, 2:]
    assert compliance[0, 1] == pytest.approx(compliance[1, 0], rel=1e-11)
    assert two_cavities.reactions[0, 1:] == pytest.approx(
        -3 * two_cavities.volumes[:, 0, 0, 1], rel=1e-11
    )
    box = np.array([2 * 2 * 2, 3 * 2 * 2]) * (0.06 / 9) * (0.03 / 4) ** 2
    assert two_cavities.rest_volumes == pytest.approx(box, rel=1e-13)


@pytest.mark.parametrize("ratio", [0.0, -0.5, float("nan")])
def test_volume_ratio_must_be_positive(ratio: float) -> None:
    with pytest.raises(SceneError, match="expected a positive fluid volume"):
        ExactPressure(ratio)


@pytest.mark.parametrize("ratio", [0.0, -1.0, 0.01, 0.07])
def test_volume_that_no_pressure_gives_is_refused(phantom: Responses, ratio: float) -> None:
    """The curve's minimum is 0.074; below it a cubic still has a root, past its turning points."""
    with pytest.raises(SceneError, match=rf"no pressure gives V/V0 = {ratio:g}"):
        pressure_at_volume(phantom, np.array([1.0, ratio]))


@pytest.mark.parametrize("ratio", [0.0, -1.0])
def test_empty_cavity_is_refused_where_the_curve_passes_zero(
    phantom: Responses, ratio: float
) -> None:
    """A volume linear in pressure has a root for any ratio: V/V0 = 1 + P / 100 Pa."""
    form = np.zeros((1, 3, 3, 3))
    form[0, 0, 0, 0] = 1.0
    form[0, 0, 0, 2] = form[0, 0, 2, 0] = form[0, 2, 0, 0] = 1 / 300
    linear = replace(phantom, volumes=form)
    assert pressure_at_volume(linear, np.array([0.5, 1.5])) == pytest.approx([-50, 50])
    with pytest.raises(SceneError, match="no pressure gives V/V0"):
        pressure_at_volume(linear, np.array([ratio]))


@pytest.mark.parametrize("ratio", [1e-3, 0.01, 0.07])
def test_exact_pressure_says_when_no_pressure_keeps_the_volume(
    phantom: Responses, ratio: float
) -> None:
    failure = stepped(ExactPressure(ratio), phantom, 0.0).failure
    assert failure is not None
    assert failure[0] == "not_converged"


def test_root_past_a_turning_point_is_not_taken_for_a_solution(phantom: Responses) -> None:
    """A stage driven 200 mm into a 60 mm block: Newton finds a root of a collapsed cavity."""
    failure = stepped(ExactPressure(), phantom, 0.2).failure
    assert failure is not None
    assert "spurious root" in failure[1]


def _straight(r: Responses, slope: float, squeezed: float) -> Responses:
    """Volumes V = 1 + slope P - squeezed q of every cavity alone."""
    count = len(r.volumes)
    forms = np.zeros((count, 2 + count, 2 + count, 2 + count))
    for i in range(count):
        p = 2 + i
        forms[i, 0, 0, 0] = 1.0
        for at in ((0, 0, p), (0, p, 0), (p, 0, 0)):
            forms[(i, *at)] = slope / 3
        for at in ((0, 0, 1), (0, 1, 0), (1, 0, 0)):
            forms[(i, *at)] = -squeezed / 3
    return replace(r, volumes=forms)


def test_a_straight_line_takes_one_update_and_rounding_one_more(
    phantom: Responses, two_cavities: Responses
) -> None:
    for r in (phantom, two_cavities):
        counts = set()
        for q in (0.7, 0.9, 1.3, 1.7):
            state = stepped(ExactPressure(), _straight(r, 0.3, 1000.0), q)
            assert state.failure is None
            assert pressures(state) == pytest.approx(1000.0 * q / 0.3, rel=1e-12)
            counts.add(state.updates)
        assert counts == {1, 2}
