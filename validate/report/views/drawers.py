"""Output of views and report items: files, figures, HTML, terminal text.

Each takes an exhibit, and the run whose methods have their colours.
"""

from collections.abc import Iterable
from itertools import cycle
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING

import numpy as np
import plotille

from validate.compare.exhibit import Chart, Exhibit, Heat, Intervals, NumberTable
from validate.errors import UsageError
from validate.numbers import significant
from validate.report.export.tables import Row, chart_rows, sheet, write_csv
from validate.report.views.bars import bar, legend
from validate.report.views.layout import laid, wrapped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from validate.report.charts.style import HasMethods


# --- A chart in characters. The only file that imports plotille.

_LEAST = 20  # columns of the area
_HIGH, _AXIS = 14, 24  # lines of a chart; columns that its axis and the margin take


def plotted(chart: Chart, width: int) -> list[str]:
    """Lines of at most about `width` characters; levels are lines of =, bands are left out."""
    figure = plotille.Figure()
    figure.width, figure.height = max(_LEAST, width - _AXIS), _HIGH
    figure.with_colors, figure.origin = False, False
    figure.x_label, figure.y_label = chart.x, chart.y
    figure.register_label_formatter(float, _tick)
    several = sum(s.style == "line" for s in chart.series) > 1
    signs, letters = cycle("xo+*#@%&"), cycle(ascii_lowercase)
    for series in chart.series:
        if series.style == "points":
            figure.scatter(series.x, series.y, label=series.name, marker=next(signs))
        elif series.style == "line":
            marker = next(letters) if several else None
            figure.plot(series.x, series.y, label=series.name, marker=marker)
    for name, y in chart.levels:
        ends = [s.x for s in chart.series if len(s.x)] or [np.array([0.0, 1.0])]
        low, high = min(x.min() for x in ends), max(x.max() for x in ends)
        figure.plot([low, high], [y, y], label=name, marker="=")
    return [str(line).rstrip() for line in figure.show(legend=True).splitlines()]


def _tick(value: float, chars: int, *_: object, **__: object) -> str:
    return f"{significant(value, 4):<{chars}}"[:chars]


# -------------------------------------------------------------------------------------------------

_NOTHING = "No row fits."
_FIGURES = (".svg", ".pdf", ".png")


# --- a file ---------------------------------------------------------------------------------------


def save(found: Exhibit, run: "HasMethods", path: Path) -> None:
    """Write an exhibit as its file's suffix says: a chart as .svg, .pdf, .png or, its points, as
    .csv; a table as .csv or .tex; anything as .html.

    Raises `UsageError` for another suffix, and for several charts or tables in one file.
    """
    suffix = path.suffix.lower()
    drawn = drawable(found)
    parts = (*found.tables, *drawn)
    taken: tuple[str, ...] = (*_FIGURES, ".csv") if drawn else (".csv", ".tex")
    what = "a chart" if drawn else "a table"
    if len(parts) != 1:
        taken, what = (), " ".join(found.words) or _NOTHING
        what = f"{len(parts)} charts or tables: take one of them" if parts else what
    if suffix not in (*taken, ".html"):
        known = ", ".join((*taken, ".html"))
        raise UsageError(f"{path.name}: '{found.anchor}' is written as {known} ({what})")
    if suffix == ".html":
        path.write_text(page(found, run), encoding="utf-8")
    elif suffix in _FIGURES:
        figures(found, run)[0].savefig(path)
    elif suffix == ".tex":
        from validate.report.export.junit_latex import tabular

        path.write_text(tabular(found.tables[0]), encoding="utf-8")
    else:
        # Head and rows of a table, or of the numbers that are drawn
        head: tuple[str, ...]
        rows: Iterable[Row]
        match parts[0]:
            case NumberTable() as part:
                head, rows = part.headings, part.rows
            case Chart() as part:
                head, rows = chart_rows(part)
            case Heat() as part:
                lines = zip(part.rows, part.values.tolist(), strict=True)
                head, rows = (part.y, part.x, part.quantity), (
                    (row, column, v if np.isfinite(v) else None)
                    for row, values in lines for column, v in zip(part.columns, values, strict=True)
                )  # fmt: skip
            case Intervals() as part:
                head = ("check", "E ± 2 u_val of limit", "verdict")
                rows = zip(part.labels, part.texts, part.answers, strict=True)
        write_csv(path, head, rows, as_shown=bool(found.tables))


