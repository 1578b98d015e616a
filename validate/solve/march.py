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
    fields = [stepper.field(states[i]) for i in kept]
    u = np.array(fields) if fields else np.zeros((0, *stepper.scene.mesh.nodes.shape))
    updates = np.array([float(s.updates) for s in states])
    traces = {"updates": Trace(updates, "1")} | stepper.traces(states)
    times = _step_times(seconds[_UNTIMED:] if done > 2 * _UNTIMED else seconds)
    return Run(method, t[:done], kept, u, traces, outcome, setup_s, times)


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


def _step_times(seconds: Floats) -> StepTimes:
    p50, p99 = np.quantile(seconds, [0.5, 0.99])
    return StepTimes(float(p50), float(p99), float(seconds.max()), len(seconds))
