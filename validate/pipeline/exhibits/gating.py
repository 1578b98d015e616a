"""Measurements that a filter's gate rejected: number, marker, time and distance."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series, TableCell
from validate.pipeline.checks.consistency import nis_of
from validate.pipeline.run.method_run import Cases, MethodRun

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
