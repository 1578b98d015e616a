"""Curves over the drive's displacement: what was measured, the models, and their difference."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Exhibit, NumberTable, Series, TableCell
from validate.compare.result import MethodResult, Result
from validate.register.registered import Registered
from validate.register.signals import SignalObservation
from validate.report.numbers import scale, shown_unit
from validate.report.observed import distinct, drive, driven, finished, signals

_MM = 1e3
_AXIS = {"Pa": ("kPa", 1e-3)}
_ON_ANOTHER = 0.01  # share of a signal's range below which two models draw one line
_HEAD = ("recording", "who", "quantity", "t_s", "drive_m", "value", "unit")
Log = tuple[int, Registered, SignalObservation]  # which recording, and its signal


@dataclass(frozen=True)
class _Line:
    """A model's values y (nt,) at the samples of each log, the drive q mm there, and the error.

    Laws reach different strains, so every method has its own samples.
    """

    method: MethodResult
    q: tuple[Floats, ...]
    y: tuple[Floats, ...]
    off: tuple[Floats, ...]


def curves(result: Result) -> Exhibit | None:
    """Charts of every recorded signal and of the volume where displacements drive."""
    if any(drive(r).unit != "m" for r in result.registered):
        return None
    quantities = dict.fromkeys(s.quantity for r in result.registered for s in signals(r))
    charts = [c for q in quantities for c in _signal(result, q)]
    rows = tuple(_samples(result))
    return Exhibit(
        "curves", "Load and displacement", charts=(*charts, *_volume(result)),
        data=(NumberTable("load_displacement", "Load and displacement", _HEAD, rows),),
    )  # fmt: skip


def _samples(result: Result) -> Iterator[tuple[str | TableCell, ...]]:
    """Every recorded sample and every method's value at its time."""
    for i, registered in enumerate(result.registered):
        name = result.recordings[i].name if i < len(result.recordings) else str(i + 1)
        for s in signals(registered):
            answers = [(m.name, m.runs[i]) for m in result.methods]
            found = [("measured", s.y[:, 0])]
            found += [(who, np.interp(s.t, run.t, run.traces[s.trace].y)) for who, run in answers
                      if run.finished and s.trace in run.traces]  # fmt: skip
            q = driven(registered, s.t)
            for who, y in found:
                for numbers in zip(s.t.tolist(), q.tolist(), y.tolist(), strict=True):
                    yield name, who, s.quantity, *map(TableCell, numbers), s.unit


# --- one signal ----------------------------------------------------------------------------------


def _signal(result: Result, quantity: str) -> tuple[Chart, ...]:
    lines, hidden = _lines(result, quantity)
    if not lines:
        return ()
    longest = max(lines, key=lambda line: max(float(q.max()) for q in line.q))
    logs = _logs(longest.method, quantity)
    unit, name = logs[0][2].unit, quantity.replace(".", "_")
    unit, factor = _AXIS.get(unit, (shown_unit(unit), scale(unit)))
    count = f"{len(logs)} recordings" if len(logs) > 1 else "one recording"
    q, noise = f"{drive(logs[0][1]).name} / mm", 2 * factor * max(s.sd for _, _, s in logs)
    simulated = (s for line in lines for s in _level(result, line, factor))
    level = Chart(
        f"curve_{name}", f"{quantity}, measured and simulated", q, f"{quantity} / {unit}",
        (*_measured(result, logs, factor), *simulated),
        caption=f"Points: every sample of {count}.{_band_words(lines)}{_left_out(hidden)}",
    )  # fmt: skip
    ends = np.array([f(q) for f in (np.min, np.max) for q in [np.hstack(longest.q)]])
    band = Series("± 2 sd of one sample", ends, 0 * ends - noise, "band", 0 * ends + noise)
    off = Chart(
        f"curve_{name}_error", f"{quantity}, model minus measurement", q,
        f"simulated − measured / {unit}",
        (band, *(s for line in lines for s in _off(result, line, factor))), linear=noise,
        caption="Outside the grey band the axis is logarithmic.",
    )  # fmt: skip
    return level, off


