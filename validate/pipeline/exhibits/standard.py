"""Standard report items: displacements, errors, other cases, speed of each method."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NodeMap, NumberTable, Series
from validate.compare.force_error import TrackError, nrmse, track_error
from validate.compare.row import LongRow, RowBlock
from validate.pipeline.checks.consistency import consistency_exhibit, nis_of
from validate.pipeline.exhibits.gating import estimated_exhibit, gate_exhibit
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.register.markers.markers import MarkerObservation

_MM = 1e3
_ROUNDING = 1e-9  # of the displacements: a map of less would show the computer's arithmetic
_MAPS = 6  # pictures of the mesh in one report


def standard_exhibits(
    experiment: Experiment, main: Mapping[str, MethodRun], others: Cases
) -> tuple[Exhibit, ...]:
    """Displacements and errors on the recorded case, other cases, maps, consistency.

    Of an experiment at holds only other cases and consistency: reports draw its loads.
    """
    over_time = any(f.over_time for f in main.values())
    shown = {n: f for n, f in main.items() if f.shown and over_time}
    found = (
        _displacements(experiment, shown) if shown else None,
        _other_cases(experiment, main, others) if others else None,
        _maps(shown),
        consistency_exhibit(main, others, experiment.accepted),
        gate_exhibit(main, others),
        estimated_exhibit(main, others),
    )
    return tuple(exhibit for exhibit in found if exhibit)


def error_at(followed: MethodRun, probe: str, axis: str) -> TrackError:
    """Estimate less truth at a probe, along an axis, over the whole time."""
    reference = followed.reference(probe)[:, "xyz".index(axis)]
    return track_error(probe, axis, followed.run.traces[f"{probe}.{axis}"].y, reference)


def _displacements(experiment: Experiment, shown: Mapping[str, MethodRun]) -> Exhibit:
    first, axis = next(iter(shown.values())), experiment.axis
    probes = first.scored or first.shown
    charts = [_track_chart(shown, probe, axis) for probe in probes]
    scored = {n: f for n, f in shown.items() if f.scored}
    charts += [_error_chart(scored, probe, axis) for probe in probes if scored]
    words = "Points are measurements; a method uses only the markers in its name."
    if scored:
        words = f"The reference is the twin's true displacement, which no method uses. {words}"
    return Exhibit(
        "displacements",
        "Displacements over time",
        (words,),
        charts=tuple(charts),
    )


def _track_chart(shown: Mapping[str, MethodRun], probe: str, axis: str) -> Chart:
    first = next(iter(shown.values()))
    series = [*_measured(first, probe, axis), *_reference(first, probe, axis)]
    series += [
        Series(f.label, f.own_time, _MM * f.run.traces[f"{probe}.{axis}"].y)
        for f in shown.values()
        if probe in f.shown
    ]
    return Chart(
        f"displacement_{probe}", f"Displacement at {probe}", "recorded time / s", f"u_{axis} / mm",
        tuple(series),
    )  # fmt: skip


def _reference(followed: MethodRun, probe: str, axis: str) -> list[Series]:
    """The twin's truth; none where nobody knows it."""
    if probe not in followed.truth.probes:
        return []
    truth = _MM * followed.truth.probes[probe][:, "xyz".index(axis)]
    t = followed.seen.time_scale * followed.seen.t
    return [Series("reference (twin)", t, truth)]


def _measured(followed: MethodRun, probe: str, axis: str) -> list[Series]:
    markers = followed.seen.of(MarkerObservation)
    seen = next((m for m in markers if probe in m.names), None)
    if seen is None:
        return []
    j, c = seen.names.index(probe), "xyz".index(axis)
    moved = seen.x[:, j, c] - seen.rest[j, c]
    there = np.isfinite(moved)
    t = followed.seen.time_scale * seen.t[there]
    return [Series("measured", t, _MM * moved[there], "points")]


def _error_chart(scored: Mapping[str, MethodRun], probe: str, axis: str) -> Chart:
    """Absolute errors, differences of displacements as large as the reference's range."""
    mine = [f for f in scored.values() if probe in f.scored]
    series = tuple(
        Series(f.label, f.own_time, _MM * np.abs(error_at(f, probe, axis).values)) for f in mine
    )
    moved = max(float(np.ptp(f.reference(probe)[:, "xyz".index(axis)])) for f in mine)
    return Chart(
        f"error_{probe}", f"Error at {probe}", "recorded time / s",
        f"|u_{axis} − reference| / mm", series, log="y",
        caption="Dips toward zero, at a change of sign, are truncated.", scale=_MM * moved,
    )  # fmt: skip


