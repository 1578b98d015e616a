"""Cell of a filter study: one method with its settings, on every seed or recording.

Seeds change the noise only: a linear filter whose gains need no data runs them all at once, every
other method one by one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import cast

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.errors import ComparisonError, UsageError
from validate.estimate.filters import FilterStepper
from validate.estimate.measurements import Measurements
from validate.fem.assembly.locate import Rows, probe_rows
from validate.pipeline.run.case_solution import KeptFields
from validate.solve.types import Run, StepTimes
from validate.study.filters.plan import EACH, Bench, FilterCell, Ready
from validate.study.filters.score import NIS, FilterScores, error_scores, withheld_scores
from validate.study.filters.withheld_errors import (
    Innovations,
    MarkerTracks,
    PredictionErrors,
    Segments,
    Withheld,
    ahead_errors,
    by_seed,
    in_a_row,
    innovations_of,
    joined_innovations,
    joined_predictions,
    other_errors,
    other_times,
    outline_tracks,
    prediction_errors,
    read_innovations,
)

_TIMED = 200  # steps that are timed where the seeds run together
_TIMED_S = 0.05  # s after which no more of them are


@dataclass(frozen=True)
class Scored:
    """Results of a method on one recording: errors at the truth's probes by score, at what was
    withheld, its innovations, NIS with its degrees of freedom; `predictions` of a method without
    innovations."""

    truth: Mapping[str, float]
    withheld: tuple[Withheld, ...]
    innovations: Innovations | None = None
    nis: float = 0.0
    dof: int = 0
    predictions: PredictionErrors | None = None


@dataclass(frozen=True)
class Fold:
    """One run of a method: the markers it is given, and those that score it."""

    given: tuple[str, ...]
    scores: tuple[str, ...]


@dataclass(frozen=True)
class Timing:
    """Seconds of set-up, and median and 99 % quantile of a step where steps were timed."""

    setup_s: float = 0.0
    p50: list[float] = field(default_factory=list)
    p99: list[float] = field(default_factory=list)

    def add(self, times: StepTimes | None) -> None:
        if times is not None:
            self.p50.append(times.p50)
            self.p99.append(times.p99)


def run_cell(bench: Bench, cell: FilterCell) -> FilterScores:
    """Raise what the cell's settings, its filter or its run end with."""
    first = bench.ready(cell, cell.seeds[0])[0]
    if cell.baseline == "persistence":
        return _persistence(bench, cell, first)
    folds = folds_of(cell, first)
    if first.method.markers and not cell.baseline and len(folds) == 1:
        ready = first.with_markers(folds[0].given)
        start = perf_counter()
        stepper = cast(FilterStepper, ready.stepper())
        setup = perf_counter() - start
        alike = other_times(first.registered) is None
        together = _all_seeds(bench, cell, stepper, ready, folds[0]) if alike else None
        if together is not None:
            # Of the first steps, run as they are alone; the very first only warms up.
            state, seconds = stepper.rest(), list[float]()
            for row in ready.registered.inputs[: _TIMED + 1]:
                start = perf_counter()
                state = stepper.step(state, row)
                seconds.append(perf_counter() - start)
                if sum(seconds) > _TIMED_S and len(seconds) > 5:
                    break
            p50, p99 = np.quantile(seconds[1:] or seconds, [0.5, 0.99]).tolist()
            return replace(together, step_s=p50, step_p99_s=p99, setup_s=setup)
    scored, timing, steps = list[Scored](), Timing(), 0
    segments: Segments | None = None
    for seed in cell.seeds:
        on_each = []
        for one in bench.ready(cell, seed):
            segments = segments or one.segments
            runs = [_run(cell, one, fold, seed) for fold in folds]
            timing.add(runs[0].step_s)
            steps = len(runs[0].t)
            on_each.append(_scored(bench, cell, one, folds, runs))
        scored.append(_in_a_row(on_each))
    assert segments is not None
    return replace(
        _put_together(scored, segments),
        step_s=float(np.median(timing.p50)) if timing.p50 else None,
        step_p99_s=float(np.median(timing.p99)) if timing.p99 else None,
        setup_s=runs[0].setup_s,
        steps=steps,
    )