def _logs(method: MethodResult, quantity: str) -> list[Log]:
    """The recordings' signals of a quantity, as the method was compared with them."""
    return [
        (i, r, s)
        for i, r in enumerate(method.registered)
        for s in signals(r)
        if s.quantity == quantity
    ]


def _lines(result: Result, quantity: str) -> tuple[list[_Line], list[str]]:
    """Lines to draw, and the methods whose line lies on one of them."""
    made = [line for m in finished(result) if (line := _line(m, quantity)) is not None]
    if not made:
        return [], []
    span = max(float(np.ptp(s.y)) for line in made for _, _, s in _logs(line.method, quantity))
    pairs = [(line.method, np.hstack(line.y)) for line in made]
    on = distinct(pairs, _ON_ANOTHER * span)
    drawn = [line for line in made if line.method.name not in on]
    labels = {m.name: m.label for m in result.methods}
    return drawn, [f"{labels[one]} (on {other.label})" for one, other in on.items()]


def _line(method: MethodResult, quantity: str) -> _Line | None:
    logs = _logs(method, quantity)
    if not logs or any(s.trace not in method.runs[i].traces for i, _, s in logs):
        return None
    runs = [method.runs[i] for i, _, _ in logs]
    q = tuple(_MM * driven(r, s.t) for _, r, s in logs)
    y = tuple(
        np.interp(s.t, run.t, run.traces[s.trace].y)
        for run, (_, _, s) in zip(runs, logs, strict=True)
    )
    return _Line(method, q, y, tuple(a - s.y[:, 0] for a, (_, _, s) in zip(y, logs, strict=True)))


def _measured(result: Result, logs: list[Log], factor: float) -> Iterator[Series]:
    for i, registered, s in logs:
        label = f"measured, {result.recordings[i].name}" if len(logs) > 1 else "measured"
        yield Series(label, _MM * driven(registered, s.t), factor * s.y[:, 0], "points")


def _of(result: Result, line: _Line) -> list[str]:
    """Which recording each of a method's lines is of; nothing where there is one."""
    names = [r.name for r in result.recordings]
    return names if len(line.q) > 1 else [""]


def _level(result: Result, line: _Line, factor: float) -> Iterator[Series]:
    """The model's line of every log; about the first the uncertainty of its modulus."""
    label, wide = line.method.label, 2 * line.method.band
    if wide:
        y = factor * line.y[0]
        yield Series(label, line.q[0], y * (1 - wide), "band", y * (1 + wide))
    for of, q, y in zip(_of(result, line), line.q, line.y, strict=False):
        yield Series(label, q, factor * y, of=of)


def _off(result: Result, line: _Line, factor: float) -> Iterator[Series]:
    for of, q, off in zip(_of(result, line), line.q, line.off, strict=False):
        yield Series(line.method.label, q, factor * off, of=of)


def _band_words(lines: list[_Line]) -> str:
    bands = {line.method.band for line in lines} - {0.0}
    if not bands:
        return ""
    shares = ", ".join(f"{200 * band:.0f} %" for band in sorted(bands))
    return f" Shaded about a line: ± {shares}, two standard uncertainties of the modulus."


def _left_out(hidden: list[str]) -> str:
    return f" Not drawn, as they coincide with another line: {'; '.join(hidden)}." if hidden else ""


# --- volume --------------------------------------------------------------------------------------


def _volume(result: Result) -> tuple[Chart, ...]:
    series = tuple(
        Series(m.label, _MM * driven(result.registered[0], m.run.t), trace.y)
        for m in finished(result)
        for name, trace in m.run.traces.items()
        if name.endswith(".volume_ratio")
    )
    if not series:
        return ()
    caption = "An incompressible fluid holds it at 1; without fluid it falls."
    q = f"{drive(result.registered[0]).name} / mm"
    title = "Cavity volume over its rest volume"
    return (Chart("volume_ratio", title, q, "volume / rest volume", series, caption=caption),)
