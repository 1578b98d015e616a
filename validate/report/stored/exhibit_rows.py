"""Report items in results.json: tables in full, charts thinned, maps by extremes; as rows.

The numbers stay in results.json, their only home; rows are made where `part` asks for them.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Chart, Exhibit, NodeMap, NumberTable, Series, plain
from validate.compare.row import CHART, TABLE, LongRow
from validate.report.stored.json_values import Json, members, recorded
from validate.units import si_of

#: Condition on `part` for all rows but those of tables and charts.
NOT_SHOWN = (f"!{TABLE}", f"!{CHART}")
_POINTS = 2000  # of one series, at most
_ALL_POINTS = 30_000  # of all series together: about 600 kB
_FEWEST = 20  # points that a series keeps however many there are
_DIGITS = 7  # significant, of numbers whose full precision is in another file


def stored_exhibits(content: Json) -> tuple[Exhibit, ...]:
    """Words, tables and charts of the exhibits in results.json; charts as thinned there."""
    return tuple(
        Exhibit(
            str(e["anchor"]), str(e["title"]), tuple(e["words"]),
            tuple(_read_table(t) for t in e["tables"]), tuple(_read_chart(c) for c in e["charts"]),
        )
        for e in content.get("exhibits", ())
    )  # fmt: skip


def _read_table(t: Json) -> NumberTable:
    rows = tuple(tuple(row) for row in t["rows"])
    return NumberTable(t["name"], t["title"], tuple(t["headings"]), rows, t["note"])


def _read_chart(c: Json) -> Chart:
    series = tuple(
        Series(s["label"], np.array(s["x"], float), np.array(s["y"], float), s["style"],
               np.array(s["upper"], float) if "upper" in s else None)
        for s in c["series"]
    )  # fmt: skip
    levels = tuple((level["name"], level["y"]) for level in c["levels"])
    return Chart(c["name"], c["title"], c["x"], c["y"], series, levels, c["log"], c["caption"])


def exhibit_rows(content: Json, run: str) -> Iterator[LongRow]:
    """Every number of these tables and charts, SI.

    `quantity` is the table or chart, `statistic` the heading or axis, `variation` the texts of the
    line or the label of the series, `method` where one of them is a method; `point` counts lines.
    """
    methods = {
        str(m.get(k, "")): str(m["name"]) for m in content["methods"] for k in ("label", "name")
    }
    one = LongRow(run, str(content["experiment"]))
    for exhibit in stored_exhibits(content):
        for table in exhibit.tables:
            named = one._replace(part=TABLE, quantity=table.name or exhibit.anchor)
            yield from _rows_of_table(named, table, methods)
        for chart in exhibit.charts:
            yield from _rows_of_chart(one._replace(part=CHART, quantity=chart.name), chart, methods)


def _rows_of_table(
    one: LongRow, table: NumberTable, methods: Mapping[str, str]
) -> Iterator[LongRow]:
    axes = [_axis(heading) for heading in table.headings]
    for i, row in enumerate(table.rows):
        words = [entry for entry in row if isinstance(entry, str)]
        method = next((methods[w] for w in words if w in methods), "")
        of = one._replace(method=method, variation="; ".join(words), point=i)
        for entry, (name, unit, factor) in zip(row, axes, strict=True):
            if isinstance(entry, (int, float)):
                yield of._replace(statistic=name, value=factor * entry, unit=unit)


def _rows_of_chart(one: LongRow, chart: Chart, methods: Mapping[str, str]) -> Iterator[LongRow]:
    (name, unit, factor), (across, _, by) = _axis(chart.y), _axis(chart.x)
    of = one._replace(statistic=name, unit=unit, against=across)
    for s in chart.series:
        method = next((m for label, m in methods.items() if s.label == label), "")
        line = of._replace(method=method, variation=s.label)
        for x, y in zip(s.x.tolist(), s.y.tolist(), strict=True):
            yield line._replace(at=by * x, value=factor * y)
    for label, y in chart.levels:
        yield of._replace(variation=label, value=factor * y)


def _axis(text: str) -> tuple[str, str, float]:
    """Name, SI unit and SI units in one of a heading or an axis such as "force / mN"."""
    name, _, unit = text.rpartition(" / ")
    factor, si = si_of(unit.strip("()")) if name else (1.0, "1")
    return name or text, si, factor


# --- as results.json has them ---------------------------------------------------------------------


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
    levels = [{"name": name, "y": float(y)} for name, y in chart.levels]
    series = []
    for s in chart.series:
        at = thinned(s.y, most)
        arrays = {"x": rounded(s.x[at]), "y": rounded(s.y[at])}
        if s.upper is not None:
            arrays["upper"] = rounded(s.upper[at])
        series.append({"label": s.name, "style": s.style, "points": len(s.x), **arrays})
    own = members(chart, "name", "title", "x", "y", "log", "caption")
    return own | {"levels": levels, "series": series}


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
    """Return the numbers to seven significant digits, which a file of text writes short."""
    return [float(f"{v:.{_DIGITS}g}") for v in values.tolist()]
