"""A chart as a picture: lines, points, bands and named levels, the legend below the axes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from validate.compare.exhibit import Chart, Picture, Series
from validate.compare.result import Result
from validate.report.style import MEASURED, NOISE, PALETTE, Style, draw, free_look, looks

_WIDTH, _HEIGHT = 8.6, 4.3  # inches without the legend
_LEGEND_WIDTH = 96  # characters of a legend's row at this width
_FEW = 16  # points of a line that are marked, so that a sweep shows what was run
_MANY = 400  # points drawn smaller from here on
_SPARSE = 60  # points that lie on the lines; more of them would hide these
_SHADES = (MEASURED, "#5F5F5F", "#8C8C8C", "#AFAFAF")  # of several recordings
_GAP = 0.058  # between the names of two levels, share of the axes' height


@dataclass(frozen=True)
class _Drawn:
    series: Series
    look: Style


def picture(result: Result, chart: Chart) -> Picture:
    """The chart drawn; series named after a method have its colour of all other figures."""
    drawn = _styled(result, chart)
    rows = _legend_rows([d.series.label for d in drawn])
    pixels = draw(lambda f: _fill(f, chart, drawn), _WIDTH, _HEIGHT + 0.22 * rows)
    names = "; ".join(dict.fromkeys(s.label for s in chart.series))
    scale = {"x": " Logarithmic x.", "y": " Logarithmic y.", "xy": " Logarithmic axes."}
    words = " ".join(_sentence(w) for w in (chart.title, chart.caption) if w)
    return Picture(
        f"chart_{chart.name}",
        f"{words} Upward: {chart.y}; across: {chart.x}.{scale.get(chart.log, '')}",
        f"Chart: {chart.title}; {chart.y} against {chart.x}: {names}.",
        pixels,
    )


def _sentence(words: str) -> str:
    return words if words.endswith((".", "!", "?")) else f"{words}."


# --- who looks how -------------------------------------------------------------------------------


def _styled(result: Result, chart: Chart) -> list[_Drawn]:
    """Measured points black, methods as elsewhere, bands in their line's colour, others in turn."""
    found = _of_lines(result, [s for s in chart.series if s.style != "band"])
    lines = {s.label: look for s, look in found if s.style == "line"}
    bands = [(s, _of_band(s, lines)) for s in chart.series if s.style == "band"]
    pairs = {id(s): look for s, look in (*found, *bands)}
    return [_Drawn(s, pairs[id(s)]) for s in chart.series]


def _of_lines(result: Result, series: list[Series]) -> list[tuple[Series, Style]]:
    known = _known(result)
    unknown = [s for s in series if s.label not in known and not _is_given(s, series)]
    taken = {known[s.label].colour for s in series if s.label in known}
    free = [c for c in PALETTE if c not in taken] or list(PALETTE)
    if len(unknown) > len(free):  # a sweep: its order becomes the order of the colours
        ramp = mpl.colormaps["viridis"](np.linspace(0.0, 0.92, len(unknown)))
        free = [mpl.colors.to_hex(c) for c in ramp]
    others = {id(s): free_look(i, free[i]) for i, s in enumerate(unknown)}
    logs = (s for s in series if s.style == "points" and _is_given(s, series))
    shades = {id(s): _SHADES[i % len(_SHADES)] for i, s in enumerate(logs)}
    return [
        (s, known.get(s.label) or others.get(id(s)) or _given(s, shades.get(id(s), MEASURED)))
        for s in series
    ]


def _given(series: Series, shade: str) -> Style:
    """A reference is a wide grey line under the others, what was measured dark points."""
    if series.style == "line":
        return Style("#9A9A9A", "-", "o", 3.6)
    return Style(shade, "-", "o", 1.2)


def _known(result: Result) -> Mapping[str, Style]:
    styles = looks(result)
    return {**styles, **{m.label: styles[m.name] for m in result.methods}}


def _is_given(one: Series, series: list[Series]) -> bool:
    """A line named a reference; points that say measured, or the only points beside lines."""
    if one.style == "line":
        return one.label.lower().startswith("reference")
    alone = sum(s.style == "points" for s in series) == 1 and len(series) > 1
    return alone or "measured" in one.label.lower()


def _of_band(band: Series, lines: Mapping[str, Style]) -> Style:
    own = [name for name in lines if band.label.startswith(name)]
    return lines[max(own, key=len)] if own else Style(NOISE, "-", "o", 0.0)


# --- drawing -------------------------------------------------------------------------------------


