"""Standard report items: displacements, errors, speed, external simulators, rejected data."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NodeMap, NumberTable, Series, TableCell
from validate.compare.force_error import TrackError, nrmse, track_error
from validate.compare.row import LongRow, RowBlock
from validate.pipeline.checks.checks import Terms, terms_of
from validate.pipeline.checks.consistency import consistency_exhibit, nis_of
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import external_methods
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.pipeline.run.runs import ExperimentRuns
from validate.register.markers.markers import MarkerObservation
from validate.solve.external.scheme import ExternalSimulator, changes

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


# --- table of external simulators and internal methods: error, verdict, rate and memory ----------

_HEAD = ("method", "program", "check", "error E", "2 u_val", "margin", "acceptance",
         "validation", "rate / Hz", "memory / MB", "ended")  # fmt: skip
_NAME = "external_simulators"
_OURS = "this one"
_MB = 1e-6
_WORDS = (
    "All use the u_val of the accepted method: its measurement, inputs and mesh error. The "
    "mesh error of an external simulator is part of its E. Only accepted methods set the exit "
    "code. A rate is that of one step (statics: one equilibrium) on one thread. Memory is the "
    "peak of the external simulator's largest process; for our methods it is the peak of the "
    "whole process until then."
)


def external_exhibits(runs: ExperimentRuns, main: Mapping[str, MethodRun]) -> tuple[Exhibit, ...]:
    """Return the table and the deviations; empty if no external simulator ran."""
    simulators = external_methods({n: m for n, m in runs.methods.items() if n in main})
    if not simulators:
        return ()
    accepted = [n for n in runs.experiment.accepted if n in main][:1]
    terms = {k: t for n in accepted for _, one in terms_of(runs, main[n]) for k, t in one.items()}
    made = {n: _rows(f, runs.methods[n].settings, terms) for n, f in main.items()}
    checks = {row[2] for n in simulators for row in made[n]}  # ours are shown beside theirs alone
    rows = [row for own in made.values() for row in own if row[2] in checks]
    said = []
    for name in simulators:
        lines = dict.fromkeys(line for run in main[name].runs for line in run.said)
        said += [(main[name].label, s) for s in lines if not s.startswith("external: ")]
    tables = [NumberTable(_NAME, "External simulators and our methods", _HEAD, tuple(rows))]
    if said:
        head = ("simulator", "deviations and failures")
        tables.append(NumberTable("external_findings", "Findings", head, tuple(said)))
    return (Exhibit(_NAME, "External simulators", (_WORDS,), tables=tuple(tables)),)


def _rows(
    f: MethodRun, settings: Any, terms: Mapping[str, Terms]
) -> list[tuple[TableCell | float | str | None, ...]]:
    """A row a check; one alone where an external one was not run, or has nothing checked."""
    run, external = f.run, isinstance(settings, ExternalSimulator)
    named = [line.removeprefix("external: ") for line in run.said if line.startswith("external: ")]
    program = next(iter(named), "-") if external else _OURS
    rate = _rate(f, settings)
    memory = _MB * run.memory or None
    end = run.outcome.state + (f": {run.outcome.why}" if run.outcome.why else "")
    cost = (rate, memory, end)
    judged = [t.judge(f.residuals[k]) for k, t in terms.items() if k in f.residuals]
    if not judged and not external:
        return []
    if not judged or not run.finished:
        return [(f.label, program, "-", None, None, None, "-", "-", *cost)]
    return [
        (f.label, program, c.name,
         *(TableCell(number, c.unit) for number in (c.value, 2 * c.u_val, c.margin)),
         c.acceptance, c.validation, *cost)
        for c in judged
    ]  # fmt: skip


def _rate(f: MethodRun, settings: Any) -> float | None:
    """Steps a second; of statics only those whose inputs are new count: others are answered by
    what is there."""
    run, handles = f.run, getattr(settings, "handles", None)
    if run.step_s is None:
        return None
    still = handles is not None and not handles.inertia
    if not still or run.seconds is None or f.seen.inputs.shape[0] < len(run.seconds):
        return run.step_s.rate_hz
    new = changes(f.seen.t[: len(run.seconds)], f.seen.inputs[: len(run.seconds)])
    at = np.searchsorted(f.seen.t, new.t)
    return 1 / float(np.median(run.seconds[at]))


# --- What filters found of the model itself: stiffness, supports and loads over time, and
# whether the markers that they were given can tell them.

# Share of the start's sd: with more left, less than three quarters of what is known were measured.
LEFT = 0.5
TIED = 0.95  # |correlation| from which two parameters are known together only
_AXIS = {"Pa": ("kPa", 1e-3)}
_OF, _BETWEEN = "estimate.", "correlation."


def estimated_exhibit(main: Mapping[str, MethodRun], others: Cases) -> Exhibit | None:
    """None where no filter estimates parameters."""
    runs = [f for f in (*main.values(), *(f for c in others.values() for f in c.values()))
            if parameters_of(f)]  # fmt: skip
    if not runs:
        return None
    table = NumberTable(
        "estimates",
        "Parameters at the end of the run with their 95 % intervals, as the filter claims them, "
        "and the remaining share of the initial sd (of a scale's logarithm).",
        ("case", "filter", "parameter", "value", "95 % from", "to", "sd left / 1", "finding"),
        tuple(_row(f, name) for f in runs for name in parameters_of(f)),
        "Intervals hold if the truth is of the model's kind: check NIS and its alarm, too.",
        below="finding",
    )
    told = tuple(s for f in main.values() for s in sentences(f))
    charts = tuple(_chart(f, name) for f in main.values() for name in parameters_of(f))
    title = "Stiffness, supports and loads estimated by filters"
    return Exhibit("estimates", title, told, (table,), charts)


def parameters_of(f: MethodRun) -> tuple[str, ...]:
    """Return the names of what a filter's run estimated."""
    ends = [n for n in f.run.traces if n.startswith(_OF) and n.endswith(".left")]
    found = [n.removeprefix(_OF).removesuffix(".left") for n in ends]
    return tuple(found) if len(f.run.t) else ()


