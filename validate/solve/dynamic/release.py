"""Release of a body: free vibration under constant loads, and its final state of rest.

The swing is stepped by `NewtonDynamics`, its loads in full from 0 s on; rest is `StaticNewton`'s,
of the relaxed law, at the last instant: what lies between is not stepped through.
"""

from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.laws.viscoelasticity import relaxed
from validate.fem.system import build
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.handles import LARGE_DYNAMICS, Handles, require_handled
from validate.solve.march import march
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Run, Trace


@dataclass(frozen=True)
class LetGo:
    """Settings of the swing's `NewtonDynamics`, with the consistent mass; of both solutions."""

    handles: ClassVar[Handles] = LARGE_DYNAMICS

    dt: float = quantity(0.005, "s", "time step of the swing")
    tolerance: float = quantity(1e-7, "1", "residual relative to the acting forces")
    max_iterations: int = quantity(20, "1", "Newton iterations in a step")

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """At t (nt,) s, steps of dt from 0 s and at last the instant of rest, under inputs (nt, l).

        Raises `SceneError` for times that are not such.
        """
        require_handled(scene, self)
        steps = np.diff(t, prepend=0.0)
        if len(t) < 2 or np.abs(steps[:-1] - self.dt).max() > 1e-6 * self.dt:
            raise SceneError(
                f"LetGo takes steps of dt = {self.dt:g} s after a last instant of rest; the "
                "given times differ"
            )
        start = perf_counter()
        swing = NewtonDynamics(
            self.dt, "average", "consistent", self.tolerance, self.max_iterations
        ).prepare(build(scene))
        swing = replace(swing, held=inputs[0])
        setup, every = perf_counter() - start, np.arange(len(t) - 1)
        moving = march("", swing, t[:-1], inputs[:-1], every, setup)
        if not moving.finished:
            return moving
        static = StaticNewton("none", tolerance=self.tolerance).prepare(build(relaxed(scene)))
        still = march("", static, t[-1:], inputs[-1:], np.array([0]), 0.0)
        return joined(moving, still, t)


def joined(moving: Run, still: Run, t: Floats) -> Run:
    """One run of a swing and, at the last of t (nt,) s, its rest; without a rest it ends with the
    swing."""
    if not still.finished:
        outcome = replace(still.outcome, step=len(t) - 1)
        return replace(moving, outcome=outcome)
    both = moving.traces.keys() & still.traces.keys()
    traces = {
        name: Trace(np.concatenate([trace.y, still.traces[name].y]), trace.unit)
        for name, trace in moving.traces.items()
        if name in both
    }
    outcome = replace(moving.outcome, step=len(t))
    u = np.concatenate([moving.u, still.u])
    return replace(moving, t=t, at=np.arange(len(t)), u=u, traces=traces, outcome=outcome)
