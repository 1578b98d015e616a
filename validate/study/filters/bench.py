"""Worker data that cells of a filter study share: recordings, registrations, systems, truths."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.engine.execution import Kept, fingerprint
from validate.errors import ComparisonError
from validate.estimate.measurements import Measurements
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.parameters import describe
from validate.pipeline.bodies.own_body import meshed
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.case_solution import KeptFields, run_on
from validate.pipeline.run.job import Job
from validate.pipeline.run.method_run import Truth
from validate.pipeline.run.pipeline import set_out
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.observation import Observation
from validate.register.outlines.outlines import OutlineObservation
from validate.register.registration import Registered
from validate.scene.scene import Scene
from validate.solve.types import Run, Stepper
from validate.study.filters.plan import CASE, FilterCell, set_up
from validate.study.filters.withheld_errors import (
    MarkerTracks,
    Segments,
    marker_tracks,
    segments_of,
)

_MANY = 40  # recordings and registrations kept, of seeds mostly


@dataclass(frozen=True)
class Ready:
    """A method prepared for one recording: `true` are the parameters of the twin that made it, and
    `mark` names all that `registered` and the scene come from. `tracks` are the markers that
    score, read from the fields of the method, in `segments` of time. `tracked` is the same
    recording as the study's first filter has it; None for that filter itself."""

    parameters: Any
    true: Any
    method: Method
    system: System
    registered: Registered
    mark: Hashable
    experiment: Experiment
    tracks: MarkerTracks | None
    segments: Segments
    tracked: "Ready | None" = None

    @property
    def scene(self) -> Scene:
        return self.system.scene

    def with_markers(self, names: Sequence[str]) -> "Ready":
        """The same, given these markers."""
        return replace(self, method=replace(self.method, markers=tuple(names)))

    def given_nothing(self) -> "Ready":
        """The same, where every marker and outline was missed at every sample after rest."""
        blank = tuple(_missed(o) for o in self.registered.observations)
        return replace(self, registered=replace(self.registered, observations=blank))

    def offered(self, names: Sequence[str]) -> Measurements:
        """Measurements of these markers and outlines, as filters are given them."""
        ready = self.tracked or self
        return replace(ready.method, markers=tuple(names)).offered(ready.system, ready.registered)

    def stepper(self) -> Stepper:
        given = self.experiment.sets(self.parameters, self.registered)
        return self.method.prepare(self.system, self.registered, given)

    def run(self, name: str, kept: KeptFields) -> Run:
        """Return the method through the recorded inputs."""
        kept = replace(kept, system=self.system)
        (run,) = run_on(
            self.experiment,
            name,
            self.method,
            self.parameters,
            self.scene,
            (self.registered,),
            kept,
        )
        return run


def _missed(sensor: Observation) -> Observation:
    if isinstance(sensor, MarkerObservation):
        return replace(sensor, x=np.full_like(sensor.x, np.nan))
    if isinstance(sensor, OutlineObservation):
        sds = None if sensor.sds is None else sensor.sds[:1]
        return replace(sensor, t=np.zeros(1), outlines=sensor.outlines[:1], sds=sds)
    return sensor


@dataclass(frozen=True)
class _Loaded:
    """Measured recordings, with the parameters that were identified on them."""

    experiment: Experiment
    parameters: Any
    recordings: tuple[Recording, ...]


