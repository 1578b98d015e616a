"""The loop over steps, written once: it steps, times, traces and stops where a step fails."""

from time import perf_counter

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError
from validate.solve.types import Outcome, Run, State, Stepper, StepTimes, Trace

_UNTIMED = 20  # first steps left out of the step times: caches and allocators settle


def march(
    method: str, stepper: Stepper, t: Floats, drives: Floats, at: Ints, setup_s: float
) -> Run:
    """Steps through drives (nt, k) m at times t (nt,) s; keeps full fields at the steps `at`."""
    if len(t) == 0 or len(at) == 0:
        raise ComparisonError(f"{method}: {len(t)} steps and {len(at)} output frames; none to do")
    states, seconds, outcome = _walk(stepper, drives)
    done = len(states)
    kept = at[at < done]
    fields = [_field(stepper, states[i]) for i in kept]
    shape = (0, *stepper.responses.fields.shape[1:])
    u = np.array(fields) if fields else np.zeros(shape)
    times = _step_times(seconds[_UNTIMED:] if done > 2 * _UNTIMED else seconds)
    return Run(method, t[:done], kept, u, _traces(stepper, states), outcome, setup_s, times)


def _walk(stepper: Stepper, drives: Floats) -> tuple[list[State], Floats, Outcome]:
    state = stepper.rest()
    states: list[State] = []
    seconds: list[float] = []
    for i, value in enumerate(drives):
        start = perf_counter()
        state = stepper.step(state, value)
        seconds.append(perf_counter() - start)
        if state.failure:
            return states, np.array(seconds), Outcome(state.failure[0], i, state.failure[1])
        states.append(state)
    return states, np.array(seconds), Outcome("finished", len(drives))


def _field(stepper: Stepper, state: State) -> Floats:
    return np.asarray(np.tensordot(state.inputs, stepper.responses.fields, 1))


def _step_times(seconds: Floats) -> StepTimes:
    p50, p99 = np.quantile(seconds, [0.5, 0.99])
    return StepTimes(float(p50), float(p99), float(seconds.max()), len(seconds))


def _traces(stepper: Stepper, states: list[State]) -> dict[str, Trace]:
    r = stepper.responses
    z = np.array([s.inputs for s in states]).reshape(len(states), r.fields.shape[0])
    traces = {"updates": Trace(np.array([float(s.updates) for s in states]), "1")}
    for j, drive in enumerate(r.scene.drives):
        traces[f"{drive.name}.displacement"] = Trace(z[:, j], "m")
        traces[f"{drive.name}.force"] = Trace(z @ r.reactions[j], "N")
    one = np.hstack([np.ones((len(z), 1)), z])
    for i, cavity in enumerate(r.scene.cavities):
        V = np.einsum("abc,ta,tb,tc->t", r.volumes[i], one, one, one, optimize=True)
        traces[f"{cavity.name}.pressure"] = Trace(z[:, r.drives + i], "Pa")
        traces[f"{cavity.name}.volume_ratio"] = Trace(V / r.rest_volumes[i], "1")
    return traces
