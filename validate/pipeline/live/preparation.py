"""Preparation of a method for a real-time loop, with the same system as `validate run`."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.fem.system import build as build_system
from validate.parameters import nearest_names
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.live.path import RecordedPath
from validate.pipeline.run.pipeline import set_out
from validate.scene.meshless import Meshless
from validate.solve.types import HandStepper


@dataclass(frozen=True)
class Prepared:
    """The stepper of a method with its recorded path; `findings` are of that path."""

    experiment: Experiment
    method: str
    parameters: Any
    stepper: HandStepper
    path: RecordedPath
    findings: tuple[str, ...]

    @property
    def reach(self) -> tuple[Floats, Floats]:
        """Corners (d,) m of the box in which a tip may be: a body's size around the body."""
        nodes = self.stepper.scene.mesh.nodes
        low, high = nodes.min(axis=0), nodes.max(axis=0)
        aside = (high - low).max() / np.sqrt(len(low))
        return low - aside, high + aside


def prepared(experiment: Experiment, options: Options, method: str = "") -> Prepared:
    """Prepare a method (none: the first one accepted).

    Raises `UsageError` for an experiment without a tool, and what the pipeline raises.
    """
    name = method or next(iter(experiment.accepted), "")
    if name not in experiment.methods:
        raise UsageError(f"unknown method '{name}'; {nearest_names(name, set(experiment.methods))}")
    out = set_out(experiment, Options(options.values, (name,)))
    runs, chosen = out.runs, out.runs.methods[name]
    runs.start(out.found.recordings)
    recording = runs.recordings[0]
    scene = out.experiment.build(recording, runs.parameters, chosen.scene)
    if isinstance(scene, Meshless) or len(scene.tools) != 1:
        raise UsageError(
            f"experiment '{experiment.name}' has no needle or probe, which `validate live` needs"
        )
    seen = out.experiment.place(recording, runs.parameters, scene)
    given = out.experiment.sets(runs.parameters, seen)
    stepper = chosen.prepare(build_system(scene), seen, given)
    if not isinstance(stepper, HandStepper):
        raise UsageError(
            f"method '{name}' of '{experiment.name}' cannot run in real time under a tool"
        )
    path = RecordedPath(seen.t, seen.inputs + np.array(stepper.tool.tip))
    return Prepared(out.experiment, name, runs.parameters, stepper, path, seen.findings)
