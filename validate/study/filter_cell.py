"""A filter study's cell: the road of `validate run`, with recordings made in memory.

Scenes, systems, registrations and truths are kept from cell to cell. Seeds change the noise only:
a linear filter whose gains need no data runs them all at once, everything else one by one.
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.estimate.batch import shared_gain_run
from validate.estimate.displacement_filter import DisplacementStepper
from validate.estimate.gains import schedule
from validate.estimate.kalman import Seen
from validate.estimate.measurements import Timetable, measurements, timetable
from validate.fem.locate import probe_rows
from validate.fem.system import System
from validate.fem.system import build as build_system
from validate.parameters import describe
from validate.register.markers import MarkerObservation
from validate.register.registered import Registered
from validate.replay.experiment import Experiment
from validate.replay.followed import Truth
from validate.replay.method import Method
from validate.replay.own_body import meshed
from validate.scene.scene import Scene
from validate.solve.march import march
from validate.solve.types import Run, Stepper
from validate.study.filter_plan import FilterCell, set_up
from validate.study.job import Job
from validate.study.kept import Kept, fingerprint
from validate.study.score import NIS, FilterScores, error_scores
from validate.study.shared import sharing

_TIMED = 25  # steps that are timed where the seeds run together
_TIMED_S = 0.01  # s after which no more of them are
_MANY = 40  # recordings and registrations kept, of seeds mostly


@dataclass(frozen=True)
class Ready:
    """A cell prepared for one seed; `mark` names all that `seen` and the scene come from."""

    parameters: Any
    method: Method
    system: System
    seen: Registered
    mark: Hashable


@dataclass(frozen=True)
class Looks:
    """Measurements by step: their timetable, which are there, and z (nt, m) m, NaN = none."""

    table: Timetable
    when: Mapping[int, Seen]
    z: Floats


class Bench:
    """One worker's memory of an experiment: what cells share is made once."""

    def __init__(self, experiment: Experiment, job: Job) -> None:
        self.experiment, self.job = experiment, job
        assert experiment.twin is not None
        self.twin = experiment.twin
        self._systems: Kept[System] = Kept(4)
        self._seen: Kept[tuple[str, Registered]] = Kept(_MANY)
        self._looks: Kept[Looks | None] = Kept(_MANY)
        self._recordings: Kept[Any] = Kept(_MANY)
        self._truths: Kept[Truth] = Kept(4)

    def ready(self, cell: FilterCell, seed: int) -> Ready:
        parameters, method = set_up(self.experiment, self.job, cell, seed)
        key = _text(parameters)
        mark = (key, fingerprint(method.scene))
        body, seen = self._seen.get(mark, lambda: self._registered(key, parameters, method))
        system = self._systems.get(body, lambda: build_system(self._scene(key, parameters, method)))
        return Ready(parameters, method, system, seen, mark)

    def looks(self, ready: Ready, names: tuple[str, ...]) -> Looks | None:
        """Those components' measurements on the recorded steps; None where they are not there."""
        return self._looks.get((ready.mark, names), lambda: _looks(ready, names))

    def _recording(self, key: str, parameters: Any) -> Any:
        return self._recordings.get(key, lambda: self.twin.made(parameters, lambda _: None))

    def _scene(self, key: str, parameters: Any, method: Method) -> Scene:
        recording = self._recording(key, parameters)
        return meshed(self.experiment.build(recording, parameters, method.scene))

    def _registered(self, key: str, parameters: Any, method: Method) -> tuple[str, Registered]:
        """The registration, behind the fingerprint of its scene: seeds share their system."""
        scene = self._scene(key, parameters, method)
        body = fingerprint(scene)
        system = self._systems.get(body, lambda: build_system(scene))
        recording = self._recording(key, parameters)
        return body, self.experiment.place(recording, parameters, system.scene)

    def truth(self, ready: Ready) -> Mapping[str, Floats]:
        """The twin's motion: noise does not touch it, so the first seed's serves all."""
        return self._truths.get(
            _text(ready.parameters),
            lambda: replace(self._true(ready), u=None, mesh=None),
        ).probes

    def stepper(self, ready: Ready) -> Stepper:
        given = self.experiment.sets(ready.parameters, ready.seen)
        return ready.method.prepare(ready.system, ready.seen, given)

    def _true(self, ready: Ready) -> Truth:
        assert self.twin.truth is not None
        return self.twin.truth(ready.parameters, ready.seen)


def open_bench(job: Job) -> Bench:
    return Bench(job.experiment(), job)


def run_cell(bench: Bench, cell: FilterCell) -> FilterScores:
    """Raises what the cell's settings, its filter or its run end with."""
    first = bench.ready(cell, cell.seeds[0])
    start = perf_counter()
    stepper = bench.stepper(first)
    setup = perf_counter() - start
    if isinstance(stepper, DisplacementStepper):
        shared = _all_seeds(bench, cell, stepper, first)
        if shared is not None:
            return replace(shared, step_s=_step_time(stepper, first.seen.inputs), setup_s=setup)
    return _one_by_one(bench, cell, stepper, first, setup)


# --- all seeds at once ---------------------------------------------------------------------------


