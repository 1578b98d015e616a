"""The covariance of tracked points carried linearly into everything that a static run tells.

P_y = J P J^T for fields and traces y, with the columns J L_i, L L^T = P, as differences of runs
whose inputs are off by L_i at all times: exact for linear bodies, first order for others. The error
of a tracked point is one and the same in every step.
"""

from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.parameters import part
from validate.scene.scene import Scene
from validate.solve.handles import LARGE, Handles
from validate.solve.march import march
from validate.solve.quasi_static import QuasiStatic
from validate.solve.types import Outcome, Run, Scheme, Trace


@dataclass(frozen=True)
class Propagated:
    """Settings: the static scheme `inner`, run once and once for every independent deviation.

    The run has `sd` (nt, n, d) m of the field and `<trace>.sd` of every trace that varies.
    """

    handles: ClassVar[Handles] = Handles(
        ("linear", *LARGE),
        inertia=False,
        cavities=True,
        contact=("foundations", "membranes", "rigid"),
    )

    inner: Scheme = part(QuasiStatic(), "the static scheme whose inputs are uncertain")

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """Raises `SceneError` for a scheme in time, a scene without covariances, and what the
        inner scheme does not handle."""
        if self.inner.handles.inertia and getattr(self.inner, "rule", "") != "static":
            raise SceneError(
                f"{type(self.inner).__name__} marches in time, where an error of inputs that is "
                "there from the first step on is a jolt; take a static scheme"
            )
        off = _deviations(scene)
        if not len(off):
            raise SceneError(
                f"{len(scene.tracked)} sets follow tracked points, none with a covariance; give "
                "one, or run the inner scheme alone"
            )
        start = perf_counter()
        stepper = self.inner.prepare(build(scene))
        setup, every = perf_counter() - start, np.arange(len(t))
        run = march("", stepper, t, inputs, every, setup)
        shifted = [march("", stepper, t, inputs + d, every, 0.0) for d in off]
        for k, other in enumerate((run, *shifted)):
            if not other.finished:
                return _ended(run, other, k, len(off))
        return _carried(run, shifted)


def _deviations(scene: Scene) -> Floats:
    """(r, inputs) m: each set's deviations at the inputs of its points."""
    names, rows = scene.inputs, []
    for follower in scene.tracked:
        own = follower.deviations()
        full = np.zeros((len(own), len(names)))
        full[:, [names.index(name) for name in follower.inputs]] = own
        rows.append(full)
    return np.concatenate([*rows, np.zeros((0, len(names)))])


def _ended(run: Run, other: Run, k: int, of: int) -> Run:
    """The run, cut to what it and the failed one have, with the latter's reason."""
    if k == 0:
        return run
    n = len(other.t)
    why = f"with deviation {k} of {of}: {other.outcome.why}"
    traces = {name: Trace(trace.y[:n], trace.unit) for name, trace in run.traces.items()}
    outcome = Outcome(other.outcome.state, other.outcome.step, why)
    return replace(run, t=run.t[:n], at=run.at[:n], u=run.u[:n], traces=traces, outcome=outcome)


def _carried(run: Run, shifted: list[Run]) -> Run:
    """The run with standard deviations from those with shifted inputs."""
    sd = np.sqrt(sum((other.u - run.u) ** 2 for other in shifted))
    traces = dict(run.traces)
    for name, trace in run.traces.items():
        square = sum((other.traces[name].y - trace.y) ** 2 for other in shifted)
        if name != "updates" and np.any(square):
            traces[f"{name}.sd"] = Trace(np.sqrt(square), trace.unit)
    return replace(run, traces=traces, sd=np.asarray(sd))
