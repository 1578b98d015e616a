"""One method with one set of parameters on the recordings of a case: scene, runs, residuals."""

from time import perf_counter
from typing import Any

from validate.compare.residual import residuals, stacked
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.recording.types import Recording
from validate.register.registered import Registered
from validate.replay.experiment import Experiment
from validate.replay.followed import MAIN, Followed
from validate.replay.method import Method
from validate.scene.scene import Scene
from validate.solve.march import march
from validate.solve.types import Run, Stepper


def solve(
    experiment: Experiment,
    recordings: tuple[Recording, ...],
    name: str,
    method: Method,
    parameters: Any,
    case: str = MAIN,
) -> Followed:
    """Builds, registers, prepares, runs and compares; children of `ValidateError` for bad input."""
    start = perf_counter()
    scene = experiment.build(recordings[0], parameters, method.scene)
    system = build_system(scene)
    built = perf_counter() - start
    seen = tuple(experiment.place(r, parameters, scene) for r in recordings)
    steppers = _Prepared(experiment, method, parameters, system, built)
    runs = tuple(_run(experiment, name, method, steppers, r) for r in seen)
    found = [r for pair in zip(seen, runs, strict=True) for r in residuals(*pair)]
    return Followed(name, _label(method, scene), case, scene, seen, runs, stacked(found))


class _Prepared:
    """Prepares a scheme once for all recordings, a filter for each: it is given its looks."""

    def __init__(
        self, experiment: Experiment, method: Method, parameters: Any, system: System, built: float
    ) -> None:
        self._experiment, self._method, self._parameters = experiment, method, parameters
        self._system, self._built = system, built
        self._shared: tuple[Stepper, float] | None = None

    def on(self, seen: Registered) -> tuple[Stepper, float]:
        """The stepper, and the seconds that set-up took."""
        if self._shared is not None and not self._method.markers:
            return self._shared
        start = perf_counter()
        given = self._experiment.sets(self._parameters, seen)
        stepper = self._method.prepare(self._system, seen, given)
        self._shared = stepper, self._built + perf_counter() - start
        return self._shared


def _run(
    experiment: Experiment, name: str, method: Method, steppers: _Prepared, seen: Registered
) -> Run:
    """The run through the recorded inputs, as many of them as the method takes."""
    stepper, setup = steppers.on(seen)
    every = slice(method.stride - 1, None, method.stride)
    t, inputs = seen.t[every], seen.inputs[every]
    steps = method.steps or len(t)
    at = seen.frames(len(t), experiment.frames)
    return march(name, stepper, t[:steps], inputs[:steps], at[at < steps], setup)


def _label(method: Method, scene: Scene) -> str:
    """The method's label, and what it was run as where parameters changed that."""
    order = getattr(method.scene, "order", scene.mesh.order)
    return (
        method.label if order == scene.mesh.order else f"{method.label} [order {scene.mesh.order}]"
    )
