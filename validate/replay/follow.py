"""What every experiment over time shows: displacements, errors, what each method cost."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, NodeMap, NumberTable, Series
from validate.compare.track import TRACK_METRICS, TrackError, nrmse, track_error
from validate.replay.tracking import Cases, Followed, Tracking, own_time

_MM = 1e3
_MAPS = 6  # pictures of the mesh in one report


def standard_exhibits(
    experiment: Tracking, main: Mapping[str, Followed], others: Cases, docs: Mapping[str, str]
) -> tuple[Exhibit, ...]:
    """Displacements and errors on the recorded case, wrong-model cases, speeds, maps."""
    scored = {n: f for n, f in main.items() if f.scored}
    found = [_displacements(experiment, scored)] if scored else []
    if others:
        found.append(_other_cases(experiment, main, others, docs))
    found.append(_speeds(experiment, main))
    maps = _maps(scored)
    return (*found, *((maps,) if maps else ()))


def error_at(followed: Followed, probe: str, axis: str) -> TrackError:
    """Estimate less truth at a probe, along an axis, over the whole time."""
    reference = followed.reference(probe)[:, "xyz".index(axis)]
    return track_error(probe, axis, followed.run.traces[f"{probe}.{axis}"].y, reference)


def _displacements(experiment: Tracking, scored: Mapping[str, Followed]) -> Exhibit:
    first, axis = next(iter(scored.values())), experiment.axis
    probes = tuple(first.truth.probes)
    charts = [
        replace(chart, caption=experiment.captions.get(chart.name, ""))
        for chart in (_track_chart(scored, probe, axis) for probe in probes)
    ]
    charts += [_error_chart(scored, probe, axis) for probe in probes]
    return Exhibit(
        "displacements",
        "Displacements over time",
        (
            "The reference is the twin's own displacement, which no method sees. Points are what "
            "was measured there; only the markers named in a method are given to it.",
        ),
        tables=(_error_table(scored, axis),),
        charts=tuple(charts),
    )


def _track_chart(scored: Mapping[str, Followed], probe: str, axis: str) -> Chart:
    first = next(iter(scored.values()))
    series = [*_measured(first, probe, axis)]
    truth = _MM * first.truth.probes[probe][:, "xyz".index(axis)]
    series.append(Series("reference (twin)", first.seen.time_scale * first.seen.stage.t, truth))
    series += [
        Series(f.label, own_time(f), _MM * f.run.traces[f"{probe}.{axis}"].y)
        for f in scored.values()
        if probe in f.scored
    ]
    return Chart(
        f"displacement_{probe}", f"Displacement at {probe}", "recorded time / s", f"u_{axis} / mm",
        tuple(series),
    )  # fmt: skip


def _measured(followed: Followed, probe: str, axis: str) -> list[Series]:
    seen = followed.seen.markers
    if seen is None or probe not in seen.names:
        return []
    j, c = seen.names.index(probe), "xyz".index(axis)
    moved = seen.x[:, j, c] - seen.rest[j, c]
    there = np.isfinite(moved)
    t = followed.seen.time_scale * seen.t[there]
    return [Series("measured", t, _MM * moved[there], "points")]


def _error_chart(scored: Mapping[str, Followed], probe: str, axis: str) -> Chart:
    """Absolute errors; those far below the largest are drawn at a floor."""
    mine = [f for f in scored.values() if probe in f.scored]
    lines = [np.abs(error_at(f, probe, axis).values) for f in mine]
    floor = max((float(y.max()) for y in lines), default=0.0) * 1e-5 or 1e-12
    series = tuple(
        Series(f.label, own_time(f), _MM * np.maximum(y, floor))
        for f, y in zip(mine, lines, strict=True)
    )
    return Chart(
        f"error_{probe}", f"Error at {probe}", "recorded time / s",
        f"|u_{axis} − reference| / mm", series, log="y",
        caption=f"Errors below {_MM * floor:.1e} mm are drawn there.",
    )  # fmt: skip


def _error_table(scored: Mapping[str, Followed], axis: str) -> NumberTable:
    rows = [
        (f.label, probe, *_statistics(error_at(f, probe, axis)))
        for f in scored.values()
        for probe in f.scored
    ]
    return NumberTable(
        "errors",
        f"Errors of u_{axis} against the twin's truth. SD: sample standard deviation (ddof 1) of "
        "the absolute error. NRMSE: RMSE over the range (largest less smallest) of the reference.",
        ("method", "node", "MAE / mm", "RMSE / mm", "SD / mm", "max / mm", "NRMSE / 1", "times"),
        tuple(rows),
    )


def _statistics(error: TrackError) -> tuple[Entry, ...]:
    values = {name: metric(error) for name, metric, _, _ in TRACK_METRICS}
    lengths = (_MM * values[n] for n in ("mae", "rmse", "sd", "max"))
    return (*lengths, values["nrmse"], len(error.values))


def _other_cases(
    experiment: Tracking, main: Mapping[str, Followed], others: Cases, docs: Mapping[str, str]
) -> Exhibit:
    axis, probes = experiment.axis, tuple(next(iter(main.values())).truth.probes)
    rows: list[tuple[Entry, ...]] = []
    for name, case in others.items():
        for followed in case.values():
            shown: list[Entry] = [
                100 * nrmse(error_at(followed, p, axis)) if p in followed.scored else None
                for p in probes
            ]
            ended = followed.run.outcome.state
            rows.append((name, followed.label, *shown, _nis(followed), ended))
    table = NumberTable(
        "cases",
        "Every other case: RMSE over the range of the reference, per node, and "
        "NIS per degree of freedom (1: consistent; far above: the model class is wrong).",
        ("truth", "method", *(f"{p} NRMSE / %" for p in probes), "NIS per dof / 1", "ended"),
        tuple(rows),
    )
    words = tuple(f"{name}: {docs[name]}" for name in others)
    return Exhibit("cases", "Other truths than the recorded one", words, tables=(table,))


def _nis(followed: Followed) -> float | None:
    nis, dof = followed.run.traces.get("nis"), followed.run.traces.get("nis.dof")
    if nis is None or dof is None or not dof.y.any():
        return None
    return float(nis.y.sum() / dof.y.sum())


def _speeds(experiment: Tracking, main: Mapping[str, Followed]) -> Exhibit:
    base = main.get(experiment.reference)
    factor = _real_time(base) if base else None
    named = base.label if base else "not run"
    table = NumberTable(
        "speeds",
        "Time per step, every method in this run on this machine, one thread. The real-time factor "
        "is recorded over computing time; cost is computing time per recorded time over that of "
        f"'{named}'. dt is that of a step of the integration.",
        ("method", "set-up / s", "step p50 / ms", "p99 / ms", "rate / Hz", "dt / ms",
         "dt over critical / 1", "real-time factor / 1", "cost / 1", "steps", "ended"),
        tuple(_speed_row(f, factor) for f in main.values()),
    )  # fmt: skip
    return Exhibit("speeds", "Time per step", tables=(table,))


def _real_time(f: Followed) -> float | None:
    times = f.run.step_s
    return float(own_time(f)[0]) * times.rate_hz if times else None  # the first step starts at 0


def _speed_row(f: Followed, base: float | None) -> tuple[Entry, ...]:
    times, end, factor = f.run.step_s, f.run.outcome, _real_time(f)
    ended = end.state if end.state == "finished" else f"{end.state} at step {end.step}: {end.why}"
    if times is None or factor is None:
        return (f.label, f.run.setup_s, *(7 * (None,)), 0, ended)
    parts = max(float(f.run.traces["updates"].y[0]), 1.0) if _limit(f) else 1.0
    dt = float(f.run.t[0]) / parts
    limit = _limit(f)
    return (
        f.label, f.run.setup_s, 1e3 * times.p50, 1e3 * times.p99, times.rate_hz, 1e3 * dt,
        dt / limit if limit else None, factor, base / factor if base else None, len(f.run.t), ended,
    )  # fmt: skip


def _limit(f: Followed) -> float | None:
    """The critical step s that an explicit run watched, the least of the run."""
    trace = f.run.traces.get("critical_step")
    return float(trace.y.min()) if trace is not None and len(trace.y) else None


def _maps(scored: Mapping[str, Followed]) -> Exhibit | None:
    """Rms error over the output frames at every node, where truth and model share a mesh."""
    maps = []
    for f in scored.values():
        u, mesh = f.truth.u, f.scene.mesh
        same = f.truth.mesh is not None and np.array_equal(f.truth.mesh.nodes, mesh.nodes)
        every = len(f.run.t) == len(f.seen.stage.t)  # long steps keep other times than the truth
        if u is None or not (same and every) or u.shape != f.run.u.shape:
            continue
        error = np.sqrt(((f.run.u - u) ** 2).sum(axis=2).mean(axis=0))
        if error.any():
            title = f"{f.label}: rms error over time at every node"
            maps.append(NodeMap(f"error_{f.method}", title, mesh, _MM * error, "mm", "error"))
    if not maps:
        return None
    return Exhibit("error-maps", "Where the errors are", maps=tuple(maps[:_MAPS]))