def _other_cases(experiment: Experiment, main: Mapping[str, MethodRun], others: Cases) -> Exhibit:
    axis, probes = experiment.axis, tuple(next(iter(main.values())).truth.probes)
    rows: list[tuple[Entry, ...]] = []
    for name, case in others.items():
        for followed in case.values():
            shown: list[Entry] = [
                100 * nrmse(error_at(followed, p, axis)) if p in followed.scored else None
                for p in probes
            ]
            ended = followed.run.outcome.state
            nis = nis_of(followed)
            rows.append((name, followed.label, *shown, nis.mean if nis else None, ended))
    kind = "truth" if probes else "case"
    errors = "RMSE over the range of the reference, per node, and " if probes else ""
    table = NumberTable(
        "cases",
        f"Every other case: {errors}NIS per degree of freedom (1: consistent; far above 1: the "
        f"model class is wrong).",
        (kind, "method", *(f"{p} NRMSE / %" for p in probes), "NIS per dof / 1", "ended"),
        tuple(rows),
    )
    words = tuple(f"{case.name}: {case.doc}" for case in experiment.cases if case.name in others)
    return Exhibit(
        "cases", f"{kind.capitalize()}s other than the recorded one", words, tables=(table,)
    )


def speed_rows(experiment: Experiment, main: Mapping[str, MethodRun]) -> tuple[RowBlock, ...]:
    """Of every method with step times: its dt, that over the critical one, the real-time factor,
    the cost and the steps, as rows of the long table.

    The real-time factor is recorded over computing time; the cost is computing time over that of
    the experiment's reference.
    """
    base = main.get(experiment.reference)
    cost = _real_time(base) if base else None
    found: list[RowBlock] = []
    for name, f in main.items():
        trace = f.run.traces.get("critical_step")
        limit = float(trace.y.min()) if trace is not None and len(trace.y) else None
        factor = _real_time(f)
        if factor is None:
            continue
        parts = max(float(f.run.traces["updates"].y[0]), 1.0) if limit else 1.0
        dt = _step(f.run.t) / parts
        numbers = {
            "dt": (dt, "s"), "dt over the critical step": (dt / limit if limit else None, "1"),
            "real-time factor": (factor, "1"), "cost": (cost / factor if cost else None, "1"),
            "steps": (float(len(f.run.t)), "1"),
        }  # fmt: skip
        found += [
            RowBlock(LongRow(part="speed", method=name, quantity=quantity, unit=unit),
                     np.array([value]))
            for quantity, (value, unit) in numbers.items() if value is not None
        ]  # fmt: skip
    return tuple(found)


def _real_time(f: MethodRun) -> float | None:
    times = f.run.step_s
    return _step(f.own_time) * times.rate_hz if times else None


def _step(t: Floats) -> float:
    """Length s of a run's steps to times t (nt,) s: the first one starts at 0, or stays there."""
    return float(t[0]) if t[0] > 0 or len(t) < 2 else float(t[1] - t[0])


def _maps(shown: Mapping[str, MethodRun]) -> Exhibit | None:
    """Rms error over the output frames at every node, where truth and model share a mesh."""
    maps = []
    for f in shown.values():
        u, mesh = f.truth.u, f.scene.mesh
        same = f.truth.mesh is not None and np.array_equal(f.truth.mesh.nodes, mesh.nodes)
        every = len(f.run.t) == len(f.seen.t)  # long steps keep other times than the truth
        if u is None or not (same and every) or u.shape != f.run.u.shape:
            continue
        error = np.sqrt(((f.run.u - u) ** 2).sum(axis=2).mean(axis=0))
        if error.max() > _ROUNDING * np.abs(u).max():
            title = f"{f.label}: rms error over time at every node"
            maps.append(NodeMap(f"error_{f.method}", title, mesh, _MM * error, "mm", "error"))
    if not maps:
        return None
    return Exhibit("error-maps", "Errors by node", maps=tuple(maps[:_MAPS]))