def sentences(f: MethodRun) -> tuple[str, ...]:
    """One on every parameter that the markers could not tell."""
    return tuple(
        f"{f.label}, {name}: {said}" for name in parameters_of(f) if (said := doubt(f, name))
    )


def doubt(f: MethodRun, name: str) -> str:
    """Why a parameter is not identifiable, or its interval does not hold; empty where both do."""
    nis = nis_of(f)
    if nis and nis.mean > nis.band_999.high:
        return (
            f"the interval does not hold: NIS {nis.mean:.3g} per degree of freedom, at most "
            f"{nis.band_999.high:.3g} by chance: the model differs in kind from the truth"
        )
    # The parameter that this one moves with most, if it does
    found = [("", 0.0)]
    for trace in f.run.traces:
        pair = trace.removeprefix(_BETWEEN).split("~")
        if trace.startswith(_BETWEEN) and name in pair:
            found.append((next(p for p in pair if p != name), _last(f, trace)))
    most = max(found, key=lambda pair: abs(pair[1]))
    other, tie = most if abs(most[1]) >= TIED else ("", 0.0)
    left = _last(f, f"{_OF}{name}.left")
    if left <= LEFT:
        return ""
    words = f"not identifiable from these markers: {left:.2g} of the sd at the start is left"
    return f"{words}; known only together with {other}, correlation {tie:.3f}" if other else words


def _last(f: MethodRun, trace: str) -> float:
    return float(f.run.traces[trace].y[-1])


def _row(f: MethodRun, name: str) -> tuple[TableCell | str | float, ...]:
    unit = f.run.traces[_OF + name].unit
    numbers = (_last(f, f"{_OF}{name}{end}") for end in ("", ".low", ".high"))
    axis, factor = _AXIS.get(unit, (unit, 1.0))
    end = "" if axis == "1" else f" {axis}"
    # Five digits: an interval may be narrow.
    shown = (TableCell(v, unit, text=f"{factor * v:.5g}{end}") for v in numbers)
    said = doubt(f, name) or "identified"
    left = _last(f, f"{_OF}{name}.left")
    return (f.case or "recorded", f.label, name, *shown, left, said)


