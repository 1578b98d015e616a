"""Chart as a figure: all lines on one axes, or one axes per line where they would overlap.

The legend lies below the axes. What lies below rounding on a logarithmic axis is named and not
drawn.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from textwrap import fill

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from validate.compare.exhibit import Chart, Picture, Series
from validate.numbers import significant
from validate.report.charts.axes import (
    Drawn,
    alone,
    beneath,
    cut_dips,
    fill_axes,
    floor_of,
    levels,
    name_levels,
    panel_labels,
    panel_series,
    readable,
    styled,
)
from validate.report.charts.style import (
    WIDTH,
    Drawing,
    HasMethods,
    draw,
    legend_columns,
    legend_height,
    panels,
)

_HEIGHT = 3.3  # inches of one axes without the legend
_PANEL = 1.45  # inches of one of several
_ROOM = 0.75  # inches of titles and labels about several axes
_SEEN = 4.5  # points: a sign of the legend that can be seen
_FEW = 8  # panels that stand in two columns
_WIDE, _NARROW = 36, 24  # letters of a panel's title in one line, in two columns or three
_TITLE = 66  # letters of a title in one line
_NAME = 60  # letters of a legend's entry in one line


def picture(result: HasMethods, chart: Chart) -> Picture:
    """Return the chart drawn; series named after a method have its colour of all other figures."""
    pixels = draw(*drawing(result, chart))
    names = "; ".join(dict.fromkeys(s.name for s in chart.series))
    scale = {"x": " Logarithmic x.", "y": " Logarithmic y.", "xy": " Logarithmic axes."}
    words = " ".join(
        (w if w.endswith((".", "!", "?")) else f"{w}.")
        for w in (chart.title, chart.caption, _undrawn(chart))
        if w
    )
    return Picture(
        f"chart_{chart.name}",
        f"{words} Upward: {chart.y}; across: {chart.x}.{scale.get(chart.log, '')}",
        f"Chart: {chart.title}; {chart.y} against {chart.x}: {names}.",
        pixels,
    )


def _undrawn(chart: Chart) -> str:
    """What lies below the floor, in words."""
    lost, floor = beneath(chart), _floor(chart)
    words = f"Not drawn, as below {floor}, a billionth of the scale: {'; '.join(lost)}"
    return words if lost else ""


def _floor(chart: Chart) -> str:
    unit = chart.y.rpartition(" / ")[2].removesuffix("1")
    return f"{significant(floor_of(chart), 1)} {unit}".strip()


def drawing(result: HasMethods, chart: Chart, width: float = WIDTH) -> Drawing:
    """Return the function that fills the figure, and its width and height in inches."""
    labels = panel_labels(chart)
    if labels:
        found = {name: alone(result, panel_series(chart, name, labels), name) for name in labels}
        # A legend names all that is not the one line of its panel
        every = [d for shown in found.values() for d in shown]
        named = [d.series.name for d in every if d.series.label not in found or d.series.of]
        shaded = [d.series.name for d in every if d.series.style == "band"]
        of = {d.series.name: d.series.of for d in every if d.series.of}
        names = [*dict.fromkeys(of.get(n, n) for n in (*named, *shaded) if n not in found)]
        names += [name for name, _ in levels(chart)]
        below = legend_height(_broken(names, width), width) if names else 0.0
        rows = -(-len(labels) // _columns(labels))
        height = _PANEL * rows + _ROOM + below
        return lambda f: _panels(f, chart, found, names, width), width, height
    drawn = styled(result, chart.series)
    names = _drawn_names(chart, drawn)
    below = legend_height(_broken(names, width), width) if len(names) > 1 else 0.0
    return lambda f: _together(f, chart, drawn, width), width, _HEIGHT + below


def _together(figure: Figure, chart: Chart, drawn: list[Drawn], width: float) -> None:
    ax = figure.subplots()
    fill_axes(ax, chart, drawn)
    ax.set(xlabel=chart.x, ylabel=chart.y)
    cut_dips(ax, chart)
    readable(ax, chart)
    name_levels(ax, chart)
    _title(figure, chart, width)
    if lost := beneath(chart):
        words = fill(f"below {_floor(chart)}: {', '.join(lost)}", _letters(_TITLE, width))
        ax.text(0.02, 0.03, words, transform=ax.transAxes, fontsize=8.5)
    names = _drawn_names(chart, drawn)
    if len(names) > 1:
        _legend(figure, [ax], names, width)


def _drawn_names(chart: Chart, drawn: Sequence[Drawn]) -> list[str]:
    lost = beneath(chart)
    return [n for n in dict.fromkeys(d.series.name for d in drawn) if n not in lost]


def _letters(count: int, width: float) -> int:
    """Letters of a line of a figure `width` inches wide, of so many in one of a report."""
    return max(12, int(count * width / WIDTH))


def _title(figure: Figure, chart: Chart, width: float) -> None:
    title = fill(chart.title, _letters(_TITLE, width))
    figure.suptitle(title, x=0.01, ha="left", fontsize="medium")


def _legend(figure: Figure, axes: Iterable[Axes], names: Sequence[str], width: float) -> None:
    """Of one name the upper one: a line, not a band."""
    found: dict[str, Artist] = {}
    for ax in axes:
        handles, labels = ax.get_legend_handles_labels()
        found |= dict(zip(labels, handles, strict=True))
    shown = [name for name in names if name in found]
    broken = _broken(shown, width)
    made = figure.legend([found[name] for name in shown], broken, loc="outside lower center",
                         ncols=legend_columns(broken, width))  # fmt: skip
    for handle in made.legend_handles:
        if isinstance(handle, Line2D) and handle.get_linestyle() == "None":
            handle.set_markersize(max(handle.get_markersize(), _SEEN))


def _broken(names: Sequence[str], width: float) -> list[str]:
    return [fill(name, _letters(_NAME, width)) for name in names]


# --- one axes a line -----------------------------------------------------------------------------


def _columns(labels: Sequence[str]) -> int:
    return 2 if len(labels) <= _FEW else 3


def _panels(
    figure: Figure, chart: Chart, found: Mapping[str, Sequence[Drawn]], names: Sequence[str],
    width: float,
) -> None:  # fmt: skip
    columns = _columns(tuple(found))
    letters = _letters(_WIDE if columns == 2 else _NARROW, width)
    axes, lowest = panels(figure, len(found), columns)
    for ax, (label, drawn) in zip(axes, found.items(), strict=True):
        fill_axes(ax, chart, [replace(d, series=_short(d.series)) for d in drawn])
        ax.set_title(fill(label, letters), loc="left", fontsize=8.5)
        if label in beneath(chart):
            ax.text(0.5, 0.5, f"below {_floor(chart)}", transform=ax.transAxes, ha="center",
                    fontsize=8.5)  # fmt: skip
    for ax in lowest:
        ax.set_xlabel(fill(chart.x, letters), fontsize=9)
    cut_dips(axes[0], chart)
    readable(axes[0], chart, most=4)
    figure.supylabel(chart.y, fontsize="medium")
    _title(figure, chart, width)
    if names:
        _legend(figure, axes, names, width)


def _short(series: Series) -> Series:
    """Named in a legend that serves all panels: by what it is of alone."""
    return replace(series, label=series.of, of="") if series.of else series
