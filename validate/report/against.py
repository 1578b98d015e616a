"""Predicted against measured, one panel a kind of quantity, with the bands of both."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from validate.arrays import Floats
from validate.compare.exhibit import Picture
from validate.report.numbers import scale, shown_unit
from validate.report.style import (
    ACCEPTED,
    MEASURED,
    NOISE,
    PALETTE,
    draw,
    legend_columns,
    legend_height,
)

_PANEL, _TITLE = 3.3, 0.25  # inches, both ways; of a panel's title and the room above
_ROW = 2  # panels side by side
_ROOM = 1.3  # beyond the points, both ways
_NARROW = 0.6  # decades: less has ticks as on a linear axis
_POINTS = ("o", "s", "^", "D", "v", "P", "X")
_LINES = (
    "measured = predicted, ± 2 sd of the measurements",
    "bias of the models, ± 2 sd of their scatter",
)


@dataclass(frozen=True)
class Against:
    """A panel: sizes (k,) SI in `unit` of the points and the experiment of each; relative standard
    deviation of the measurements, bias and scatter of the models (None: not known)."""

    title: str
    unit: str
    experiments: tuple[str, ...]
    measured: Floats
    simulated: Floats
    own: float
    bias: float | None
    scatter: float | None


def against(name: str, caption: str, panels: Sequence[Against]) -> Picture:
    """All panels; an experiment has one look in all of them. Points not above 0 are not drawn."""
    experiments = tuple(dict.fromkeys(e for panel in panels for e in panel.experiments))
    labels = (*experiments, *_LINES)
    columns = min(_ROW, len(panels))
    rows = -(-len(panels) // columns)
    width = max(_PANEL * columns, 5.6)

    def paint(figure: Figure) -> None:
        for i, panel in enumerate(panels):
            _fill(figure.add_subplot(rows, columns, i + 1), panel, experiments)
        handles: dict[str, Artist] = {}
        for axes in figure.axes:
            found = axes.get_legend_handles_labels()
            handles |= dict(zip(map(str, found[1]), found[0], strict=True))
        shown = [label for label in labels if label in handles]
        figure.legend(
            [handles[label] for label in shown], shown,
            loc="outside lower center", ncols=legend_columns(shown, width),
        )  # fmt: skip

    points = sum(len(panel.measured) for panel in panels)
    return Picture(
        name, caption, f"{points} predictions against measurements, with their bands.",
        draw(paint, width, (_PANEL + _TITLE) * rows + legend_height(labels, width)),
    )  # fmt: skip


def _fill(axes: Axes, panel: Against, experiments: Sequence[str]) -> None:
    by, seen = scale(panel.unit), panel.simulated > 0
    ends = np.concatenate([panel.measured, panel.simulated[seen]]) * by
    line = np.array([ends.min() / _ROOM, ends.max() * _ROOM])
    axes.fill_between(line, *_band(line, 1.0, panel.own), color=NOISE, linewidth=0)
    axes.plot(line, line, color=MEASURED, linewidth=1.0, label=_LINES[0])
    if panel.bias is not None:
        axes.plot(line, panel.bias * line, "--", color=ACCEPTED, linewidth=1.2, label=_LINES[1])
        if panel.scatter:
            band = _band(line, panel.bias, panel.scatter)
            axes.fill_between(line, *band, color=ACCEPTED, alpha=0.15, linewidth=0)
    for i, experiment in enumerate(experiments):
        mine = seen & (np.array(panel.experiments) == experiment)
        if mine.any():
            axes.plot(
                by * panel.measured[mine], by * panel.simulated[mine], _POINTS[i % len(_POINTS)],
                color=PALETTE[i % len(PALETTE)], markersize=5, label=experiment,
            )  # fmt: skip
    _scales(axes, line)
    unit = shown_unit(panel.unit) or "1"
    axes.set(title=panel.title, xlabel=f"measured / {unit}", ylabel=f"predicted / {unit}")


def _band(line: Floats, by: float, sd: float) -> tuple[Floats, Floats]:
    return by * line * np.exp(-2 * sd), by * line * np.exp(2 * sd)


def _scales(axes: Axes, line: Floats) -> None:
    """Logarithmic with few ticks that can be read, the same both ways."""
    decades = float(np.log10(line[1] / line[0]))
    axes.set(xscale="log", yscale="log", xlim=line, ylim=line, aspect="equal")
    for axis in (axes.xaxis, axes.yaxis):
        if decades < _NARROW:
            axis.set_major_locator(MaxNLocator(4))
        else:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2 else (1.0,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