def folds_of(cell: FilterCell, ready: Ready) -> tuple[Fold, ...]:
    """Return the runs of a cell. Raises `UsageError` for held-out names that do not move.

    Markers given to no filter score every method. Where there are none, or with `--hold-out each`,
    every marker is held out in turn of a method that is given two and more. One that is given a
    single marker cannot lose it: its next samples score it.
    """
    moving = ready.tracks.names if ready.tracks else ()
    given = ready.method.markers
    if cell.hold_out and cell.hold_out != EACH:
        absent = [n for n in cell.hold_out if n not in moving]
        if absent:
            raise UsageError(
                f"--hold-out {absent[0]}: no moving marker has that name; moving "
                f"markers are {list(moving)}"
            )
        left = tuple(n for n in given if n not in cell.hold_out)
        if given and not left:
            raise UsageError(
                f"--hold-out {', '.join(cell.hold_out)} leaves nothing of {', '.join(given)} to "
                "the filter"
            )
        return (Fold(left, cell.hold_out),)
    if not given or cell.baseline:
        return (Fold(given, cell.scored(moving)),)
    whole = Fold(given, tuple(n for n in moving if n not in given))
    if not cell.in_turn(moving):
        return (whole,)
    turns = [m for m in given if m in moving] if len(given) > 1 else []
    return (whole, *(Fold(tuple(n for n in given if n != m), (m,)) for m in turns))


# --- all seeds at once ---------------------------------------------------------------------------


def _all_seeds(
    bench: Bench, cell: FilterCell, stepper: FilterStepper, first: Ready, fold: Fold
) -> FilterScores | None:
    """None where the filter cannot take all seeds in one walk."""
    offered, inputs, t = stepper.offered, first.registered.inputs, first.registered.t
    every = [bench.ready(cell, seed)[0].with_markers(fold.given) for seed in cell.seeds]
    z = [_by_step(r.method.offered(r.system, r.registered), offered, t) for r in every]
    if any(row is None for row in z):
        return None
    # Rows (p, N) of the probes along the experiment's axis, then of the markers that score.
    mesh, tracks = first.scene.mesh, _scoring(first, fold)
    d, axis = mesh.dimension, "xyz".index(first.experiment.axis)
    rows = np.zeros((0, mesh.nodes.size))
    if first.scene.probes:
        weights = probe_rows(mesh, first.scene.probes).weights.toarray()
        rows = np.kron(weights, np.eye(d))[axis::d]
    if tracks is not None:
        rows = np.vstack([rows, np.kron(tracks.rows.weights.toarray(), np.eye(d))])
    places = 0 if tracks is None else len(tracks.names)
    batch = stepper.batch(inputs, np.array(z), rows)
    if batch is None:
        return None
    if not (np.isfinite(batch.values).all() and np.isfinite(batch.nis).all()):
        raise ComparisonError("diverged: the estimate is not finite")
    dof = int(batch.dof.sum())
    if not dof:
        unheard = stepper.unheard([{"nis.dof": 0.0}] * len(inputs))  # type: ignore[attr-defined]
        raise ComparisonError(f"invalid: {unheard}")
    measured, segments = np.isfinite(np.array(z)), first.segments
    names = [p.name for p in first.scene.probes]
    scored = []
    for i, ready in enumerate(every):
        probes = dict(zip(names, batch.values[i, :, : len(names)].T, strict=True))
        u = batch.values[i, :, len(names) :].reshape(len(t), places, -1)
        y = batch.y[i]
        own = _scoring(ready, fold)
        held = () if own is None else own.errors(t, u, segments, ahead=False)
        withheld = (*held, *ahead_errors(t, offered.names, y, measured[i], segments))
        scaled = np.where(measured[i], y / offered.sd, np.nan)
        innovations = innovations_of(t, scaled, batch.log_likelihood[i], batch.dof, segments)
        truth = _against_truth(bench, first, probes)
        scored.append(Scored(truth, withheld, innovations, float(batch.nis[i].sum()), dof))
    return replace(
        _put_together(scored, segments), steps=len(inputs), frozen=batch.frozen, shared=True
    )


def _by_step(measurements: Measurements, offered: Measurements, t: Floats) -> Floats | None:
    """Measurements (nt, m) m by step, NaN = none; None for other components."""
    if measurements.names != offered.names:
        return None
    z = np.full((len(t), len(measurements.names)), np.nan)
    for step, row in measurements.timetable(float(t[0])).z.items():
        if step <= len(z):
            z[step - 1] = row
    return z


# --- seed by seed --------------------------------------------------------------------------------


