"""Distinguishable effects of a recording: errors and effects against sensor noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from scipy.special import chdtri

from validate.arrays import rms
from validate.compare.effects import TELLS_APART, Effect
from validate.compare.exhibit import Exhibit, Picture
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.numbers import at_load, with_unit
from validate.report.charts.style import ACCEPTED, MEASURED, NOISE, WIDTH, draw, panels
from validate.report.sections.observations import finished, last_residual

_LOWEST = 0.02  # ratios below lie there, as a sign that points on
_LINE, _ROOM = 0.145, 0.62  # inches of a line of a model's name; of title and ticks
_NAME = 32  # letters of a model's name in one line


def discrimination(result: Result) -> Exhibit:
    """Errors over noise, and in words which effects the recording shows."""
    # The effects in what a sensor measured: a reference without noise separates everything
    residuals = [r for m in result.methods for r in m.residuals.values()]
    measured = {r.name for r in residuals if r.sd > 0}
    effects = tuple(
        replace(e, changes=tuple(c for c in e.changes if c.name in measured))
        for e in result.effects
    )
    return Exhibit(
        "discrimination",
        "Which effects this recording can distinguish",
        tuple(map(_sentence, effects)),
        pictures=over_noise(result),
    )


def _sentence(effect: Effect) -> str:
    opening = f"{effect.name.capitalize()} ({effect.doc})"
    seen = list(dict.fromkeys(name.split("@")[0] for name in effect.seen_by))
    if seen:
        return f"{opening}: this recording can distinguish it, by {_listed(seen)}."
    best = max(effect.changes, key=lambda c: c.separation, default=None)
    size = ""
    if best is not None and best.separation > 0:
        size = (
            f" (best: {best.name}, {with_unit(best.rms, best.unit, 2)}, separation "
            f"{best.separation:.1f} of {TELLS_APART:g} needed)"
        )
    if effect.would_see:
        return (
            f"{opening}: cannot be distinguished{size}; try sensors: {_listed(effect.would_see)}."
        )
    return f"{opening}: cannot be distinguished{size}; no listed sensor measures it."


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]


# --- errors over noise ----------------------------------------------------------------------------


@dataclass(frozen=True)
class NoiseRow:
    """One quantity: every method's rms error over the noise of the measurement."""

    quantity: str
    noise: str
    band: tuple[float, float]
    ratios: tuple[tuple[MethodResult, float], ...]


def over_noise(result: Result) -> tuple[Picture, ...]:
    """Return the picture; none where nothing with noise was compared."""
    rows = noise_rows(result)
    if not rows:
        return ()
    names = [m for m in finished(result) if any(m is one for r in rows for one, _ in r.ratios)]
    lines = max(len(fill(m.label, _NAME).splitlines()) for m in names)
    one = (_LINE * lines + 0.05) * len(names) + _ROOM
    high = -(-len(rows) // _columns(rows)) * one + 0.35
    pixels = draw(lambda f: _fill(f, rows, names), WIDTH, high)
    over_time = all(r.load == "all" for m in finished(result) for r in m.residuals.values())
    where = at_load("all") if over_time else "at the last load"
    shown = Picture(
        "errors_over_noise",
        f"Rms error of every model {where} over the rms that measurement noise alone gives "
        f"(no unit, logarithmic; the title gives the noise). Filled: checked models; hollow: the "
        f"others. Grey: 95 % of repetitions with noise alone (chi-square with the number of "
        f"values). To the right of it, the recording shows the model's error. Where all models "
        f"are on grey, that quantity cannot distinguish them. Ratios below {_LOWEST:g} are "
        f"arrows.",
        "Dot chart: rms error over measurement noise for each quantity and model.",
        pixels,
    )
    return (shown,)


def noise_rows(result: Result) -> list[NoiseRow]:
    """Return a row for every quantity that has noise."""
    done = finished(result)
    quantities = dict.fromkeys(r.quantity for m in done for r in m.residuals.values() if r.sd > 0)
    rows = []
    for quantity in quantities:
        seen = [(m, r) for m in done if (r := last_residual(m, quantity)) is not None]
        ratios = tuple((m, rms(r.values) / _noise(r)) for m, r in seen)
        first = seen[0][1]
        dof = first.values.size
        low, high = (float(np.sqrt(chdtri(dof, p) / dof)) for p in (0.975, 0.025))
        noise = with_unit(_noise(first), first.unit)
        rows.append(NoiseRow(quantity, noise, (low, high), ratios))
    return rows


def _noise(residual: Residual) -> float:
    """The rms (SI) that the noise of the measurement gives a perfect model."""
    c = residual.values.shape[1]
    return float(np.sqrt(c * (residual.sd**2 + residual.systematic**2)))


def _columns(rows: list[NoiseRow]) -> int:
    return min(len(rows), 2)


def _fill(figure: Figure, rows: list[NoiseRow], methods: list[MethodResult]) -> None:
    columns = _columns(rows)
    axes, lowest = panels(figure, len(rows), columns)
    for ax, row in zip(axes, rows, strict=True):
        ax.axvspan(*row.band, color=NOISE, lw=0)
        ax.axvline(1, color=MEASURED, lw=0.8)
        for method, ratio in row.ratios:
            sign = "<" if ratio < _LOWEST else "o"
            face = ACCEPTED if method.accepted else "white"
            ax.plot(max(ratio, _LOWEST), methods.index(method), sign, ms=5.5, mfc=face,
                    mec=ACCEPTED if method.accepted else MEASURED)  # fmt: skip
        ax.set_title(f"{row.quantity}\nnoise {row.noise}", loc="left", fontsize=8.5)
    for ax in lowest:
        ax.set_xlabel("rms error / rms of noise", fontsize=9)
    for ax in axes[::columns]:
        ax.tick_params(axis="y", labelsize=8)
    first = axes[0]
    names = [fill(m.label, _NAME) for m in methods]
    first.set_yticks(range(len(methods)), names)
    first.set_ylim(len(methods) - 0.5, -0.5)
    first.set_xscale("log")
    low, high = first.get_xlim()
    first.set_xlim(max(min(low, 0.09), 0.8 * _LOWEST), max(high, 11))
    first.xaxis.set_major_locator(LogLocator(numticks=5))
    first.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    first.xaxis.set_minor_formatter(NullFormatter())
