"""The exhibits of a result as sections: sentences, number tables, charts, maps on the mesh."""

from collections import Counter
from collections.abc import Iterable

from validate.compare.exhibit import Entry, Exhibit, NodeMap, NumberTable
from validate.compare.result import Result
from validate.errors import ComparisonError
from validate.report import charts, csv_tables, gl, heat, regime_map
from validate.report.maps import Range, drawn, ranges
from validate.report.numbers import MISSING, significant, text
from validate.report.page import (
    Cell,
    Items,
    Paragraph,
    Part,
    Picture,
    Section,
    Table,
    cells,
)

_OURS = tuple(csv_tables.TABLES)  # files of every report


def exhibits(result: Result) -> tuple[Section, ...] | None:
    """One section per exhibit, in their order; None without any."""
    if not result.exhibits:
        return None
    scales = ranges(m for e in result.exhibits for m in e.maps)
    return tuple(_section(result, e, scales) for e in result.exhibits)


def require_distinct(found: tuple[Exhibit, ...]) -> None:
    """Raises `ComparisonError` naming what stands twice: names become files and anchors."""
    kinds = {
        "exhibits with the anchor": [e.anchor for e in found],
        "tables": [*_OURS, *(t.name for e in found for t in e.tables)],
        "charts": [c.name for e in found for c in e.charts],
        "heats": [h.name for e in found for h in e.heats],
        "maps": [m.name for e in found for m in e.maps],
        "regime maps": [m.name for e in found for m in e.regimes],
    }
    for kind, names in kinds.items():
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise ComparisonError(
                f"{Counter(names)[twice[0]]} {kind} '{twice[0]}'; give each its own name"
            )


def _section(result: Result, exhibit: Exhibit, scales: dict[str, Range]) -> Section:
    words = exhibit.words
    spoken: tuple[Part, ...] = (Items(words),) if len(words) > 1 else tuple(map(Paragraph, words))
    return Section(
        f"exhibit-{exhibit.anchor}",
        exhibit.title,
        (
            *spoken,
            *map(_table, exhibit.tables),
            *(charts.picture(result, c) for c in exhibit.charts),
            *map(heat.picture, exhibit.heats),
            *map(regime_map.picture, exhibit.regimes),
            *(_map(m, scales[m.scale or m.name]) for m in exhibit.maps),
        ),
    )


def _map(shown: NodeMap, span: Range) -> Picture:
    if shown.mesh.dimension != 3 or not gl.available():
        return drawn(shown, span)
    from validate.report.render_maps import rendered  # vtk reads its window class when imported

    return rendered(shown, span)


def _table(table: NumberTable) -> Table:
    columns = list(zip(*table.rows, strict=True))
    words = tuple(i for i, column in enumerate(columns) if any(isinstance(v, str) for v in column))
    title = table.title if table.title.endswith(".") else f"{table.title}."
    return Table(
        f"{title} {table.note}".strip(),
        table.headings,
        tuple(cells(*(shown(v) for v in row)) for row in table.rows) or _empty(table.headings),
        words=words,
    )


def shown(value: Entry) -> str:
    """An entry as read: three significant digits, whole numbers whole, a dash for None."""
    if value is None:
        return MISSING
    if isinstance(value, str):
        return value
    return text(float(value)) if isinstance(value, int) else significant(value)


def _empty(headings: Iterable[str]) -> tuple[tuple[Cell, ...], ...]:
    return (tuple(Cell(MISSING) for _ in headings),)