def _chart(f: MethodRun, name: str) -> Chart:
    unit = f.run.traces[_OF + name].unit
    axis, factor = _AXIS.get(unit, (unit, 1.0))

    def over_time(end: str) -> Floats:
        return np.asarray(factor * f.run.traces[f"{_OF}{name}{end}"].y)

    series = (
        Series("95 % interval", f.own_time, over_time(".low"), "band", over_time(".high")),
        Series(f.label, f.own_time, over_time("")),
    )
    return Chart(
        f"estimate_{f.method}_{name.replace('.', '_')}", f"{name}, by {f.label}",
        "recorded time / s", f"{name} / {axis}", series,
    )  # fmt: skip


# -------------------------------------------------------------------------------------------------

_FAR = "gate.far."
_DRAWN = 3  # rejected looks from which a picture says more than the table
_MOST = 0.5  # share of rejected looks from which a filter follows itself, not the recording


def gate_exhibit(main: Mapping[str, MethodRun], others: Cases) -> Exhibit | None:
    """None where no filter has a gate."""
    every = [*main.values(), *(f for case in others.values() for f in case.values())]
    gated = [f for f in every if "gate.rejected" in f.run.traces and len(f.run.t)]
    if not gated:
        return None
    table = NumberTable(
        "gate",
        "Samples of a marker with an innovation beyond the gate of the filter; they were treated "
        "as missing. Expected: number for a filter whose claimed errors hold. Far: largest "
        "rejected innovation, in its standard deviations.",
        ("case", "filter", "marker", "samples", "rejected", "expected / 1", "first / s", "last / s",
         "far / 1"),
        tuple(_gated_row(f, marker) for f in gated for marker in _markers(f)),
        "NIS and whiteness above use the accepted samples.",
    )  # fmt: skip
    words = gate_warnings(main)
    charts = tuple(_gated_chart(f) for f in gated if _rejected(f) >= _DRAWN)
    return Exhibit("gate", "Rejected measurements", words, (table,), charts)


def gate_warnings(main: Mapping[str, MethodRun]) -> tuple[str, ...]:
    """Return a sentence on every filter whose gate rejected more looks than it let pass."""
    found = []
    for f in main.values():
        tested = int(_sum(f, "gate.tested"))
        rejected = _rejected(f)
        if tested and rejected > _MOST * tested:
            found.append(
                f"{f.label}: its gate rejected {rejected} of {tested} samples, "
                f"{_sum(f, 'gate.expected'):.2g} expected: it follows its model, not the "
                f"recording; increase R or the process noise, or remove the gate"
            )
    return tuple(found)


def _markers(f: MethodRun) -> list[str]:
    return [n.removeprefix(_FAR) for n in f.run.traces if n.startswith(_FAR)]


def _sum(f: MethodRun, name: str) -> float:
    trace = f.run.traces.get(name)
    return 0.0 if trace is None else float(trace.y.sum())


def _rejected(f: MethodRun) -> int:
    return int(_sum(f, "gate.rejected"))


def _gated_row(f: MethodRun, marker: str) -> tuple[Entry, ...]:
    far, t = f.run.traces[_FAR + marker].y, f.own_time
    off = far > 0
    # At which steps (nt,) a sample of the marker reached the filter
    names = [f"innovation.{marker}.{c}.sd" for c in "xyz"]
    found = [f.run.traces[name].y > 0 for name in names if name in f.run.traces]
    looks = int((np.any(found, axis=0) | off).sum())
    share = _sum(f, "gate.expected") / max(_sum(f, "gate.tested"), 1.0)
    when: tuple[Entry, ...] = (None, None, None)
    if off.any():
        when = (float(t[off][0]), float(t[off][-1]), float(far.max()))
    return (f.case or "recorded", f.label, marker, looks, int(off.sum()), share * looks, *when)


def _gated_chart(f: MethodRun) -> Chart:
    series = []
    for marker in _markers(f):
        far = f.run.traces[_FAR + marker].y
        if (far > 0).any():
            series.append(Series(marker, f.own_time[far > 0], far[far > 0], "points"))
    return Chart(
        "_".join(("gate", f.method, *filter(None, [f.case]))),
        ", ".join((f"Rejected samples of {f.label}", *filter(None, [f.case]))), "recorded time / s",
        "standard deviations off / 1", tuple(series), log="y", scale=1.0,
    )  # fmt: skip
