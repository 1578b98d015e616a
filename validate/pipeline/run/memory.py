"""Memory check of an experiment's systems before a run, and a mesh that fits."""

from collections.abc import Mapping
from typing import Any

from validate.errors import ValidateError
from validate.memory import MemoryShortError
from validate.parameters import Parameter, describe
from validate.pipeline.checks.checks import variants_of
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.run.runs import ExperimentRuns
from validate.recording.types import Recording

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
