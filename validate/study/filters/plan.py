"""Plan of a filter study, every method with every set of values, and the data its cells share."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats
from validate.engine.execution import Kept, fingerprint
from validate.engine.store import key_of
from validate.errors import ComparisonError, UsageError
from validate.estimate.measurements import Measurements
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.parameters import describe, nearest_names, with_values
from validate.pipeline.bodies.own_body import meshed
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import RECORDED, Options, configure, require_case
from validate.pipeline.run.case_solution import KeptFields, run_on
from validate.pipeline.run.job import Job, job_of
from validate.pipeline.run.method_run import Truth
from validate.pipeline.run.pipeline import set_out
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.observation import Observation
from validate.register.outlines.outlines import OutlineObservation
from validate.register.registration import Registered
from validate.scene.scene import Scene
from validate.solve.types import Run, Stepper
from validate.study.filters.withheld_errors import (
    MarkerTracks,
    Segments,
    marker_tracks,
    segments_of,
)
from validate.study.sweep import Axis, grid, named

METHODS = "methods."
CASE = "case"  # a condition: the truth is a case of the experiment, by its name
SEEDS = 10  # common samples of the noise: a t interval of them is 2.3 standard errors wide
EACH = ("each",)  # of hold_out: every marker in turn


@dataclass(frozen=True)
class FilterCell:
    """One method, its `settings` and the twin's `condition` as texts by path, over all `seeds`.

    `seed_path` is the seed's parameter; "" where there is none. `key` names all that makes its
    numbers. `given` are the markers that any filter of the study is given, `spared` those of them
    that a filter can lose, having another one. `hold_out` are kept from all filters. `baseline`
    compares filters with the method's model, given "nothing" ("alone"), or with the last
    measurement ("persistence"). Markers are registered as for the method `tracker`, a filter.
    """

    method: str
    settings: tuple[tuple[str, str], ...]
    condition: tuple[tuple[str, str], ...]
    seed_path: str = ""
    seeds: tuple[int, ...] = (0,)
    key: str = ""
    timed: bool = False
    given: tuple[str, ...] = ()
    spared: tuple[str, ...] = ()
    hold_out: tuple[str, ...] = ()
    baseline: Literal["", "alone", "persistence"] = ""
    tracker: str = ""

    @property
    def name(self) -> str:
        """Name in a ranking."""
        if self.baseline == "persistence":
            return "last measurement, held"
        return f"{self.method}, given nothing" if self.baseline else self.method

    @property
    def label(self) -> str:
        given = f" ({named(self.values)})" if self.values else ""
        seeds = f", {len(self.seeds)} seeds" if self.seed_path else ""
        return f"{self.name}{given}{seeds}"

    def in_turn(self, moving: Sequence[str]) -> bool:
        """Return whether every marker is held out in turn: `--hold-out each`, or no marker is
        free."""
        return self.hold_out == EACH or set(moving) <= set(self.given)

    def scored(self, moving: Sequence[str]) -> tuple[str, ...]:
        """Return the markers at which a method that is given none is scored as held out."""
        if self.hold_out and self.hold_out != EACH:
            return self.hold_out
        turns = self.spared if self.in_turn(moving) else ()
        return tuple(n for n in moving if n not in self.given or n in turns)

    @property
    def values(self) -> dict[str, str]:
        return dict(self.condition) | dict(self.settings)


@dataclass(frozen=True)
class FilterPlan:
    """The job and its cells, method by method in the order of the grid; `single` are the filters
    of one marker where every marker is held out in turn."""

    experiment: Experiment
    job: Job
    axes: tuple[Axis, ...]
    methods: tuple[str, ...]
    seeds: tuple[int, ...]
    cells: tuple[FilterCell, ...]
    single: tuple[str, ...] = ()

    @property
    def single_words(self) -> str:
        """How `--hold-out each` scores filters that are given one marker; "" for none."""
        if not self.single:
            return ""
        given = ", ".join(f"{m} ({self.experiment.methods[m].markers[0]})" for m in self.single)
        return (
            f"These methods are given one marker only and are scored by its next sample: {given}."
        )


def plan(
    experiment: Experiment,
    options: Options,
    axes: Sequence[Axis],
    seeds: int | tuple[int, ...] | None = None,
    hold_out: tuple[str, ...] = (),
) -> FilterPlan:
    """Check every path and value before anything runs.

    `seeds`: so many from the declared seed of the twin on, or these (None: `SEEDS`; a measured
    recording has one). An axis of one method multiplies its cells only. Raises `UsageError` for
    an experiment without filters, unknown paths (naming the nearest), values of another type,
    methods without a sweep's name, and fewer than one seed.
    """
    filters = [n for n, m in experiment.methods.items() if m.markers]
    if not filters:
        raise UsageError(
            f"'{experiment.name}' has no filter: no method of {', '.join(experiment.methods)} "
            'is given markers; declare one, as Method("...", KfFem(), markers=("A",)), in its file'
        )
    parameters, _ = configure(experiment, Options(options.values, (), options.quick))
    methods = _methods(experiment, options.methods, axes)
    paths = [p.path for p in describe(parameters)] if experiment.repeats else []
    seed_path = next((p for p in ("twin.seed", "seed") if p in paths), "")
    _require(axes, experiment, parameters, methods, seed_path)
    job = job_of(experiment, options.values, options.quick)
    chosen = [m for m in methods if m in filters] or filters
    given = tuple(dict.fromkeys(n for m in chosen for n in experiment.methods[m].markers))
    several = [m for m in chosen if len(experiment.methods[m].markers) > 1]
    spared = tuple(dict.fromkeys(n for m in several for n in experiment.methods[m].markers))
    single = tuple(m for m in chosen if m not in several) if hold_out == EACH else ()
    if seeds is None:
        seeds = SEEDS if experiment.repeats and seed_path else 1
    bare = FilterCell(
        "",
        (),
        (),
        seed_path,
        _seeds(seeds, parameters, seed_path),
        given=given,
        spared=spared,
        hold_out=hold_out,
        tracker=chosen[0],
    )
    known, declared = experiment.methods, experiment.uncertainty
    if not options.methods and not experiment.repeats and all(known[m].markers for m in methods):
        # A plain solver beside filters: the one that inputs are varied by, else one that is
        # accepted; none where there is none at all.
        names = (declared.surrogate if declared else "", experiment.reference, *experiment.accepted)
        plain = [n for n in names if n in known and not known[n].markers]
        methods = tuple(dict.fromkeys((*methods, *plain[:1])))
    of_methods = [replace(bare, method=m) for m in methods]
    cells = [c for one in of_methods for c in _cells(experiment, job, one, axes)]
    beside = [replace(bare, method=chosen[0], baseline="persistence")]
    if all(m in filters for m in methods):  # no plain solver stands beside them
        beside.insert(0, replace(bare, method=chosen[0], baseline="alone"))
    conditions = [a for a in axes if not a.path.startswith(METHODS)]
    cells += [c for one in beside for c in _cells(experiment, job, one, conditions)]
    return FilterPlan(experiment, job, tuple(axes), methods, bare.seeds, tuple(cells), single)


def set_up(experiment: Experiment, job: Job, cell: FilterCell, seed: int) -> tuple[Any, Any]:
    """Parameters with that seed, and the method's settings, of a cell."""
    values = {k: v for k, v in {**dict(job.values), **cell.values}.items() if k != CASE}
    if cell.seed_path:
        values[cell.seed_path] = str(seed)
    parameters, methods = configure(experiment, Options(values, (cell.method,), job.quick))
    return parameters, methods[cell.method]


