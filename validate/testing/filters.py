"""Contract of a filter, on a small cube under tension with one measured node."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.estimate.filters import Filter
from validate.estimate.measurements import Measurements
from validate.solve.types import Uncertain
from validate.testing.pulled_cube import (
    DT,
    PulledCase,
    case,
    refusal,
    require,
    require_documented_settings,
)


def steps_from_rest(settings: Filter) -> None:
    """Rest is zero, a step moves the body, is repeatable, and has the numbers of `units`."""
    pulled = case()
    stepper = settings.prepare(pulled.system, pulled.measured(1))
    mesh = pulled.system.scene.mesh
    rest = stepper.rest()
    require(not stepper.field(rest).any(), "the estimate at rest is displaced")
    state, again = (stepper.step(rest, pulled.inputs[0]) for _ in range(2))
    require(state.failure is None, f"the first step failed: {state.failure}")
    require(state.k == 1, f"after a step k = {state.k}")
    odd = set(state.numbers) ^ set(stepper.units)
    require(not odd, f"numbers without a unit, or units without a number: {sorted(odd)}")
    u = stepper.field(state)
    require(u.shape == mesh.nodes.shape, f"a field {u.shape}: expected {mesh.nodes.shape}")
    require(np.array_equal(u, stepper.field(again)), "two steps from one state differ")
    if isinstance(stepper, Uncertain):
        sd = stepper.sd(state)
        require(sd.shape == u.shape, f"standard deviations {sd.shape}: expected {u.shape}")
        require((sd >= 0).all() and sd.max() > 0, "standard deviations below 0, or none above it")
        require(not sd[mesh.facet_nodes("z0")].any(), "nodes that are held are uncertain")


def it_is_given_measurements_only(settings: Filter) -> None:
    """`offered` are the measurements that `prepare` was given."""
    seen = case().measured(1)
    offered = settings.prepare(case().system, seen).offered
    require(np.array_equal(offered.z, seen.z), "offered measurements differ from the given ones")


def without_measurements_it_is_its_model(settings: Filter) -> None:
    """Missing measurements, whichever, leave one and the same finite estimate."""
    pulled = case()
    blind = [_run(settings, pulled, _unseen(pulled.measured(seed))) for seed in (1, 2)]
    require(np.isfinite(blind[0]).all(), "without a measurement the estimate is not finite")
    require(np.array_equal(blind[0], blind[1]), "missing measurements change the estimate")


def it_uses_what_is_measured_and_no_later(settings: Filter) -> None:
    """Another future leaves the past as it is; another present moves the estimate."""
    pulled = case()
    seen = pulled.measured(1)
    z = seen.z.copy()
    z[30:] += 0.001
    one, other = (_run(settings, pulled, m) for m in (seen, replace(seen, z=z)))
    require(np.array_equal(one[0], other[0]), "a measurement changes estimates before it")
    moved = np.abs(one[1] - other[1]).max()
    require(moved > 1e-6, f"measurements that move by 1 mm move the estimate by {moved:.3g} m")


def extreme_noise_leaves_it_finite(settings: Filter) -> None:
    """Measurements of a declared standard deviation of 1 m, at every other step."""
    pulled = case()
    seen = pulled.measured(1, every=2)
    found = _run(settings, pulled, replace(seen, sd=np.ones(len(seen.names))))
    require(np.isfinite(found).all(), "with measurements of sd 1 m the estimate is not finite")


def refuses_measurements_between_steps(settings: Filter) -> None:
    """One line with the time and a step that fits."""
    pulled = case()
    seen = pulled.measured(1)
    late = replace(seen, t=seen.t + DT / 4)
    line = refusal(lambda: settings.prepare(pulled.system, late))
    require("take dt" in line, f"the refusal names no step that fits: {line}")


def every_setting_is_documented(settings: Filter) -> None:
    """Each field has a sentence and a unit; those that `noise_settings` names exist."""
    require_documented_settings(type(settings))
    noise = settings.noise_settings
    named = [name for name in (noise.process, noise.measurement, noise.start) if name]
    unknown = [name for name in named if not hasattr(settings, name)]
    require(not unknown, f"noise_settings names {unknown}, which are no settings")


def _unseen(measurements: Measurements) -> Measurements:
    return replace(measurements, z=np.full(measurements.z.shape, np.nan))


def _run(settings: Filter, pulled: PulledCase, measurements: Measurements) -> Floats:
    """The estimates (2, n, 3) m after steps 30 and 36."""
    stepper = settings.prepare(pulled.system, measurements)
    state, found = stepper.rest(), []
    for k in range(36):
        state = stepper.step(state, pulled.inputs[k])
        require(state.failure is None, f"step {k + 1} failed: {state.failure}")
        if k in (29, 35):
            found.append(stepper.field(state))
    return np.array(found)


#: Checks of a filter's settings.
filter_contract: tuple[Callable[[Filter], None], ...] = (
    steps_from_rest,
    it_is_given_measurements_only,
    without_measurements_it_is_its_model,
    it_uses_what_is_measured_and_no_later,
    extreme_noise_leaves_it_finite,
    refuses_measurements_between_steps,
    every_setting_is_documented,
)
