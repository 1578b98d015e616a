"""Charts of a report's page that zoom and show values: their numbers as uPlot takes them."""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Chart, Series
from validate.report.charts.axes import beneath, floor_of, levels
from validate.report.charts.line_styles import TOGETHER, band_of, is_given, is_jagged, styled
from validate.report.charts.style import HasMethods

_MOST = 600  # points of a series; of more, the lowest and the highest of equal parts
_WAYS = 24  # of a line to and fro
_DIGITS = 5
_NAMES = 12  # of a legend; of more, the curves of one label have one name
_SHOWN = 4  # digits of y: as many as the page shows


def plot(run: HasMethods, chart: Chart) -> dict[str, Any]:
    """Return series of a chart in the colours of its figure, and its named levels.

    A line that goes to and fro along x is one series for each way: uPlot needs x to rise. A series
    of more than `_MOST` points keeps the lowest and the highest of equal parts, so that no peak is
    lost; a line that turns more than `_WAYS` times is shown by its points. Of more than `TOGETHER`
    lines those of the checked methods and the first others are shown, the rest at a click. What is
    rounding on a logarithmic axis is left out, as in the figure.
    """
    least, lost = (0.0, ()) if chart.linear else (floor_of(chart), beneath(chart))
    xs: list[list[float | None]] = []  # each once: most series of a chart have the same
    series: list[dict[str, Any]] = []
    drawable = [d for d in styled(run, chart.series) if d.series.name not in lost]
    checked = {name for m in run.methods if m.accepted for name in (m.name, m.label)}
    lines = [d.series for d in drawable if d.series.style == "line" and not is_given(d.series)]
    labels = sorted(dict.fromkeys(s.label for s in lines), key=lambda label: label not in checked)
    later = tuple(labels[TOGETHER:])
    apart = len({d.series.name for d in drawable}) <= _NAMES
    for drawn in drawable:
        of, jagged = drawn.series.label, is_jagged(drawn.series) and not drawn.one_of
        look = {"label": drawn.series.name if apart else of, "colour": drawn.look.colour,
                "dash": [] if jagged else _dash(drawn.look.dash),
                "width": 0.9 if jagged else drawn.look.width or 1.0,
                "hidden": of in later or bool(band_of(drawn.series, later))}  # fmt: skip
        style, ways = drawn.series.style, [np.argsort(drawn.series.x, kind="stable")]
        if style == "line" and len(found := _ways(drawn.series.x)) > 1:
            style, ways = ("line", found) if len(found) <= _WAYS else ("points", ways)
        for way in ways:
            x, columns = _points(drawn.series, way, least)
            if x not in xs:
                xs.append(x)
            series.append({**look, "style": style, "x": xs.index(x), **columns})
    return {
        "x": chart.x, "y": chart.y, "log": chart.log, "linear": chart.linear, "xs": xs,
        "series": series,
        "levels": [{"label": name, "y": _number(y)} for name, y in levels(chart)],
    }  # fmt: skip


def _dash(given: Any) -> list[float]:
    return [] if given == "-" else [3 * float(length) for length in given[1]]


def _ways(x: Floats) -> list[Ints]:
    """Indices of the parts of x (k,) between its turns, each in rising x; neighbours share ends."""
    sense = np.sign(np.diff(x))
    moving = np.flatnonzero(sense)
    turns = moving[1:][sense[moving[1:]] != sense[moving[:-1]]]
    ends = [0, *turns.tolist(), len(x) - 1]
    parts = [np.arange(a, b + 1) for a, b in pairwise(ends)]
    return [part[np.argsort(x[part], kind="stable")] for part in parts]


def _points(
    series: Series, order: Ints, least: float
) -> tuple[list[float | None], dict[str, list[float | None]]]:
    keep = order[_peaks(series.y[order])]
    columns = {"y": series.y} | ({} if series.upper is None else {"upper": series.upper})
    found = {
        name: _numbers(np.where(least and y[keep] < least, np.nan, y[keep]), _SHOWN)
        for name, y in columns.items()
    }
    return _numbers(series.x[keep]), found


def _peaks(y: Floats) -> Ints:
    """Indices of the lowest and the highest of equal parts of y (k,), and of both ends."""
    if len(y) <= _MOST:
        return np.arange(len(y))
    parts = np.array_split(np.arange(len(y)), _MOST // 2)
    found = [i for part in parts for i in (part[y[part].argmin()], part[y[part].argmax()])]
    return np.unique([0, *found, len(y) - 1])


def _numbers(values: Floats, digits: int = _DIGITS) -> list[float | None]:
    return [_number(v, digits) for v in values.tolist()]


def _number(value: float, digits: int = _DIGITS) -> float | None:
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None