def _cells(
    experiment: Experiment, job: Job, bare: FilterCell, axes: Sequence[Axis]
) -> list[FilterCell]:
    prefix = f"{METHODS}{bare.method}."
    cells = []
    concerning = [a for a in axes if not a.path.startswith(METHODS) or a.path.startswith(prefix)]
    for row in grid(concerning):
        settings = tuple((k, v) for k, v in row.items() if k.startswith(METHODS))
        condition = tuple((k, v) for k, v in row.items() if not k.startswith(METHODS))
        cells.append(_keyed(experiment, job, replace(bare, settings=settings, condition=condition)))
    return cells


def _keyed(experiment: Experiment, job: Job, bare: FilterCell) -> FilterCell:
    """The key holds every parameter and setting of the method as the cell will have it."""
    try:
        parameters, method = set_up(experiment, job, bare, bare.seeds[0])
        both = (*describe(parameters), *describe(method, METHODS))
        made: Any = [(p.path, repr(p.default)) for p in both]
    except UsageError as error:  # a combination that settings refuse: a failed row later
        made = str(error)
    return replace(bare, key=key_of(job, bare, made))


def _methods(
    experiment: Experiment, chosen: tuple[str, ...], axes: Sequence[Axis]
) -> tuple[str, ...]:
    """Those named, else those whose settings are swept, else all that run the whole time; on a
    measured recording filters, with what the experiment accepts and varies its inputs by."""
    known = experiment.methods
    for name in chosen:
        if name not in known:
            raise UsageError(f"unknown method '{name}'; {nearest_names(name, set(known))}")
    whole = tuple(n for n, m in known.items() if getattr(m, "steps", None) is None)
    usual = whole if experiment.repeats else tuple(n for n in whole if n in _usual(experiment))
    short = [n for n in chosen if n not in whole]
    if short:
        raise UsageError(
            f"method '{short[0]}' runs {known[short[0]].steps} steps only, for timing, so it "
            "has no error; leave it out"
        )
    swept = [a.path.split(".")[1] for a in axes if a.path.startswith(METHODS)]
    return chosen or tuple(n for n in whole if n in swept) or usual