# --- a static picture -----------------------------------------------------------------------------


def figures(found: Exhibit, run: "HasMethods") -> list["Figure"]:
    """Charts, heats and intervals as matplotlib figures; none of an exhibit that is a table."""
    return [figure_of(part, run) for part in drawable(found)]


def drawable(found: Exhibit) -> tuple[Chart | Heat | Intervals, ...]:
    """What of an exhibit is drawn from numbers."""
    return *found.charts, *found.heats, *found.intervals


def figure_of(part: Chart | Heat | Intervals, run: "HasMethods", column: str = "") -> "Figure":
    """Return a chart, a heat or intervals as a matplotlib figure, as wide as a report's or as a
    `column` of a journal's page: one of `charts.style.COLUMNS`."""
    from validate.report.charts import chart as charts
    from validate.report.charts import heat, intervals
    from validate.report.charts.style import inches_of, painted

    at, size = inches_of(column) if column else ((), 1.0)
    match part:
        case Chart():
            drawing = charts.drawing(run, part, *at)
        case Heat():
            drawing = heat.drawing(part, *at)
        case Intervals():
            drawing = intervals.drawing(part, *at)
    return painted(*drawing, size=size)


# --- a page ---------------------------------------------------------------------------------------


def page(found: Exhibit, run: "HasMethods") -> str:
    """Return the exhibit as a page of its own in HTML: one text without a request."""
    from validate.report.exhibits import draw_all
    from validate.report.page.html import fragment

    return fragment(draw_all(run, [found]))


def part(found: Exhibit, run: "HasMethods") -> str:
    """Return the exhibit in HTML for a page that has a head and a style of its own."""
    from validate.report.exhibits import draw_all
    from validate.report.page.html import sections

    return sections(draw_all(run, [found]))


# --- a terminal -----------------------------------------------------------------------------------


def terminal(found: Exhibit, width: int) -> list[str]:
    """Return the exhibit in lines of at most `width` characters, its title first."""
    lines = [*wrapped(found.title, width)]
    for text in found.words:
        lines += wrapped(text, width, "  ")
    for part in found.tables:
        lines += ["", *wrapped(part.title, width)] if part.title != found.title else []
        laid_out = sheet(part)
        heads, rows = (
            [part.headings[i] for i in laid_out.columns],
            [list(r) for r in laid_out.texts],
        )
        if laid_out.below:
            heads.append("")
            rows = [[*row, words] for row, words in zip(rows, laid_out.below, strict=True)]
        lines += laid(heads, rows, width)
    for chart in found.charts:
        title = [chart.title] if chart.title != found.title else []
        lines += ["", *title, *plotted(chart, width)]
    for one in found.intervals:
        # A line an interval, with a bar up to its limit, or, without one, up to 2 u_val
        bars = [
            bar(value, half, limit) if limit > 0 else bar(value, 0.0, half) if half > 0 else ""
            for value, half, limit in zip(one.values, one.halves, one.limits, strict=True)
        ]
        rows = [list(row) for row in zip(one.labels, bars, one.texts, one.answers, strict=True)]
        lines += [legend("limit, or 2 u_val without one"), *laid([""] * 4, rows, width)]
    for heat in found.heats:
        heads = [heat.y, *heat.columns]
        rows = [[name, *(significant(v) if np.isfinite(v) else "" for v in values)]
                for name, values in zip(heat.rows, heat.values.tolist(), strict=True)]  # fmt: skip
        lines += [f"{heat.quantity} over {heat.x}", *laid(heads, rows, width)]
    notes = [part.note for part in found.tables] + [chart.caption for chart in found.charts]
    lines += [line for note in dict.fromkeys(filter(None, notes)) for line in wrapped(note, width)]
    return lines if len(lines) > 1 else [*lines, _NOTHING]


# --- error, uncertainty and limit as one bar of characters ---------------------------------------


_NARROWEST = 28  # characters of a column of sentences: a narrower one is a ribbon