def _all_seeds(
    bench: Bench, cell: FilterCell, stepper: DisplacementStepper, first: Ready
) -> FilterScores | None:
    """None where the seeds miss different samples, damping couples the modes, or what the filter
    was given cannot be told from outside."""
    z = _measured(bench, cell, stepper, first)
    shared = sharing(stepper) if z is not None else None
    if z is None or shared is None or shared.gains is None:
        return None
    scene, inputs = first.system.scene, first.seen.inputs
    points = probe_rows(scene.mesh, scene.probes)
    rows = np.kron(points.weights.toarray(), np.eye(scene.mesh.dimension))
    found = shared_gain_run(
        shared, inputs, z, rows["xyz".index(bench.experiment.axis) :: scene.mesh.dimension]
    )
    if not (np.isfinite(found.values).all() and np.isfinite(found.nis).all()):
        raise ComparisonError("diverged: the estimate is not finite")
    names, dof = [p.name for p in scene.probes], int(found.dof.sum())
    if not dof:
        raise ComparisonError(f"invalid: {stepper.sensor.table.unheard(len(inputs), ())}")
    scores = [
        _scores(bench, first, dict(zip(names, values.T, strict=True)), float(nis.sum()), dof)
        for values, nis in zip(found.values, found.nis, strict=True)
    ]
    return FilterScores(
        *_columns(scores),
        nis=float(found.nis.sum()),
        nis_dof=dof * len(z),
        steps=len(inputs),
        frozen=shared.gains.frozen,
        shared=True,
    )


def _measured(
    bench: Bench, cell: FilterCell, stepper: DisplacementStepper, first: Ready
) -> Floats | None:
    """Measurements z (seeds, nt, m) m by step, NaN = none, of the components the filter was given.

    The filter's own table shows which those are: from the first seed's recording it must come out.
    """
    sensor = stepper.sensor
    own = bench.looks(first, sensor.names)
    if own is None or not _equal(own.table, sensor.table):
        return None
    others = [bench.looks(bench.ready(cell, seed), sensor.names) for seed in cell.seeds[1:]]
    all_ = [own, *(o for o in others if o is not None)]
    if any(o.when != stepper.when for o in all_):
        return None
    return np.array([o.z for o in all_])


def _looks(ready: Ready, names: tuple[str, ...]) -> Looks | None:
    if not ready.seen.of(MarkerObservation):
        return None
    seen = measurements(ready.seen, ready.system.scene.mesh)
    if any(name not in seen.names for name in names):
        return None
    pick = [seen.names.index(name) for name in names]
    given = replace(seen, H=seen.H[pick], z=seen.z[:, pick], sd=seen.sd[pick], names=names)
    table = timetable(given, float(ready.seen.t[0]))
    z = np.full((len(ready.seen.t), len(names)), np.nan)
    for step, row in table.z.items():
        if step <= len(z):
            z[step - 1] = row
    return Looks(table, schedule(table), z)


def _equal(one: Timetable, other: Timetable) -> bool:
    mine, others = (np.array(list(table.z.values())) for table in (one, other))
    return one.z.keys() == other.z.keys() and np.array_equal(mine, others, equal_nan=True)


def _step_time(stepper: Stepper, inputs: Floats) -> float:
    """Median s of the first steps, run as they are alone; the very first only warms up."""
    state, seconds = stepper.rest(), list[float]()
    for row in inputs[: _TIMED + 1]:
        start = perf_counter()
        state = stepper.step(state, row)
        seconds.append(perf_counter() - start)
        if sum(seconds) > _TIMED_S and len(seconds) > 5:
            break
    return float(np.median(seconds[1:] or seconds))


# --- seed by seed --------------------------------------------------------------------------------


def _one_by_one(
    bench: Bench, cell: FilterCell, stepper: Stepper, first: Ready, setup: float
) -> FilterScores:
    rows, times, nis, dof, steps = [], [], 0.0, 0, 0
    for i, seed in enumerate(cell.seeds):
        ready = first if i == 0 else bench.ready(cell, seed)
        run = _march(cell, stepper if i == 0 else bench.stepper(ready), ready)
        if not run.finished:
            end = run.outcome
            raise ComparisonError(f"seed {seed}: {end.state} at step {end.step}: {end.why}")
        own, degrees = _nis(run)
        names = [p.name for p in ready.system.scene.probes]
        traces = {n: run.traces[f"{n}.{bench.experiment.axis}"].y for n in names}
        rows.append(_scores(bench, first, traces, own, degrees))
        nis, dof, steps = nis + own, dof + degrees, len(run.t)
        times += [run.step_s.p50] if run.step_s else []
    return FilterScores(
        *_columns(rows),
        nis=nis if dof else None,
        nis_dof=dof,
        step_s=float(np.median(times)) if times else None,
        setup_s=setup,
        steps=steps,
    )


def _march(cell: FilterCell, stepper: Stepper, ready: Ready) -> Run:
    t, inputs = ready.seen.t, ready.seen.inputs
    return march(cell.method, stepper, t, inputs, np.array([len(t) - 1]), 0.0)


def _nis(run: Run) -> tuple[float, int]:
    nis, dof = run.traces.get("nis"), run.traces.get("nis.dof")
    return (0.0, 0) if nis is None or dof is None else (float(nis.y.sum()), int(dof.y.sum()))


# --- scores --------------------------------------------------------------------------------------


def _scores(
    bench: Bench, first: Ready, traces: Mapping[str, Floats], nis: float, dof: int
) -> dict[str, float]:
    truth = bench.truth(first)
    if not truth:
        raise ComparisonError("the twin tells no probe's truth: 0 compared")
    scores = error_scores(traces, truth, bench.experiment.axis)
    return scores | ({NIS: nis / dof} if dof else {})


def _columns(
    rows: list[dict[str, float]],
) -> tuple[dict[str, tuple[float, ...]], dict[str, str]]:
    names = tuple(rows[0])
    units = {name: "1" if name == NIS else "m" for name in names}
    return {name: tuple(row[name] for row in rows) for name in names}, units


def _text(parameters: Any) -> str:
    return repr([(p.path, p.default) for p in describe(parameters)])
