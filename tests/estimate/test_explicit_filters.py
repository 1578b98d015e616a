"""The filters' contract for those on the explicit step, at large strain."""

from dataclasses import replace

import numpy as np
import pytest
from filter_scenes import CENTRE, at_nodes, cube, plain, ramp, run

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.estimate.ensemble.ensemble_kf import EnsembleKf
from validate.estimate.ensemble.member_filter import MemberModel
from validate.estimate.ensemble.roukf import Roukf
from validate.estimate.extended.node_ekf import NodeEKF
from validate.estimate.filters import FILTERS, Filter
from validate.estimate.measurements import Measurements
from validate.estimate.reduced.reduced_ekf import ReducedEKF
from validate.fem.system import System
from validate.solve.types import Uncertain

H = 4e-4
STEPS = 60
SETTINGS: tuple[Filter, ...] = (
    NodeEKF(H, correct_previous=True),
    NodeEKF(H, block="node", covariance="joseph", correct_previous=True),
    NodeEKF(H, block="companion"),
    ReducedEKF(H, shapes=6),
    ReducedEKF(H, shapes=6, gains="steady"),
    ReducedEKF(H, basis="pod", shapes=4, snapshot_load=3.0),
    Roukf(H, parameters=("stiffness", "load.push")),
    EnsembleKf(H, parameters=("stiffness", "load.push"), sd=(0.2,), radius=0.1, beyond_limit="run"),
)
Case = tuple[System, Measurements, Floats, Floats]


@pytest.fixture(scope="module")
def pushed() -> Case:
    """The body, node A at every second step (a fifth too far), inputs, the plain run."""
    system, inputs = cube(), ramp(H, STEPS, 3.0, 0.01)
    truth = plain(system, H, inputs)
    node = system.scene.mesh.nearest_node(np.array(CENTRE))
    t = H * np.arange(2, STEPS + 1, 2)
    z = 1.2 * truth[1::2, 3 * node : 3 * node + 3]
    return system, at_nodes(system, [node], t, z, 3e-5), inputs, truth


