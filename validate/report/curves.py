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
    """A model's values y (nt,) at its own samples, with the stage q mm and the error, per log.

    Laws reach different strains, so every method has its own samples.
    """

    method: MethodResult
    look: Look
    q: tuple[Floats, ...]
    y: tuple[Floats, ...]
    off: tuple[Floats, ...]


def curves(result: Result) -> Section | None:
    """A picture per recorded signal, one of the volume.

    None when no method finished, and where the stage is no displacement: a load over time.
    """
    if not result.registered or not finished(result):
        return None
    if any(r.stage.unit != "m" for r in result.registered):
        return None
    quantities = dict.fromkeys(s.quantity for r in result.registered for s in r.signals)
    return section(
        "curves",
        "Load and displacement",
        *(_signal(result, quantity) for quantity in quantities),
        _volume(result),
    )


def _observations(result: Result, quantity: str) -> list[tuple[int, Registered, SignalObservation]]:
    """The recordings' signals, from the method that was compared over the longest way."""
    seen = [m for m in finished(result) if _signals(m, quantity)]
    if not seen:
        return []
    return _signals(max(seen, key=lambda m: float(m.registered[0].stage.y.max())), quantity)


def _signals(
    method: MethodResult, quantity: str
) -> list[tuple[int, Registered, SignalObservation]]:
    return [
        (i, r, s)
        for i, r in enumerate(method.registered)
        for s in r.signals
        if s.quantity == quantity
    ]


def _signal(result: Result, quantity: str) -> Picture | None:
    seen = _observations(result, quantity)
    lines, hidden = _lines(result, quantity, seen) if seen else ([], [])
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
        f"{_band_words(lines)}{left_out}",
        f"{quantity} against stage displacement: measured and {names}, with the "
        "differences beside.",
        pixels,
    )


def _band_words(lines: list[_Line]) -> str:
    bands = {line.method.band for line in lines} - {0.0}
    if not bands:
        return ""
    shares = ", ".join(f"{200 * band:.0f} %" for band in sorted(bands))
    return f" Shaded about each line: ± {shares}, two standard uncertainties of the modulus."


def _lines(
    result: Result, quantity: str, seen: Sequence[tuple[int, Registered, SignalObservation]]
) -> tuple[list[_Line], list[str]]:
    """Lines to draw, and the methods whose line lies on one of them."""
    styles, kept, hidden = looks(result), list[_Line](), list[str]()
    scale = max((float(np.ptp(s.y)) for _, _, s in seen), default=0.0)
    for method in finished(result):
        own = _signals(method, quantity)
        if not own or any(x.trace not in method.runs[i].traces for i, _, x in own):
            continue
        q = tuple(_stage(r, x.t) for _, r, x in own)
        y = tuple(_at_samples(method.runs[i], x) for i, _, x in own)
        off = tuple(yi - x.y for yi, (_, _, x) in zip(y, own, strict=True))
        same = next((k for k in kept if _apart(y, k.y) <= _APART * scale), None)
        if same is None:
            kept.append(_Line(method, styles[method.name], q, y, off))
        else:
            hidden.append(f"{method.label} (on {same.method.label})")
    return kept, hidden


def _at_samples(run: Run, seen: SignalObservation) -> Floats:
    return np.asarray(np.interp(seen.t, run.t, run.traces[seen.trace].y))


def _apart(one: tuple[Floats, ...], other: tuple[Floats, ...]) -> float:
    """Largest difference of two lines; infinite when they do not cover the same samples."""
    if any(len(a) != len(b) for a, b in zip(one, other, strict=True)):
        return float("inf")
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
        for j, (q, y, off) in enumerate(zip(line.q, line.y, line.off, strict=True)):
            _plot(left, q, factor * y, line.method.label if j == 0 else None, style)
            _plot(right, q, factor * off, None, {**style, "lw": 0.9})
        if line.method.band:
            y, wide = factor * line.y[0], 2 * line.method.band
            left.fill_between(line.q[0], y * (1 - wide), y * (1 + wide), color=line.look.colour,
                              alpha=0.15, lw=0)  # fmt: skip
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
    low, high = ax.get_ylim()
    if high - low < 0.01:  # an axis of rounding errors would look like an effect
        ax.set_ylim(0.99, 1.01)
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside lower center", ncols=2)