class Bench:
    """One worker's memory of an experiment: what cells share is made once."""

    def __init__(self, experiment: Experiment, job: Job) -> None:
        self.experiment, self.job = experiment, job
        self._systems: Kept[System] = Kept(4)
        self._registered: Kept[tuple[str, Registered]] = Kept(_MANY)
        self._recordings: Kept[Recording] = Kept(_MANY)
        self._truths: Kept[Truth] = Kept(4)
        self._loaded: Kept[_Loaded] = Kept(4)

    def ready(self, cell: FilterCell, seed: int) -> tuple[Ready, ...]:
        """Return the cell's method on each of its recordings: one that the twin makes with that
        seed, or those that were measured."""
        parameters, method = set_up(self.experiment, self.job, cell, seed)
        if not self.experiment.repeats:
            loaded = self._measured(cell)
            pairs = zip(loaded.recordings, self._tracked(cell, cell.seeds[0]), strict=True)
            return tuple(
                self._ready(
                    loaded.experiment, recording, loaded.parameters, loaded.parameters, method,
                    (cell.condition, i), tracked,
                )
                for i, (recording, tracked) in enumerate(pairs)
            )  # fmt: skip
        # The truth is another one where the condition is a case of the experiment
        name = dict(cell.condition).get(CASE, "")
        case = next((c for c in self.experiment.cases if c.name == name), None)
        true = parameters if case is None else case.change(parameters)
        made = name, _text(parameters)
        recording = self._recordings.get(made, lambda: self._made(true))
        experiment = self.experiment
        return tuple(
            self._ready(experiment, recording, parameters, true, method, made, one)
            for one in self._tracked(cell, seed)
        )

    def _tracked(self, cell: FilterCell, seed: int) -> tuple[Ready | None, ...]:
        """The same recordings as the filter has them whose registration gives the markers; none
        for that filter itself."""
        if cell.method == cell.tracker:
            count = 1 if self.experiment.repeats else len(self._measured(cell).recordings)
            return (None,) * count
        tracker = replace(cell, method=cell.tracker, settings=())
        return self.ready(tracker, seed)

    def _made(self, true: Any) -> Recording:
        assert self.experiment.twin is not None
        return self.experiment.twin.made(true, lambda _: None)

    def _measured(self, cell: FilterCell) -> _Loaded:
        """What stands open is identified once, by the methods as they are declared."""

        def load() -> _Loaded:
            values = {**dict(self.job.values), **dict(cell.condition)}
            out = set_out(self.experiment, Options(values, (cell.tracker,), self.job.quick))
            return _Loaded(out.experiment, out.runs.parameters, out.found.recordings)

        return self._loaded.get(cell.condition, load)

    def _ready(
        self,
        experiment: Experiment,
        recording: Recording,
        parameters: Any,
        true: Any,
        method: Method,
        made: Hashable,
        tracked: Ready | None,
    ) -> Ready:
        mark = (made, fingerprint(method.scene))

        def scene() -> Scene:
            return meshed(experiment.build(recording, parameters, method.scene))

        def register() -> tuple[str, Registered]:
            """The registration, behind the fingerprint of its scene: seeds share their system."""
            body = scene()
            name = fingerprint(body)
            system = self._systems.get(name, lambda: build_system(body))
            return name, experiment.place(recording, parameters, system.scene)

        body, registered = self._registered.get(mark, register)
        system = self._systems.get(body, lambda: build_system(scene()))
        tracks = None if tracked is None else tracked.tracks
        if tracks is None:
            tracks = marker_tracks(registered, system)
        elif tracked is not None and tracked.mark != mark:
            tracks = tracks.on(system.scene.mesh)
        segments = segments_of(registered) if tracked is None else tracked.segments
        return Ready(
            parameters,
            true,
            method,
            system,
            registered,
            mark,
            experiment,
            tracks,
            segments,
            tracked,
        )

    def truth(self, ready: Ready) -> Mapping[str, Floats]:
        """Return the twin's motion at the probes: noise does not touch it, so the first seed's
        serves all; empty without a twin."""
        if not self.experiment.repeats:
            return {}
        motions = self._truths.get(
            _text(ready.true),
            lambda: replace(self._repeated(ready), u=None, mesh=None),
        ).probes
        if not motions:
            raise ComparisonError(
                "the truth of the twin has no probes, so nothing can be compared; give it "
                "those of the scene"
            )
        return motions

    def _repeated(self, ready: Ready) -> Truth:
        assert self.experiment.twin is not None
        assert self.experiment.twin.truth is not None
        return self.experiment.twin.truth(ready.true, ready.registered)


def open_bench(job: Job) -> Bench:
    return Bench(job.experiment(), job)


def _text(parameters: Any) -> str:
    return repr([(p.path, p.default) for p in describe(parameters)])
