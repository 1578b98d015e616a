"""One axes of a chart: line styles, points, bands, named levels, and readable ticks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    LogFormatterSciNotation,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    NullLocator,
)

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Series
from validate.report.charts.style import (
    ACCEPTED,
    MEASURED,
    NOISE,
    PALETTE,
    HasMethods,
    Style,
    free_look,
    looks,
)

# --- line styles of a chart: two lines of one axes differ in colour and in dash ------------------

TOGETHER = 5  # lines that are followed on one axes; more have one each
_TURNS = 20  # of a line that is jagged, at least
_SHADES = (MEASURED, "#5F5F5F", "#8C8C8C", "#AFAFAF", "#C6C6C6")  # of several recordings
_OTHER = PALETTE[1]  # a model that is not the judged one, alone on its axes


@dataclass(frozen=True)
class Drawn:
    """A series, how it looks, and its place in the order of points series (0: a filled sign).

    `one_of` several lines of one label: its dash tells it apart, however jagged it is.
    """

    series: Series
    look: Style
    number: int = 0
    one_of: bool = False


def panel_labels(chart: Chart) -> tuple[str, ...]:
    """Return the labels that get axes of their own; none where one axes shows all lines apart."""
    lines = [s for s in chart.series if s.style == "line" and not is_given(s)]
    labels = tuple(dict.fromkeys(s.label for s in lines))
    jagged = sum(is_jagged(s) for s in lines)
    apart = len(labels) > TOGETHER or jagged > 1 or len(lines) > len(labels)
    return labels if apart and len(labels) > 1 else ()


def panel_series(chart: Chart, label: str, labels: Sequence[str]) -> list[Series]:
    """What a label's own axes show: its lines and bands, and what belongs to no label."""
    own = [s for s in chart.series if s.label == label or band_of(s, labels) == label]
    common = [s for s in chart.series if s.label not in labels and not band_of(s, labels)]
    return [*common, *own]


def band_of(series: Series, labels: Sequence[str]) -> str:
    """The label whose band it is: the longest that its own begins with."""
    own = [name for name in labels if series.style == "band" and series.label.startswith(name)]
    return max(own, key=len, default="")


def styled(result: HasMethods, series: Sequence[Series]) -> list[Drawn]:
    """Measured points black, methods as elsewhere, bands in their line's colour, others in turn."""
    known = _known(result)
    others = [s for s in series if s.style != "band"]
    unknown = [s for s in others if s.label not in known and not is_given(s)]
    # By label the methods' styles; of two with one colour or dash the later takes a free one
    mine: dict[str, Style] = {}
    for label, look in {s.label: known[s.label] for s in others if s.label in known}.items():
        colours = {s.colour for s in mine.values()}
        free = [c for c in (look.colour, *PALETTE) if c not in colours] or [look.colour]
        other = replace(look, colour=free[0])
        for i in range(1, len(PALETTE)):
            if all(other.dash != s.dash for s in mine.values()):
                break
            turned = free_look(i, other.colour)
            other = replace(other, dash=turned.dash, point=turned.point)
        mine[label] = other
    taken = {look.colour for look in mine.values()}
    free = [c for c in PALETTE if c not in taken] or list(PALETTE)
    turns = {id(s): free_look(i, free[i % len(free)]) for i, s in enumerate(unknown)}
    signs = {id(s): i + 1 for i, s in enumerate(unknown)} if len(unknown) > len(free) else {}
    logs = (s for s in others if s.style == "points" and is_given(s))
    shades = {id(s): _SHADES[i % len(_SHADES)] for i, s in enumerate(logs)}
    drawn = {}
    for s in others:
        # A reference is a wide pale line under the others, what was measured dark points
        shade, width = ("#C0C0C0", 3.6) if s.style == "line" else (shades.get(id(s), MEASURED), 1.2)
        given = Style(shade, "-", "o", width)
        drawn[id(s)] = Drawn(s, mine.get(s.label) or turns.get(id(s)) or given, signs.get(id(s), 0))
    lines = {d.series.label: d.look for d in drawn.values() if d.series.style == "line"}
    for s in series:
        if s.style == "band":
            own = band_of(s, tuple(lines))
            drawn[id(s)] = Drawn(s, lines[own] if own else Style(NOISE, "-", "o", 0.0))
    return [drawn[id(s)] for s in series]


