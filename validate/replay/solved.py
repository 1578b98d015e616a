"""One method with one set of parameters: from its scene to residuals against every recording."""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from validate.compare.residual import Residual
from validate.fem.system import build
from validate.recording.types import Recording
from validate.register.observe import Registered
from validate.replay.experiment import Experiment
from validate.scene.scene import Scene
from validate.solve.march import march
from validate.solve.types import Run


@dataclass(frozen=True)
class Solved:
    """A scene, and per recording its registration and run; residuals over all of them."""

    scene: Scene
    registered: tuple[Registered, ...]
    runs: tuple[Run, ...]
    residuals: Mapping[str, Residual]


def solve(
    experiment: Experiment,
    recordings: tuple[Recording, ...],
    name: str,
    settings: Any,
    parameters: Any,
) -> Solved:
    """Builds, prepares, runs and compares; children of `ValidateError` for bad input."""
    start = perf_counter()
    scene = experiment.build(recordings[0], parameters, settings)
    stepper = experiment.scheme(settings).prepare(build(scene))
    setup = perf_counter() - start
    seen = tuple(experiment.place(r, parameters, scene) for r in recordings)
    runs = tuple(
        march(name, stepper, r.stage.t, r.stage.y, r.steps_at_holds(), setup) for r in seen
    )
    found = [
        experiment.residuals(*pair) for pair in zip(seen, runs, strict=True) if pair[1].finished
    ]
    return Solved(scene, seen, runs, _merged(found))


def _merged(found: list[tuple[Residual, ...]]) -> dict[str, Residual]:
    """Residuals of all recordings by name; repeats of one quantity are stacked."""
    merged: dict[str, Residual] = {}
    for residual in (r for rs in found for r in rs):
        other = merged.get(residual.name)
        if other is not None:
            values = np.vstack([other.values, residual.values])
            residual = Residual(
                residual.quantity, residual.load, values, residual.sd, residual.systematic,
                residual.unit, residual.definition,
            )  # fmt: skip
        merged[residual.name] = residual
    return merged
