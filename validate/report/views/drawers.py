"""Output of views and report items: files, figures, HTML, terminal text in a given width.

Each takes an exhibit, and the run whose methods have their colours.
"""

import math
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle
from pathlib import Path
from string import ascii_lowercase
from textwrap import wrap
from typing import TYPE_CHECKING, TextIO

import numpy as np
import plotille

from validate.compare.exhibit import Chart, Exhibit, Heat, Intervals, NumberTable
from validate.errors import UsageError
from validate.numbers import significant
from validate.report.export.tables import Row, chart_rows, sheet, write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from validate.report.charts.style import HasMethods


# --- A chart in characters. The only file that imports plotille.

_HIGH, _AXIS = 14, 24  # lines of a chart; columns that its axis and the margin take
_LEAST = 20  # columns of the area


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
        write_csv(path, *_cells(parts[0]), as_shown=bool(found.tables))


def _cells(part: NumberTable | Chart | Heat | Intervals) -> tuple[tuple[str, ...], Iterable[Row]]:
    """Head and rows of the file of a table, or of the numbers that are drawn."""
    match part:
        case NumberTable():
            return part.headings, part.rows
        case Chart():
            return chart_rows(part)
        case Heat():
            lines = zip(part.rows, part.values.tolist(), strict=True)
            return (part.y, part.x, part.quantity), (
                (row, column, v if np.isfinite(v) else None)
                for row, values in lines for column, v in zip(part.columns, values, strict=True)
            )  # fmt: skip
        case Intervals():
            rows = zip(part.labels, part.texts, part.answers, strict=True)
            return ("check", "E ± 2 u_val of limit", "verdict"), rows


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
        lines += _bars(one, width)
    for heat in found.heats:
        heads = [heat.y, *heat.columns]
        rows = [[name, *(significant(v) if np.isfinite(v) else "" for v in values)]
                for name, values in zip(heat.rows, heat.values.tolist(), strict=True)]  # fmt: skip
        lines += [f"{heat.quantity} over {heat.x}", *laid(heads, rows, width)]
    notes = [part.note for part in found.tables] + [chart.caption for chart in found.charts]
    lines += [line for note in dict.fromkeys(filter(None, notes)) for line in wrapped(note, width)]
    return lines if len(lines) > 1 else [*lines, _NOTHING]


def _bars(one: Intervals, width: int) -> list[str]:
    """A line an interval, with a bar up to its limit, or, without one, up to 2 u_val."""
    bars = [
        bar(value, half, limit) if limit > 0 else bar(value, 0.0, half) if half > 0 else ""
        for value, half, limit in zip(one.values, one.halves, one.limits, strict=True)
    ]
    rows = [list(row) for row in zip(one.labels, bars, one.texts, one.answers, strict=True)]
    return [legend("limit, or 2 u_val without one"), *laid([""] * 4, rows, width)]


# --- error, uncertainty and limit as one bar of characters ---------------------------------------

_BAR = 14  # characters of a bar
_LIMIT = 10  # of them up to the limit


def bar(error: float, doubt: float, limit: float) -> str:
    """Return an error, `doubt` above it, and a limit, all in one unit, as characters.

    The limit always stands at the same place; what goes beyond the bar ends in ">". An error or a
    doubt that is not finite fills the bar.
    """
    full, soft, mark = _characters()
    size = abs(error) if math.isfinite(error) else math.inf
    reach = size + (doubt if math.isfinite(doubt) else math.inf)
    places = [(i + 0.5) * limit / _LIMIT for i in range(_BAR)]
    text = "".join(full if x < size else soft if x < reach else " " for x in places)
    text = f"{text[:_LIMIT]}{mark}{text[_LIMIT:]}"
    return f"{text[:-1]}>" if reach > _BAR / _LIMIT * limit else text


def legend(limit: str) -> str:
    """What the characters of a bar are."""
    full, soft, mark = _characters()
    return f"{full} error, {soft} 2 u_val, {mark} {limit}"


def _characters() -> tuple[str, str, str]:
    unicode = (getattr(sys.stdout, "encoding", None) or "utf-8").lower().startswith("utf")
    return ("█", "░", "│") if unicode else ("#", "-", "|")