def alone(result: HasMethods, series: Sequence[Series], label: str) -> list[Drawn]:
    """As `styled`, for the axes of one label: blue where it is the judged method."""
    known = _known(result).get(label)
    judged = known is not None and known.colour == ACCEPTED
    colours = (ACCEPTED, *PALETTE[1:]) if judged else (_OTHER, ACCEPTED, *PALETTE[2:])
    lines = [s for s in series if s.label == label and s.style == "line"]
    own = {id(s): free_look(i, colours[i % len(colours)]) for i, s in enumerate(lines)}
    first = next(iter(own.values()), free_look(0, MEASURED))
    others = {id(d.series): d for d in styled(result, [s for s in series if id(s) not in own])}
    return [
        Drawn(s, own[id(s)], one_of=len(own) > 1) if id(s) in own
        else Drawn(s, first) if band_of(s, (label,)) else others[id(s)]
        for s in series
    ]  # fmt: skip


def _known(result: HasMethods) -> Mapping[str, Style]:
    styles = looks(result)
    return {**styles, **{m.label: styles[m.name] for m in result.methods}}


def is_given(one: Series) -> bool:
    """Return a line named a reference; points that say measured."""
    if one.style == "line":
        return one.label.lower().startswith("reference")
    return one.style == "points" and "measured" in one.label.lower()


def is_jagged(series: Series) -> bool:
    """Return a line that turns so often that dashes could not be told from its turns."""
    turns = np.count_nonzero(np.diff(np.sign(np.diff(series.y))))
    return bool(turns > max(_TURNS, 0.1 * len(series.y)))


# --- one axes of a chart: lines, points, bands, named levels, and readable ticks -----------------

_LEVELS = (("#4A4A4A", (4, 2)), ("#6E6E6E", (1, 1.5)), ("#8C8C8C", (6, 2, 1, 2)))
_FEW = 16  # points of a line that are marked, so that a sweep shows what was run
_MANY = 400  # points drawn smaller from here on
_SPARSE = 60  # points that lie on the lines; more of them would hide these
_NAME = 13  # letters of a level's name in one line
_LINE = 0.042  # height of one line of such a name, share of the axes'
_ROUNDING = 1e-9  # share of the size of things below which a difference is rounding
_ABOUT = 0.01  # of a constant: what an axis shows about it
_DIP = 0.02  # of a line's median: what lies lower is on its way through zero
_SHORT = 3.0  # a logarithmic axis shorter than this factor has ticks as a linear one


def fill_axes(ax: Axes, chart: Chart, drawn: Sequence[Drawn]) -> None:
    """Everything but titles and legend; levels have their names for it."""
    if "x" in chart.log:
        ax.set_xscale("log", nonpositive="mask")
    if "y" in chart.log:
        ax.set_yscale("log", nonpositive="mask")
    if chart.linear:
        ax.set_yscale("symlog", linthresh=chart.linear, linscale=1.0)
        ax.axhline(0, color=MEASURED, lw=0.8)
    floor = floor_of(chart)
    for d in sorted(drawn, key=lambda d: (_layer(d.series), -d.look.width)):
        s, look = d.series, d.look
        y = np.where(s.y < floor, np.nan, s.y) if floor else s.y
        if s.style == "band":
            upper = s.upper if s.upper is not None else np.zeros_like(s.y)
            shade: dict[str, Any] = {"color": look.colour, "alpha": 1.0 if look.width == 0 else 0.2}
            ax.fill_between(s.x, s.y, upper, lw=0, label=s.name, **shade)
        elif s.style == "points":
            size = 4.5 if len(s.x) <= _SPARSE else 3.0 if len(s.x) <= _MANY else 1.6
            sign, size = (f"${d.number}$", 7.0) if d.number else (look.point, size)
            ax.plot(s.x, y, ls="none", marker=sign, color=look.colour, ms=size, mew=0.6,
                    label=s.name)  # fmt: skip
        else:
            marker = look.point if len(s.x) <= _FEW else ""
            thin = is_jagged(s) and not d.one_of
            dash, width = ("-", min(look.width, 0.9)) if thin else (look.dash, look.width)
            ring: dict[str, Any] = {"mfc": "none", "ms": 9} if len(s.x) == 1 else {"ms": 4.5}
            ax.plot(s.x, y, color=look.colour, ls=dash, lw=width, marker=marker, label=s.name,
                    **ring)  # fmt: skip
    for i, (name, level) in enumerate(levels(chart)):
        colour, dashes = _LEVELS[i % len(_LEVELS)]
        ax.axhline(level, color=colour, lw=1.0, ls=(0, dashes), zorder=1.5, label=name)


def levels(chart: Chart) -> list[tuple[str, float]]:
    """Return the levels that the axis can show, the lowest first."""
    shown = [(name, y) for name, y in chart.levels if y > 0 or "y" not in chart.log]
    return sorted(shown, key=lambda pair: pair[1])