def test_all_of_them_are_tested() -> None:
    assert {type(s) for s in SETTINGS} == {f for f in FILTERS if set(f.handles.law) != {"linear"}}


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_an_explicit_filter_steps_and_says_what_its_states_mean(
    settings: Filter, pushed: Case
) -> None:
    """A step leaves its state as it was: the same step again is the same."""
    system, measured, inputs, _ = pushed
    stepper, mesh = settings.prepare(system, measured), system.scene.mesh
    assert isinstance(stepper, Uncertain)
    rest = stepper.rest()
    assert np.abs(stepper.field(rest)).max() == 0.0
    first = stepper.step(rest, inputs[0])
    state, again = stepper.step(first, inputs[1]), stepper.step(first, inputs[1])
    assert state.failure is None
    assert state.k == 2
    assert np.array_equal(stepper.field(state), stepper.field(again))
    assert np.array_equal(stepper.sd(state), stepper.sd(again))
    sd = stepper.sd(state)
    assert stepper.field(state).shape == sd.shape == mesh.nodes.shape
    assert (sd >= 0).all()
    assert np.abs(sd[mesh.facet_nodes("z0")]).max() == 0.0
    assert sd.max() > 0


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_traces_of_explicit_filters_hold_nis_and_innovations(
    settings: Filter, pushed: Case
) -> None:
    system, measured, inputs, _ = pushed
    z = measured.z.copy()
    z[4] = np.nan
    found = run(settings.prepare(system, replace(measured, z=z)), H, inputs, 10)
    assert found.finished
    dof = found.traces["nis.dof"].y
    assert set(np.flatnonzero(dof)) == {k for k in range(1, STEPS, 2) if k != 9}
    assert set(dof) == {0.0, 3.0}
    assert ((found.traces["nis"].y > 0) == (dof > 0)).all()
    for name in measured.names:
        assert found.traces[f"innovation.{name}"].unit == "m"
        assert ((found.traces[f"innovation.{name}.sd"].y > 0) == (dof > 0)).all()


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_seeing_nothing_an_explicit_filter_is_the_plain_run(settings: Filter, pushed: Case) -> None:
    system, measured, inputs, truth = pushed
    blind = replace(measured, z=np.full_like(measured.z, np.nan))
    if isinstance(settings, MemberModel):
        settings = replace(settings, sd=(1e-12,))
    found = run(settings.prepare(system, blind), H, inputs)
    assert found.u.reshape(STEPS, -1) == pytest.approx(truth, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_an_explicit_filter_that_no_measurement_reaches_is_invalid(
    settings: Filter, pushed: Case
) -> None:
    system, measured, inputs, _ = pushed
    closed = replace(settings, gate=1e-300)  # type: ignore[type-var]
    blind = replace(measured, z=np.full_like(measured.z, np.nan))
    for filter_, given, says in (
        (settings, blind, "0 of 30 measurements reached the filter (30 have all components"),
        (closed, measured, "0 of 30 measurements reached the filter (30 were met, and the gate"),
    ):
        found = run(filter_.prepare(system, given), H, inputs)
        assert found.outcome.state == "invalid"
        assert found.outcome.why.startswith(says)


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_an_explicit_filters_gate_takes_an_outlier_for_missing(
    settings: Filter, pushed: Case
) -> None:
    """And what a clock is unsure of widens the claim; without doubt it changes nothing."""
    system, measured, inputs, _ = pushed
    z, gone = measured.z.copy(), measured.z.copy()
    z[10, 0] += 1.0
    gone[10] = np.nan
    gated = replace(settings, gate=1 - 1e-9)  # type: ignore[type-var]
    jumped, missing = (
        run(gated.prepare(system, replace(measured, z=y)), H, inputs) for y in (z, gone)
    )
    assert np.array_equal(jumped.u, missing.u)
    assert jumped.sd is not None
    assert np.array_equal(jumped.sd, missing.sd)
    assert jumped.traces["gate.rejected"].y[21] == 1
    follows = run(settings.prepare(system, replace(measured, z=z)), H, inputs)
    if isinstance(settings, MemberModel):  # a constant does not come back
        assert "set a gate against outliers" in follows.outcome.why
    else:
        seen, gone = follows.u[: len(missing.u)], missing.u[: len(follows.u)]
        assert not np.allclose(seen, gone, atol=1e-3)
    plain = run(settings.prepare(system, measured), H, inputs)
    late = replace(measured, sd_t=0.01)
    sure = run(replace(settings, clock=0.0).prepare(system, late), H, inputs)  # type: ignore[type-var]
    assert np.array_equal(plain.u, sure.u)
    wide = run(settings.prepare(system, late), H, inputs)
    name = f"innovation.{measured.names[0]}.sd"
    assert wide.traces[name].y[-1] > 1.01 * plain.traces[name].y[-1]


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_an_explicit_filter_sees_no_future(settings: Filter, pushed: Case) -> None:
    """Another future leaves the past as it is; another present moves the estimate."""
    system, measured, inputs, _ = pushed
    z = measured.z.copy()
    z[15:] += 0.001
    one, two = (
        run(settings.prepare(system, m), H, inputs).u for m in (measured, replace(measured, z=z))
    )
    assert np.array_equal(one[:31], two[:31])
    assert np.abs(one[31] - two[31]).max() > 1e-5


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
@pytest.mark.parametrize("sd", [1e-9, 1.0])
def test_extreme_noise_leaves_an_explicit_filter_finite(
    settings: Filter, sd: float, pushed: Case
) -> None:
    """A steady gain of readings that say nothing is refused instead, in words."""
    system, measured, inputs, _ = pushed
    rough = replace(measured, sd=np.full(3, sd))
    if sd == 1.0 and isinstance(settings, ReducedEKF) and settings.gains == "steady":
        with pytest.raises(ComparisonError, match="use the sequence of gains"):
            settings.prepare(system, rough)
        return
    stepper = settings.prepare(system, rough)
    found = run(stepper, H, inputs, 10)
    assert found.finished
    assert found.sd is not None
    assert np.isfinite(found.sd).all()


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_explicit_filters_refuse_times_between_their_steps(settings: Filter, pushed: Case) -> None:
    system, measured, _, _ = pushed
    with pytest.raises(ComparisonError, match="off its nearest step; take dt"):
        settings.prepare(system, replace(measured, t=measured.t + H / 4))
