"""Curves over the stage's displacement: force, pressure, volume, and model less measurement."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.result import MethodResult, Result
from validate.register.observe import Registered, SignalObservation
from validate.report.observed import finished
from validate.report.page import Picture, Section, section
from validate.report.style import MEASURED, NOISE, Look, draw, looks
from validate.solve.types import Run

_MM = 1e3
_AXIS = {"Pa": ("kPa", 1e-3), "m": ("mm", 1e3)}
_APART = 0.01  # share of a signal's range below which two models draw one line
_GREYS = ("#000000", "#5F5F5F", "#8C8C8C", "#AFAFAF")


@dataclass(frozen=True)
class _Line:
    """A model's values (nt,) at the measurement's samples, in the signal's unit."""

    method: MethodResult
    look: Look
    y: tuple[Floats, ...]


def curves(result: Result) -> Section | None:
    """A picture per recorded signal, one of the volume; None when no method finished."""
    if not result.registered or not finished(result):
        return None
    quantities = dict.fromkeys(s.quantity for r in result.registered for s in r.signals)
    return section(
        "curves",
        "Load and displacement",
        *(_signal(result, quantity) for quantity in quantities),
        _volume(result),
    )


def _observations(result: Result, quantity: str) -> list[tuple[int, Registered, SignalObservation]]:
    return [
        (i, r, s)
        for i, r in enumerate(result.registered)
        for s in r.signals
        if s.quantity == quantity
    ]


def _signal(result: Result, quantity: str) -> Picture | None:
    seen = _observations(result, quantity)
    lines, hidden = _lines(result, seen)
    left_out = f" Not drawn, lying on another line: {'; '.join(hidden)}." if hidden else ""
    if not lines:
        return None
    unit, factor = _AXIS.get(seen[0][2].unit, (seen[0][2].unit, 1.0))
    pixels = draw(lambda f: _two(f, quantity, seen, lines, unit, factor), 10.4, 4.6)
    names = ", ".join(line.method.label for line in lines)
    count = f"{len(seen)} recordings" if len(seen) > 1 else "one recording"
    return Picture(
        f"curve_{quantity.replace('.', '_')}",
        f"Left: {quantity} in {unit} against stage displacement in mm, "
        f"every sample of {count} (points) and the models (lines). Right: model less measurement; "
        "grey: ± 2 standard deviations of one sample; outside of it the axis is logarithmic."
        f"{left_out}",
        f"{quantity} against stage displacement: measured and {names}, with the "
        "differences beside.",
        pixels,
    )


def _lines(
    result: Result, seen: Sequence[tuple[int, Registered, SignalObservation]]
) -> tuple[list[_Line], list[str]]:
    """Lines to draw, and the methods whose line lies on one of them."""
    styles, kept, hidden = looks(result), list[_Line](), list[str]()
    scale = max((float(np.ptp(s.y)) for _, _, s in seen), default=0.0)
    for method in finished(result):
        if any(s.trace not in method.runs[i].traces for i, _, s in seen):
            continue
        y = tuple(_at_samples(method.runs[i], s) for i, _, s in seen)
        same = next((k for k in kept if _apart(y, k.y) <= _APART * scale), None)
        if same is None:
            kept.append(_Line(method, styles[method.name], y))
        else:
            hidden.append(f"{method.label} (on {same.method.label})")
    return kept, hidden


def _at_samples(run: Run, seen: SignalObservation) -> Floats:
    return np.asarray(np.interp(seen.t, run.t, run.traces[seen.trace].y))


def _apart(one: tuple[Floats, ...], other: tuple[Floats, ...]) -> float:
    return max(float(np.abs(a - b).max()) for a, b in zip(one, other, strict=True))


def _two(
    figure: Figure,
    quantity: str,
    seen: Sequence[tuple[int, Registered, SignalObservation]],
    lines: list[_Line],
    unit: str,
    factor: float,
) -> None:
    left, right = figure.subplots(1, 2)
    noise = 2 * factor * max(s.sd for _, _, s in seen)
    right.axhspan(-noise, noise, color=NOISE, lw=0)
    right.axhline(0, color=MEASURED, lw=0.8)
    for j, (_, registered, s) in enumerate(seen):
        q = _stage(registered, s.t)
        label = "measured" if j == 0 else None
        left.plot(q, factor * s.y, ".", color=_GREYS[j % len(_GREYS)], ms=3, label=label, zorder=3)
        for line in lines:
            style = {"color": line.look.colour, "ls": line.look.dash, "lw": line.look.width}
            label = line.method.label if j == 0 else None
            _plot(left, q, factor * line.y[j], label, style)
            _plot(right, q, factor * (line.y[j] - s.y), None, {**style, "lw": 0.9})
    left.set(xlabel="stage displacement / mm", ylabel=f"{quantity} / {unit}")
    right.set(xlabel="stage displacement / mm", ylabel=f"model − measured / {unit}")
    if noise > 0:
        right.set_yscale("symlog", linthresh=noise, linscale=0.7)
        right.yaxis.set_major_formatter(lambda v, _: f"{v:g}".replace("-", "−"))
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _plot(ax: Axes, x: Floats, y: Floats, label: str | None, style: dict[str, object]) -> None:
    ax.plot(x, y, label=label, **style)  # type: ignore[arg-type]


def _stage(registered: Registered, t: Floats) -> Floats:
    """Stage position mm at times t (nt,) s."""
    return np.asarray(_MM * np.interp(t, registered.stage.t, registered.stage.y[:, 0]))


def _volume(result: Result) -> Picture | None:
    names = [
        (m, [n for n in m.run.traces if n.endswith(".volume_ratio")]) for m in finished(result)
    ]
    drawn = [(m, n) for m, found in names for n in found]
    if not drawn:
        return None
    pixels = draw(lambda f: _volume_axes(f, result, drawn), 7.0, 3.9)
    return Picture(
        "curve_volume_ratio",
        "Cavity volume over its rest volume against stage displacement in mm, by model. An "
        "incompressible fluid holds it at 1; without fluid it falls.",
        "Cavity volume ratio against stage displacement for every model.",
        pixels,
    )


def _volume_axes(figure: Figure, result: Result, drawn: list[tuple[MethodResult, str]]) -> None:
    ax, styles = figure.subplots(), looks(result)
    for method, name in reversed(drawn):
        look, run = styles[method.name], method.run
        ax.plot(_stage(result.registered[0], run.t), run.traces[name].y, color=look.colour,
                ls=look.dash, lw=look.width, label=method.label)  # fmt: skip
    ax.set(xlabel="stage displacement / mm", ylabel="volume / rest volume")
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside lower center", ncols=2)
