"""An exhibit drawn: its charts, heats, regimes and maps as pictures; its files."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from validate.compare.exhibit import Animation, Exhibit, NodeMap, Picture
from validate.compare.result import Result
from validate.errors import ComparisonError
from validate.file_names import safe_name
from validate.report import charts, gl, heat, regime_map
from validate.report.encode import gif, png
from validate.report.maps import Range, drawn, legible, ranges
from validate.report.tables import write_chart, write_table


@dataclass(frozen=True)
class DrawnExhibit:
    """An exhibit and the pictures of what it holds as numbers, in their order."""

    exhibit: Exhibit
    drawings: tuple[Picture, ...]

    @property
    def pictures(self) -> tuple[Picture | Animation, ...]:
        """All pictures, those that the exhibit brought first."""
        return *self.exhibit.pictures, *self.drawings

    @property
    def shown(self) -> bool:
        """Whether there is anything for the page: an exhibit may be for files only."""
        return bool(self.exhibit.words or self.exhibit.tables or self.pictures)


def draw_all(result: Result, found: Iterable[Exhibit]) -> tuple[DrawnExhibit, ...]:
    """The exhibits drawn, their maps in common colours.

    Raises `ComparisonError` naming what stands twice: names become files and anchors.
    """
    exhibits = tuple(found)
    _require_distinct(exhibits)
    clear = iter(legible(m for e in exhibits for m in e.maps))
    exhibits = tuple(replace(e, maps=tuple(next(clear) for _ in e.maps)) for e in exhibits)
    scales = ranges(m for e in exhibits for m in e.maps)
    return tuple(DrawnExhibit(e, _drawings(result, e, scales)) for e in exhibits)


def _drawings(result: Result, exhibit: Exhibit, scales: dict[str, Range]) -> tuple[Picture, ...]:
    return (
        *(charts.picture(result, c) for c in exhibit.charts),
        *map(heat.picture, exhibit.heats),
        *map(regime_map.picture, exhibit.regimes),
        *(_map(m, scales[m.scale or m.name]) for m in exhibit.maps),
    )


def _map(shown: NodeMap, span: Range) -> Picture:
    if shown.mesh.dimension != 3 or not gl.available():
        return drawn(shown, span)
    from validate.report.render_maps import rendered  # vtk reads its window class when imported

    return rendered(shown, span)


def _require_distinct(found: tuple[Exhibit, ...]) -> None:
    kinds = {
        "report items with the anchor": [e.anchor for e in found],
        "tables": [t.name for e in found for t in (*e.tables, *e.data) if t.name],
        "charts": [c.name for e in found for c in e.charts],
        "heats": [h.name for e in found for h in e.heats],
        "maps": [m.name for e in found for m in e.maps],
        "regime maps": [m.name for e in found for m in e.regimes],
    }
    for kind, names in kinds.items():
        name, count = next(iter(Counter(names).most_common(1)), ("", 0))
        if count > 1:
            raise ComparisonError(f"{count} {kind} '{name}'; give each a different name")


def write_files(shown: DrawnExhibit, folder: Path) -> None:
    """Tables and charts into tables/ as CSV, pictures into figures/ as PNG, what moves as GIF."""
    exhibit, tables, figures = shown.exhibit, folder / "tables", folder / "figures"
    for table in (*exhibit.tables, *exhibit.data):
        write_table(table, tables)
    for chart in exhibit.charts:
        write_chart(chart, tables)
    for picture in shown.pictures:
        if isinstance(picture, Animation):
            (figures / f"{safe_name(picture.name)}.gif").write_bytes(gif(picture))
        else:
            (figures / f"{safe_name(picture.name)}.png").write_bytes(png(picture))
