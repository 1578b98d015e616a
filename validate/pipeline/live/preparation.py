"""Method and recorded path of a real-time loop, with the same system as `validate run`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.fem.system import build as build_system
from validate.parameters import nearest_names
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.live.clock import LiveRun, live
from validate.pipeline.run.pipeline import set_out
from validate.recording.types import Recording
from validate.scene.meshless import Meshless
from validate.solve.types import HandStepper

_AXES = "xyz"


@dataclass(frozen=True)
class RecordedPath:
    """The path of a tool's tip: t (nt,) s, places x (nt, d) m, NaN where not seen, their `sd` m."""

    kind: ClassVar[str] = "path"

    t: Floats
    x: Floats
    sd: float = 0.0

    @classmethod
    def of(cls, recording: Recording, dimension: int, hint: str = "") -> Self:
        """Read signals `tip.x`, `tip.y`(, `tip.z`) in m, or the only point of a stream of markers
        `tip` (positions that a tracker did not see are null there).

        Raises `RecordingError` without such a path, or for one of another dimension, with the
        `hint`.
        """
        if "tip" in recording.markers:
            marker = recording.marker("tip")
            x = marker.x[:, 0]
            _require_dimension(recording, x.shape[1], dimension, hint)
            return cls(marker.t, np.array(x), marker.sd)
        names = [f"tip.{a}" for a in _AXES]
        there = [name for name in names if name in recording.signals]
        if not there:
            raise RecordingError(
                f"{recording.name}: no signals tip.x, tip.y and no markers 'tip'; it has "
                f"{sorted(recording.streams)}"
            )
        if there == names[: len(there)]:
            _require_dimension(recording, len(there), dimension, hint)
        parts = [recording.signal(name, "m") for name in names[:dimension]]
        if any(not np.array_equal(s.t, parts[0].t) for s in parts):
            raise RecordingError(
                f"{recording.name}: tip.x .. tip.{_AXES[dimension - 1]} have "
                f"{[len(s.t) for s in parts]} samples at different times; record them together"
            )
        return cls(parts[0].t, np.hstack([s.y[:, :1] for s in parts]), max(s.sd for s in parts))

    def live(self, stepper: HandStepper, seconds: float | None = None) -> LiveRun:
        """Walk the path against the clock, to its end or for so many seconds."""
        return live(stepper, self, seconds)

    @property
    def rate(self) -> float:
        """Samples a second, by the median step."""
        return float(1 / np.median(np.diff(self.t)))

    @property
    def findings(self) -> Mapping[str, int]:
        return {}

    def due(self, k: int) -> float | None:
        """When tick k is due, s after the start; None after the last."""
        return float(self.t[k] - self.t[0]) if k < len(self.t) else None

    def after(self, k: int, now: float) -> int:
        """Return the next one: no sample of a recorded path is left out."""
        return k + 1

    def place(self, k: int, now: float) -> Floats | None:
        return np.asarray(self.x[k])

    def give(self, force: Floats, flags: int) -> None:
        pass

    def close(self) -> None:
        pass


def _require_dimension(recording: Recording, found: int, wanted: int, hint: str) -> None:
    if found != wanted:
        words = f"{recording.name}: the tip has {found} coordinates, the body has {wanted}"
        raise RecordingError(f"{words}; {hint}" if hint else words)


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