def _run(cell: FilterCell, ready: Ready, fold: Fold, seed: int) -> Run:
    one = ready.with_markers(fold.given)
    one = one.given_nothing() if cell.baseline == "alone" else one
    # Rows of the markers, then of the outlines that filters are given.
    rows = [] if ready.tracks is None else [ready.tracks.rows]
    rows += [o.distances.rows for o in outline_tracks(ready.registered, cell.given)]
    points = None
    if rows:
        weights = sparse.csr_array(sparse.vstack([r.weights for r in rows]))
        points = Rows(weights, np.concatenate([r.outside for r in rows]))
    run = one.run(cell.method, KeptFields(other_times(ready.registered), points))
    state = run.outcome.state
    if state == "finished" or (state == "invalid" and cell.baseline == "alone"):
        return run
    where = f"seed {seed}: " if cell.seed_path else ""
    raise ComparisonError(f"{where}{state} at step {run.outcome.step}: {run.outcome.why}")


def _scored(
    bench: Bench, cell: FilterCell, ready: Ready, folds: Sequence[Fold], runs: Sequence[Run]
) -> Scored:
    """Results on one recording: held-out errors of every fold, all others of the first."""
    segments, run = ready.segments, runs[0]
    tracks = ready.tracks
    held = list[Withheld]()
    for fold, of_fold in zip(folds, runs, strict=True):
        if tracks is not None and of_fold.points is not None and fold.scores:
            at = [tracks.names.index(n) for n in fold.scores]
            held += tracks.of(fold.scores).errors(
                of_fold.t, of_fold.points[:, at], segments, ahead=False
            )
    held += other_errors(run, ready.registered, segments, cell.given)
    axis = ready.experiment.axis
    probes = {p.name: run.traces[f"{p.name}.{axis}"].y for p in ready.scene.probes}
    truth = _against_truth(bench, ready, probes) if bench.experiment.repeats else {}
    nis, dof = run.traces.get("nis"), run.traces.get("nis.dof")
    if nis is None or dof is None or cell.baseline:
        ahead, predictions = _open_loop(cell, ready, run, segments)
        return Scored(truth, (*held, *ahead), predictions=predictions)
    names = [n for n in run.traces if n.startswith("innovation.") and not n.endswith(".sd")]
    names = [n.removeprefix("innovation.") for n in names]
    y, sd = read_innovations(run, names)
    measured = (sd > 0) | (y != 0)
    scaled = np.where(sd > 0, y / np.where(sd > 0, sd, 1.0), np.nan)
    innovations = innovations_of(run.t, scaled, run.traces["log_likelihood"].y, dof.y, segments)
    ahead = ahead_errors(run.t, names, y, measured, segments)
    return Scored(truth, (*held, *ahead), innovations, float(nis.y.sum()), int(dof.y.sum()))


def _open_loop(
    cell: FilterCell, ready: Ready, run: Run, segments: Segments
) -> tuple[tuple[Withheld, ...], PredictionErrors | None]:
    """Errors, and y - H u, at what filters are given, of a method that is given nothing."""
    u, tracks = run.points, ready.tracks
    if u is None:
        return (), None
    errors, columns, first = list[Withheld](), dict[str, Floats](), 0
    if tracks is not None:
        given, first = tracks.of(cell.given), len(tracks.names)
        at = [tracks.names.index(n) for n in given.names]
        errors += given.errors(run.t, u[:, at], segments, ahead=True) if at else ()
        columns = {f"{name}.{'xyz'[c]}": u[:, i, c]
                   for i, name in enumerate(tracks.names) for c in range(u.shape[2])}  # fmt: skip
    for outline in outline_tracks(ready.registered, cell.given):
        last = first + len(outline.distances.normals)
        errors += outline.errors(run.t, u[:, first:last], segments)
        along = (u[:, first:last] * outline.distances.normals).sum(axis=2)
        columns |= {f"{outline.name}.{i}": y for i, y in enumerate(along.T)}
        first = last
    offered, start = ready.offered(cell.given), np.zeros(1)
    t = np.concatenate([start, run.t])
    predicted = [np.interp(offered.t, t, np.append(start, columns[n])) for n in offered.names]
    left = offered.z - np.stack(predicted, axis=1)
    return tuple(errors), prediction_errors(offered.t, left, offered.sd**2, segments)


# --- persistence ----------------------------------------------------------------------------------


