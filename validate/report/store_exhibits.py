"""The exhibits in results.json: tables whole, charts thinned, maps by their extremes."""

from itertools import pairwise

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Chart, Exhibit, NodeMap, NumberTable, Series, plain
from validate.report.plain import Json, members, recorded

_POINTS = 2000  # of one series, at most
_ALL_POINTS = 30_000  # of all series together: about 600 kB
_FEWEST = 20  # points that a series keeps however many there are
_DIGITS = 7  # significant, of numbers whose full precision is in another file


def exhibits(found: tuple[Exhibit, ...]) -> list[Json]:
    """Every exhibit; chart series share `_ALL_POINTS`, their whole arrays are in tables/."""
    count = sum(len(c.series) for e in found for c in e.charts)
    most = max(_FEWEST, min(_POINTS, _ALL_POINTS // max(1, count)))
    return [
        {
            "anchor": e.anchor,
            "title": e.title,
            "words": list(e.words),
            "tables": [_table(t) for t in e.tables],
            "charts": [_chart(c, most) for c in e.charts],
            "maps": [_map(m) for m in e.maps],
        }
        for e in found
    ]


def _table(table: NumberTable) -> Json:
    rows = [[recorded(plain(entry)) for entry in row] for row in table.rows]
    return members(table, "name", "title", "headings", "note") | {"rows": rows}


def _chart(chart: Chart, most: int) -> Json:
    return members(chart, "name", "title", "x", "y", "log", "caption") | {
        "levels": [{"name": name, "y": float(y)} for name, y in chart.levels],
        "series": [_series(s, most) for s in chart.series],
    }


def _series(series: Series, most: int) -> Json:
    at = thinned(series.y, most)
    arrays = {"x": rounded(series.x[at]), "y": rounded(series.y[at])}
    if series.upper is not None:
        arrays["upper"] = rounded(series.upper[at])
    return {"label": series.name, "style": series.style, "points": len(series.x), **arrays}


def _map(shown: NodeMap) -> Json:
    v = shown.values
    ends = {"nodes": len(v), "min": float(v.min()), "max": float(v.max())}
    return members(shown, "name", "title", "unit") | ends


def thinned(y: Floats, most: int) -> Ints:
    """Rising indices of at most `most` of y (k,): the smallest and largest of every stretch.

    Peaks are kept, so a thinned series still touches the extremes of the whole one.
    """
    if len(y) <= most:
        return np.arange(len(y))
    edges = np.linspace(0, len(y), most // 2 + 1).astype(np.int64)
    parts = [(a, y[a:b]) for a, b in pairwise(edges.tolist())]
    return np.unique([a + i for a, part in parts for i in (part.argmin(), part.argmax())])


def rounded(values: Floats) -> list[float]:
    """The numbers to seven significant digits, which a file of text writes short."""
    return [float(f"{v:.{_DIGITS}g}") for v in values.tolist()]