# --- tables and sentences in a given width, with unbroken words ----------------------------------

_WIDTH = 80  # columns where neither COLUMNS nor a terminal says how many there are
_GAP = "  "
_NARROWEST = 28  # characters of a column of sentences: a narrower one is a ribbon
_BELOW = "    "  # before what has no room beside the rest of its row


def width(stream: TextIO) -> int:
    """COLUMNS, else those of the terminal that the stream is, else 80."""
    given = os.environ.get("COLUMNS", "")
    if given.isdigit() and int(given) > 0:
        return int(given)
    try:
        return os.get_terminal_size(stream.fileno()).columns or _WIDTH
    except (OSError, ValueError):  # a pipe, a file, no stream of the system
        return _WIDTH


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Lines of at most `width`, longer only where a single word is; `indent` from the second on."""
    return [
        line
        for part in text.split("\n")
        for line in wrap(
            part, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        ) or [""]
    ]  # fmt: skip


def laid(head: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[str]:
    """Return a table as lines, as flat as the width allows.

    Columns of sentences share what the others leave. Where that is too little, the last of them
    goes below its row; where even names and numbers have no room, each row becomes a paragraph.
    """
    columns = range(len(head))
    found = _aligned(head, rows, width, columns)
    if found is None and (last := _last_sentences(head, rows)) is not None:
        found = _aligned(head, rows, width, [c for c in columns if c != last], last)
    return found or [line for row in rows for line in _paragraph(head, row, width)]


def _aligned(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    width: int,
    columns: Sequence[int],
    below: int | None = None,
) -> list[str] | None:
    """The columns side by side, that of `below` under each row; None where they have no room."""
    widths = _widths([head[c] for c in columns], [[row[c] for c in columns] for row in rows], width)
    if widths is None:
        return None
    found = list(_side_by_side([head[c] for c in columns], widths))
    for row in rows:
        found += _side_by_side([row[c] for c in columns], widths)
        if below is not None and row[below]:
            found += wrapped(_BELOW + row[below], width, _BELOW)
    return found


def _widths(head: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[int] | None:
    """Of every column; sentences are cut down to one common width, the largest that fits."""
    natural, least = [], []
    for name, *cells in zip(head, *rows, strict=True):
        words = max(max(map(len, text.split()), default=0) for text in (name, *cells))
        longest = max(map(len, cells))
        natural.append(max(len(name), longest))
        least.append(max(words, _NARROWEST if _sentences(cells) else longest))
    room = width - len(_GAP) * (len(natural) - 1)
    caps = ([max(low, min(n, cap)) for low, n in zip(least, natural, strict=True)]
            for cap in range(max(natural), 0, -1))  # fmt: skip
    return next((found for found in caps if sum(found) <= room), None)


def _sentences(column: Sequence[str]) -> bool:
    return max(map(len, column)) > _NARROWEST and any(" " in cell for cell in column)


def _last_sentences(head: Sequence[str], rows: Sequence[Sequence[str]]) -> int | None:
    """The last column that may go below its row; the first one names it and stays."""
    soft = [c for c in range(1, len(head)) if _sentences([row[c] for row in rows])]
    return soft[-1] if soft else None


def _side_by_side(cells: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    parts = [wrapped(cell, w) for cell, w in zip(cells, widths, strict=True)]
    for i in range(max(map(len, parts))):
        line = [part[i] if i < len(part) else "" for part in parts]
        yield _GAP.join(f"{t:<{w}}" for t, w in zip(line, widths, strict=True)).rstrip()


def _paragraph(head: Sequence[str], row: Sequence[str], width: int) -> list[str]:
    """The first cell, then the others with their names."""
    named = [f"{h}: {cell}" if h else cell for h, cell in zip(head[1:], row[1:], strict=True)]
    rest = "; ".join(text for text, cell in zip(named, row[1:], strict=True) if cell)
    return [
        *wrapped(row[0], width, _BELOW),
        *(wrapped(_BELOW + rest, width, _BELOW) if rest else []),
    ]
