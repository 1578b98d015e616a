"""Solution of a case: one method with one set of parameters on its recordings."""

import resource
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.residual import Residual, stacked
from validate.fem.assembly.locate import Rows
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.run.method_run import MAIN, MethodRun
from validate.recording.types import Recording
from validate.register.observation import nearest_samples
from validate.register.registration import Registered
from validate.scene.meshless import AnyScene, Meshless
from validate.scene.scene import Scene
from validate.solve.march import Tell, march, run_scheme
from validate.solve.types import Outcome, Run, SceneSolver, Stepper, Trace


def solve(
    experiment: Experiment,
    recordings: tuple[Recording, ...],
    name: str,
    method: Method,
    parameters: Any,
    case: str = MAIN,
    tell: Tell = lambda _: None,
    refused: str = "",
    off: tuple[float, ...] = (),
) -> MethodRun:
    """Builds, registers, prepares, runs and compares; children of `ValidateError` for bad input.

    `tell` is given what is being done, in words. A method that is `refused`, for that reason, has
    its scene built and is not run. Drives are `off` by these amounts, one an input of the scene.
    """
    start = perf_counter()
    tell("mesh")
    scenes = _scenes(experiment, recordings, method, parameters)
    built, scene = perf_counter() - start, scenes[0]
    seen = _registered(experiment, recordings, scenes, parameters, off)
    runs = _Runs(experiment, name, method, parameters, scene, built, tell)
    none = np.zeros(0)
    not_run = Run("", none, none.astype(np.int64), np.zeros((0, 0, 3)),
                  {"updates": Trace(none, "1")}, Outcome("refused", 0, refused),
                  0.0, None)  # fmt: skip
    done = tuple(not_run if refused else runs.on(*pair) for pair in zip(seen, scenes, strict=True))
    found = [r for pair in zip(seen, done, strict=True) for r in Residual.of(*pair)]
    peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # bytes, of this process
    done = tuple(replace(run, memory=run.memory or peak) for run in done)
    # What the method was run as, where parameters changed that
    own = scene.mesh.order
    order = getattr(method.scene, "order", own)
    label = method.label if order == own else f"{method.label} [order {own}]"
    if getattr(method.settings, "smooth", False):
        label = f"{label} [smoothed: uses future samples]"
    return MethodRun(name, label, case, scene, seen, done, stacked(found))


def placed(
    experiment: Experiment,
    recordings: tuple[Recording, ...],
    method: Method,
    parameters: Any,
    off: tuple[float, ...] = (),
) -> tuple[tuple[AnyScene, ...], tuple[Registered, ...]]:
    """Return the scene of every recording, and the recording as it is registered there, its drives
    `off` by these amounts."""
    scenes = _scenes(experiment, recordings, method, parameters)
    return scenes, _registered(experiment, recordings, scenes, parameters, off)


def _registered(
    experiment: Experiment,
    recordings: tuple[Recording, ...],
    scenes: tuple[AnyScene, ...],
    parameters: Any,
    off: tuple[float, ...],
) -> tuple[Registered, ...]:
    pairs = zip(recordings, scenes, strict=True)
    seen = tuple(experiment.place(r, parameters, s) for r, s in pairs)
    return tuple(one.shifted(off) for one in seen) if off else seen


def _scenes(
    experiment: Experiment, recordings: tuple[Recording, ...], method: Method, parameters: Any
) -> tuple[AnyScene, ...]:
    """One scene for all recordings; a material point of its own for each, since every test of one
    material may be in another mode."""
    first = experiment.build(recordings[0], parameters, method.scene)
    if not isinstance(first, Meshless):
        return (first,) * len(recordings)
    others = (experiment.build(r, parameters, method.scene) for r in recordings[1:])
    return (first, *others)


@dataclass(frozen=True)
class KeptFields:
    """What a run keeps besides its traces: fields at times t (m,) s (None: as the experiment has
    it), and the displacements of `points` at every step. `system`: that of the scene, where it is
    built already."""

    t: Floats | None = None
    points: Rows | None = None
    system: System | None = None


def run_on(
    experiment: Experiment,
    name: str,
    method: Method,
    parameters: Any,
    scene: AnyScene,
    seen: Sequence[Registered],
    kept: KeptFields = KeptFields(),
) -> tuple[Run, ...]:
    """Return the runs of a method on recordings as they are registered: a filter's on other
    samples, say."""
    runs = _Runs(experiment, name, method, parameters, scene, 0.0, lambda _: None, kept)
    return tuple(runs.on(one, scene) for one in seen)


class _Runs:
    """Prepares a scheme once for all recordings, a filter for each: it is given its looks.

    Set-up is the scene, its assembly and the preparation.
    """

    def __init__(
        self,
        experiment: Experiment,
        name: str,
        method: Method,
        parameters: Any,
        scene: AnyScene,
        built: float,
        tell: Tell,
        kept: KeptFields = KeptFields(),
    ) -> None:
        unknowns = f"{scene.mesh.nodes.size} unknowns"
        self._tell: Tell = lambda what: tell(f"{unknowns}, {what}")
        self._experiment, self._name, self._method = experiment, name, method
        self._declared = experiment.methods.get(name)
        self._parameters, self._built = parameters, built
        self._kept, self._system = kept, kept.system
        self._prepared: tuple[Stepper, float] | None = None

    def on(self, seen: Registered, scene: AnyScene) -> Run:
        """The run through the recorded inputs, as many of them as the method takes."""
        method = self._method
        every = slice(method.stride - 1, None, method.stride)
        t, inputs = between(seen.t[every], seen.inputs[every], method.split, sudden=seen.sudden)
        steps = method.steps or len(t)
        self._tell("set-up")
        at = seen.frames(t, self._experiment.frames)
        if self._kept.t is not None:
            at = np.unique(nearest_samples(t, self._kept.t, "the run"))
        t, inputs, at = t[:steps], inputs[:steps], at[at < steps]
        given = self._experiment.sets(self._parameters, seen)
        if isinstance(method.settings, SceneSolver) or isinstance(scene, Meshless):
            settings = method.given(given, self._declared)
            return run_scheme(
                self._name, settings, scene, t, inputs, at, self._tell, self._kept.points
            )
        stepper, setup = self._stepper(scene, seen, given)
        return march(self._name, stepper, t, inputs, at, setup, self._tell, self._kept.points)

    def _stepper(
        self, scene: Scene, seen: Registered, given: Mapping[str, Any]
    ) -> tuple[Stepper, float]:
        """The prepared stepper, and the seconds that took."""
        if self._prepared is None or self._method.markers:
            start = perf_counter()
            self._system = self._system or build_system(scene)
            stepper = self._method.prepare(self._system, seen, given, self._declared)
            self._prepared = stepper, self._built + perf_counter() - start
        return self._prepared


def between(
    t: Floats, inputs: Floats, split: int, *, sudden: bool = False
) -> tuple[Floats, Floats]:
    """Times (nt,) s and inputs (nt, k) with so many steps in one, straight from rest at 0 s;
    `sudden` ones have their first value from 0 s on."""
    if split == 1:
        return t, inputs
    at = np.arange(split * len(t) + 1) / split
    known = np.arange(len(t) + 1)
    starts = (0.0, *(inputs[0] if sudden else np.zeros(inputs.shape[1])))
    finer = [
        np.interp(at, known, np.append(start, y))[1:]
        for start, y in zip(starts, (t, *inputs.T), strict=True)
    ]
    return finer[0], np.stack(finer[1:], axis=1)
