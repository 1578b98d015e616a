"""Time, memory and unknowns of a run before its start, and its check against free memory."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.errors import ValidateError
from validate.fem.linear_solvers.factor import solvable_bytes
from validate.memory import MemoryShortError
from validate.parameters import Parameter, describe, with_values
from validate.pipeline.checks.checks import variants_of
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.origins import opened
from validate.pipeline.run.cost import NODAL_MEAN, linear_seconds, newton_seconds
from validate.pipeline.run.runs import ExperimentRuns
from validate.recording.types import Recording
from validate.scene.scene import Scene

_POWER = 0.25  # memory of a factor in space goes with the cells along an edge to the fourth
_MARGIN = 0.9
_NO_COUNTS = ("order", "halvings")
_OF_A_BODY = ("body.cells", "body.edge")  # of a declared geometry


def require_room(
    experiment: Experiment,
    methods: Mapping[str, Method],
    parameters: Any,
    recording: Recording,
    *,
    quick: bool,
) -> None:
    """Raise `MemoryShortError` for what will not fit, before anything is identified or solved."""
    asking = ExperimentRuns(experiment, methods, parameters, None, quick=quick)
    asking.expect(variants_of(asking))
    try:
        asking.require_room(recording)
    except MemoryShortError:
        raise
    except ValidateError:
        # A scene may need what is yet to be identified: then assembly asks for its memory.
        if experiment.identify is None:
            raise


def coarser(name: str, parameters: Any, share: float) -> str:
    """Return the `--set`s that bring memory down to `share` of what it is, as far as parameters
    called mesh.*, or those of a declared body, say how fine the mesh is: counts and lengths of
    cells."""
    by = _MARGIN * share**_POWER
    mesh = [p for p in describe(parameters) if p.path.startswith("mesh.") or p.path in _OF_A_BODY]
    sets = [f"--set {p.path}={value}" for p in mesh if (value := _coarsened(p, by))]
    return f"such as {' '.join(sets)}" if sets else f"see `validate list {name}`"


def _coarsened(parameter: Parameter, by: float) -> str:
    """The value for a mesh whose edges are cut into `by` times as many cells; "" for others."""
    value, last = parameter.default, parameter.path.rpartition(".")[2]
    if isinstance(value, bool) or last in _NO_COUNTS:
        return ""
    if isinstance(value, int):
        return str(max(1, int(by * value)))
    if isinstance(value, list) and all(isinstance(count, int) for count in value):
        return ",".join(str(max(1, int(by * count))) for count in value)
    if isinstance(value, float) and parameter.unit == "m" and value > 0:
        return f"{1e3 * value / by:.3g}mm"
    return ""


_PROGRAM, _PROGRAM_SECONDS = 0.5e9, 8.0  # bytes and s of the program itself and its report
_SOLVE = 4e-8  # s of a solution with a factor, per N^(4/3)
_ASSUMED_E = "10 kPa"  # of a modulus that is identified: it changes no size


@dataclass(frozen=True)
class RunEstimate:
    """About how long all runs take (s), memory at the peak (bytes), unknowns of the finest mesh."""

    seconds: float
    memory: float
    unknowns: float


def estimated(file: Path) -> RunEstimate | None:
    """Return the estimate for the parameters that a file declares; None for a scene without a mesh,
    or one that cannot be built yet."""
    try:
        return _estimated(load_file(file))
    except ValidateError:
        return None


def _estimated(experiment: Experiment) -> RunEstimate | None:
    found = opened(experiment, experiment.parameters)
    described = describe(found.parameters)
    unset = [p.path for p in described if p.path == "material.E" and p.default is None]
    parameters = with_values(found.parameters, dict.fromkeys(unset, _ASSUMED_E.replace(" ", "")))
    experiment = experiment.follows(experiment, found.recordings, parameters)
    runs = ExperimentRuns(experiment, experiment.methods, parameters, None, quick=False)
    variants, scenes = variants_of(runs), {}
    for name in {v.method for v in variants}:
        model = experiment.methods[name].scene
        scene = experiment.build(found.recordings[0], parameters, model)
        if not isinstance(scene, Scene):
            return None
        scenes[name] = scene
    seen = experiment.place(found.recordings[0], parameters, next(iter(scenes.values())))
    seconds, largest, memory = _PROGRAM_SECONDS, 0.0, 0.0
    for variant in variants:
        scene, steps = scenes[variant.method], len(seen.t) * variant.split
        N = scene.mesh.nodes.size * runs.finer(variant) ** scene.mesh.dimension
        costs = N * NODAL_MEAN if scene.dilatation == "nodal_mean" else N
        linear = scene.material.law == "linear" and not scene.contacts
        alone = linear_seconds(costs) + steps * _SOLVE * costs ** (4 / 3)
        seconds += alone if linear else steps * newton_seconds(costs)
        largest = max(largest, N)
        memory = max(memory, solvable_bytes(N, scene.mesh.dimension) * (1 if linear else 3))
    return RunEstimate(seconds, _PROGRAM + memory, largest)