def _fill(figure: Figure, chart: Chart, drawn: list[_Drawn]) -> None:
    ax = figure.subplots()
    if "x" in chart.log:
        ax.set_xscale("log", nonpositive="mask")
    if "y" in chart.log:
        ax.set_yscale("log", nonpositive="mask")
    if chart.linear:
        ax.set_yscale("symlog", linthresh=chart.linear, linscale=1.0)
        ax.yaxis.set_major_formatter(lambda v, _: f"{v:g}".replace("-", "−"))
        ax.axhline(0, color=MEASURED, lw=0.8)
    for d in sorted(drawn, key=lambda d: (_layer(d.series), -d.look.width)):
        _draw_one(ax, d)
    ax.set(xlabel=chart.x, ylabel=chart.y)
    _levels(ax, chart)
    _readable(ax, chart)
    ax.set_title(chart.title, loc="left")
    handles, labels = ax.get_legend_handles_labels()
    found = dict(zip(labels, handles, strict=True))  # of one name the upper one: a line, not a band
    named = list(dict.fromkeys(d.series.label for d in drawn))
    if len(named) > 1:
        figure.legend([found[name] for name in named], named, loc="outside lower center",
                      ncols=_columns(named))  # fmt: skip


def _layer(series: Series) -> int:
    """Bands lie lowest, then crowded points, lines, single points."""
    if series.style == "points":
        return 3 if len(series.x) <= _SPARSE else 1
    return 0 if series.style == "band" else 2


def _draw_one(ax: Axes, drawn: _Drawn) -> None:
    s, look = drawn.series, drawn.look
    if s.style == "band":
        shade: dict[str, Any] = {"color": look.colour, "alpha": 1.0 if look.width == 0 else 0.2}
        ax.fill_between(s.x, s.y, _upper(s), lw=0, label=s.label, **shade)
    elif s.style == "points":
        size = 4.5 if len(s.x) <= _SPARSE else 3.0 if len(s.x) <= _MANY else 1.6
        ax.plot(s.x, s.y, look.point, color=look.colour, ms=size, mew=0.6, label=s.label)
    else:
        marker = look.point if len(s.x) <= _FEW else ""
        dash, width = ("-", min(look.width, 0.9)) if _jagged(s) else (look.dash, look.width)
        ax.plot(s.x, s.y, color=look.colour, ls=dash, lw=width, marker=marker, ms=4.5,
                label=s.label)  # fmt: skip


def _jagged(series: Series) -> bool:
    """A line that turns so often that dashes could not be told from its turns."""
    turns = np.count_nonzero(np.diff(np.sign(np.diff(series.y))))
    return bool(len(series.y) > _MANY and turns > 0.1 * len(series.y))


def _upper(band: Series) -> Any:
    return band.upper if band.upper is not None else np.zeros_like(band.y)


def _levels(ax: Axes, chart: Chart) -> None:
    """Horizontal lines, named to the right of the axes where no data are hidden."""
    shown = [(name, y) for name, y in chart.levels if y > 0 or "y" not in chart.log]
    for _, y in shown:
        ax.axhline(y, color="#5A5A5A", lw=1.0, ls=(0, (4, 2)), zorder=1.5)
    if not shown:
        return
    ax.set_ylim(*ax.get_ylim())  # the names belong to these limits
    shown.sort(key=lambda pair: pair[1])
    to_axes = (ax.transData + ax.transAxes.inverted()).transform
    at = _apart([float(to_axes((1.0, y))[1]) for _, y in shown])
    for (name, _), height in zip(shown, at, strict=True):
        ax.text(1.012, height, name, transform=ax.transAxes, va="center", fontsize=8.5,
                color="#404040")  # fmt: skip


def _apart(heights: list[float]) -> list[float]:
    """The same rising heights, each at least `_GAP` above the one below."""
    found: list[float] = []
    for height in heights:
        found.append(max(height, found[-1] + _GAP) if found else height)
    return found


def _readable(ax: Axes, chart: Chart) -> None:
    """Plain numbers on logarithmic axes of ordinary size; all ticks of one decade named."""
    for axis, name in ((ax.xaxis, "x"), (ax.yaxis, "y")):
        if name not in chart.log:
            continue
        low, high = sorted(axis.get_view_interval())
        if low >= 1e-3 and high <= 1e5:
            axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        if high < 15 * low:
            axis.set_minor_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        else:
            axis.set_minor_formatter(NullFormatter())


def _columns(labels: list[str]) -> int:
    widest = max(len(name) for name in labels) + 7
    return max(1, min(len(labels), 4, _LEGEND_WIDTH // widest))


def _legend_rows(labels: list[str]) -> int:
    names = list(dict.fromkeys(labels))
    return -(-len(names) // _columns(names)) if len(names) > 1 else 0