def _layer(series: Series) -> int:
    """Bands lie lowest, then crowded points, lines, single points."""
    if series.style == "points":
        return 3 if len(series.x) <= _SPARSE else 1
    return 0 if series.style == "band" else 2


# --- rounding ------------------------------------------------------------------------------------


def floor_of(chart: Chart) -> float:
    """Below this a y on a logarithmic axis is rounding; 0 on others, and where nothing is above."""
    if "y" not in chart.log:
        return 0.0
    tops = [float(s.y.max()) for s in chart.series if len(s.y)]
    return _ROUNDING * max(chart.scale, *tops, 0.0) if tops else 0.0


def beneath(chart: Chart) -> tuple[str, ...]:
    """Return the names of what lies there altogether."""
    floor = floor_of(chart)
    low = [s for s in chart.series if floor and s.style != "band" and (s.y < floor).all()]
    return tuple(dict.fromkeys(s.name for s in low))


def cut_dips(ax: Axes, chart: Chart) -> None:
    """End a logarithmic axis below where lines only pass through zero, and above rounding."""
    floor = floor_of(chart)
    if not floor:
        return
    found = [0.7 * y for _, y in levels(chart)]
    for s in chart.series:
        y = s.y[s.y >= floor]
        if len(y):
            long = s.style == "line" and len(y) > _FEW
            found.append(float(_DIP * np.median(y) if long else 0.7 * y.min()))
    if found:
        ax.set_ylim(max(min(found), floor), ax.get_ylim()[1])


# --- levels --------------------------------------------------------------------------------------


def name_levels(ax: Axes, chart: Chart) -> None:
    """The names of horizontal lines, to the right of the axes where no data are hidden."""
    shown = [(fill(name, _NAME), y) for name, y in levels(chart)]
    if not shown:
        return
    ax.set_ylim(*ax.get_ylim())  # the names belong to these limits
    to_axes = (ax.transData + ax.transAxes.inverted()).transform
    # Rising heights of names of so many lines, each above the one below
    names = [(float(to_axes((1.0, y))[1]), name.count("\n") + 1) for name, y in shown]
    at: list[float] = []
    for i, (height, lines) in enumerate(names):
        gap = _LINE * (lines + names[i - 1][1]) / 2 + 0.02 if i else 0.0
        at.append(max(height, at[-1] + gap) if at else height)
    for (name, _), height in zip(shown, at, strict=True):
        ax.text(1.012, height, name, transform=ax.transAxes, va="center", fontsize=8.5,
                linespacing=1.05, color="#404040")  # fmt: skip


# --- ticks ---------------------------------------------------------------------------------------


def readable(ax: Axes, chart: Chart, most: int = 6) -> None:
    """Plain numbers on logarithmic axes of ordinary size; at most some `most` ticks an axis."""
    # A y that differs by rounding only is constant: it gets room about it, no digits to differ
    low, high = ax.get_ylim()
    size = max(abs(low), abs(high))
    if high - low < _ROUNDING * size:
        ax.set_ylim(low - _ABOUT * size, high + _ABOUT * size)
    for axis, name in ((ax.xaxis, "x"), (ax.yaxis, "y")):
        if name == "y" and chart.linear:
            # Zero and powers of ten beyond the linear part, of both signs where there are both
            low, high = axis.get_view_interval()
            first = int(np.ceil(np.log10(chart.linear) + 1e-9))
            last = int(np.floor(np.log10(max(-low, high, chart.linear))))
            every = max(1, -(-2 * (last - first + 1) // most))
            powers: Floats = 10.0 ** np.arange(last, first - 1, -every, dtype=np.float64)
            ticks = [0.0, *(p for p in powers if p <= high), *(-p for p in powers if -p >= low)]
            axis.set_major_locator(FixedLocator(sorted(ticks)))
            axis.set_major_formatter(FuncFormatter(_plain))
            axis.set_minor_locator(NullLocator())
        elif name in chart.log:
            low, high = sorted(axis.get_view_interval())
            decades = float(np.log10(high / low))
            if high < _SHORT * low:
                axis.set_major_locator(MaxNLocator(min(most, 4), steps=[1, 2, 5, 10]))
            elif decades < 2:
                axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
            else:
                axis.set_major_locator(LogLocator(numticks=most + 1))
            axis.set_minor_formatter(NullFormatter())
            if high < _SHORT * low:
                axis.set_minor_locator(NullLocator())
            plain = (low >= 1e-3 and high <= 1e5) or decades < 2
            axis.set_major_formatter(FuncFormatter(_plain) if plain else LogFormatterSciNotation())
        else:
            axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]))


def _plain(value: float, _: int) -> str:
    return f"{value:g}".replace("-", "−")