def _usual(experiment: Experiment) -> set[str]:
    """Filters, and the plain solvers that stand beside them: other ones may take minutes."""
    by = experiment.uncertainty.surrogate if experiment.uncertainty else ""
    filters = {n for n, m in experiment.methods.items() if m.markers}
    return {*filters, *experiment.accepted, experiment.reference, by}


def _seeds(seeds: int | tuple[int, ...], parameters: Any, seed_path: str) -> tuple[int, ...]:
    count = seeds if isinstance(seeds, int) else len(seeds)
    if count < 1:
        raise UsageError(f"--seeds {seeds}: at least 1")
    if not seed_path:
        if count > 1:
            raise UsageError(
                f"{count} seeds, but the experiment has no parameter twin.seed; use --seeds 1"
            )
        return (0,)
    if isinstance(seeds, tuple):
        if len(set(seeds)) < count:
            raise UsageError(
                "a seed is given twice, but each seed is one sample; give different seeds"
            )
        return seeds
    first = {p.path: p.default for p in describe(parameters)}[seed_path]
    return tuple(range(int(first), int(first) + count))


def _require(
    axes: Sequence[Axis],
    experiment: Experiment,
    parameters: Any,
    methods: tuple[str, ...],
    seed_path: str,
) -> None:
    known = experiment.methods
    for a in axes:
        if a.path == CASE:
            for value in a.values:
                if value != RECORDED and not experiment.repeats:
                    raise UsageError(
                        f"no case '{value}' of {experiment.name}: its recording is measured, and "
                        "only a twin has cases"
                    )
                require_case(experiment, value)
            continue
        if a.path == seed_path:
            raise UsageError(
                f"'{a.path}' cannot be swept; use --seeds N, which repeats every cell N times"
            )
        if not a.path.startswith(METHODS):
            _require_values(parameters, a.path, a)
            continue
        short = a.path.removeprefix(METHODS)
        _require_values(known, short, a)
        if short.partition(".")[0] not in methods:
            raise UsageError(
                f"'{a.path}' is swept, but the method is not among {', '.join(methods)}; add it to "
                "--methods"
            )


def _require_values(settings: Any, path: str, axis: Axis) -> None:
    for value in axis.values:
        with_values(settings, {path: value})


# --- worker data that cells of a filter study share: recordings, registrations, systems, truth ---

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