def _persistence(bench: Bench, cell: FilterCell, first: Ready) -> FilterScores:
    """The last measurement, held: what was given stays as it was last measured, another marker is
    where the nearest given one was."""
    scored, seconds, segments = list[Scored](), list[float](), first.segments
    for seed in cell.seeds:
        on_each = []
        for ready in bench.ready(cell, seed):
            offered = ready.offered(cell.given)
            start = perf_counter()
            # The last value of every component before each row (nt, m), zero at first.
            last, now = np.zeros_like(offered.z), np.zeros(offered.z.shape[1])
            for i, row in enumerate(offered.z):
                last[i] = now
                now = np.where(np.isfinite(row), row, now)
            seconds.append((perf_counter() - start) / len(offered.t))
            y, measured = offered.z - last, np.isfinite(offered.z)
            ahead = ahead_errors(offered.t, offered.names, np.nan_to_num(y), measured, segments)
            tracks, held = ready.tracks, tuple[Withheld, ...]()
            truth: Mapping[str, float] = {}
            if tracks is not None:
                given = tracks.of(cell.given).and_outlines(
                    outline_tracks(ready.registered, cell.given), ready.scene.mesh
                )
                if given.names:
                    held = _held_markers(cell, tracks, given, segments)
                    truth = _held_at_probes(bench, ready, given)
            predictions = prediction_errors(offered.t, y, offered.sd**2, segments)
            on_each.append(Scored(truth, (*held, *ahead), predictions=predictions))
        scored.append(_in_a_row(on_each))
    scores = _put_together(scored, segments)
    step = float(np.median(seconds))
    return replace(
        scores, step_s=step, step_p99_s=float(np.max(seconds)), steps=len(first.registered.t)
    )


def _held_markers(
    cell: FilterCell, tracks: MarkerTracks, given: MarkerTracks, segments: Segments
) -> tuple[Withheld, ...]:
    """Errors of the markers that are held out, each where the nearest other given one was."""
    held = list[Withheld]()
    for name in cell.scored(tracks.names):
        marker, others = tracks.of((name,)), given.of([n for n in given.names if n != name])
        if others.names:
            u = marker.held(others)
            held += marker.errors(tracks.t[1:], u[1:], segments, ahead=False)
    return tuple(held)


def _held_at_probes(bench: Bench, ready: Ready, given: MarkerTracks) -> Mapping[str, float]:
    truth = bench.truth(ready)
    if not truth:
        return {}
    probes = [p for p in ready.scene.probes if p.name in truth]
    rest = np.array([p.point for p in probes])
    at = replace(given, names=tuple(p.name for p in probes), rest=rest)
    now = at.held(given)
    c, t = "xyz".index(ready.experiment.axis), np.concatenate([[0.0], ready.registered.t])
    last = np.searchsorted(given.t, t[1:] + 1e-9) - 1
    estimates = {p.name: now[last, j, c] for j, p in enumerate(probes)}
    return error_scores(estimates, truth, ready.experiment.axis)


# --- scores --------------------------------------------------------------------------------------


def _scoring(ready: Ready, fold: Fold) -> MarkerTracks | None:
    tracks = ready.tracks
    return None if tracks is None or not fold.scores else tracks.of(fold.scores)


def _against_truth(bench: Bench, ready: Ready, traces: Mapping[str, Floats]) -> Mapping[str, float]:
    truth = bench.truth(ready)
    return error_scores(traces, truth, bench.experiment.axis) if truth else {}


def _in_a_row(scored: Sequence[Scored]) -> Scored:
    """Several measured recordings as one."""
    if len(scored) == 1:
        return scored[0]
    return Scored(
        {}, in_a_row([s.withheld for s in scored]),
        joined_innovations([s.innovations for s in scored], 1),
        sum(s.nis for s in scored), sum(s.dof for s in scored),
        joined_predictions([s.predictions for s in scored], 2),
    )  # fmt: skip


def _put_together(scored: Sequence[Scored], segments: Segments) -> FilterScores:
    """All seeds; steps and times are the caller's."""
    withheld = by_seed([s.withheld for s in scored])
    innovations = joined_innovations([s.innovations for s in scored], 0)
    scores, units = withheld_scores(withheld, innovations)
    truth = {name: tuple(s.truth[name] for s in scored) for name in scored[0].truth}
    dof = sum(s.dof for s in scored)
    nis = {NIS: tuple(s.nis / s.dof for s in scored)} if all(s.dof for s in scored) else {}
    return FilterScores(
        {**truth, **scores, **nis},
        {**dict.fromkeys(truth, "m"), **units, **dict.fromkeys(nis, "1")},
        nis=sum(s.nis for s in scored) if dof else None,
        nis_dof=dof,
        withheld=withheld,
        innovations=innovations,
        predictions=joined_predictions([s.predictions for s in scored], 0),
        segment_s=segments.length,
    )
