"""Drawing of report items: charts, heat maps and regime maps as figures, and their files.

Every part of a report is drawn and encoded by itself, so that workers can draw parts side by side.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from validate.compare.exhibit import Exhibit, ImageSeries, NodeMap, Picture
from validate.errors import ComparisonError
from validate.files import safe_name
from validate.report.charts import chart as charts
from validate.report.charts import heat, intervals, regime_map
from validate.report.charts.style import HasMethods, encoded
from validate.report.export.tables import write_chart, write_table
from validate.report.scenes import gl
from validate.report.scenes.maps import Range, drawn, legible, ranges

Part = Exhibit | Callable[[Any], Exhibit | None]  # a section makes its exhibit of the result
S = TypeVar("S")
I = TypeVar("I")
T = TypeVar("T")


class Beside(Protocol):
    """Begins to apply a function of a module to what is `shared` and each item; what it returns
    waits for the values, in the order of the items."""

    def __call__(
        self, function: Callable[[Any, Any], Any], shared: Any, items: Iterable[Any]
    ) -> Callable[[], list[Any]]: ...


def in_turn(function: Callable[[S, I], T], shared: S, items: Iterable[I]) -> Callable[[], list[T]]:
    """As `Beside`, in this process once the values are asked for."""
    return lambda: [function(shared, item) for item in items]


@dataclass(frozen=True)
class DrawnExhibit:
    """An exhibit and the pictures of what it holds as numbers, in their order."""

    exhibit: Exhibit
    drawings: tuple[Picture, ...]

    @property
    def pictures(self) -> tuple[Picture | ImageSeries, ...]:
        """All pictures, those that the exhibit brought first."""
        return *self.exhibit.pictures, *self.drawings

    @property
    def shown(self) -> bool:
        """Whether there is anything for the page: an exhibit may be for files only."""
        return bool(self.exhibit.words or self.exhibit.tables or self.pictures)


def draw_all(result: HasMethods, found: Iterable[Part]) -> tuple[DrawnExhibit, ...]:
    """As `drawing`, in this process."""
    return drawing(result, enumerate(found))()


def drawing(
    result: HasMethods, parts: Iterable[tuple[int, Part]], beside: Beside = in_turn
) -> Callable[[], tuple[DrawnExhibit, ...]]:
    """Begin to draw exhibits, or what sections make of the result, each as it comes with its place
    among them; what it returns waits for them all. Maps of one scale have common colours.

    What is returned raises `ComparisonError` naming what stands twice: names become files and
    anchors.
    """
    places: list[int] = []

    def coming() -> Iterator[Part]:
        for place, part in parts:
            places.append(place)
            yield part

    begun = beside(_part, (result, gl.known()), coming())

    def finished() -> tuple[DrawnExhibit, ...]:
        found = begun()
        order = sorted(range(len(found)), key=places.__getitem__)
        made = [one for i in order if (one := found[i]) is not None]
        exhibits = [one.exhibit for one in made]
        _require_distinct(exhibits)
        clear = legible(m for e in exhibits for m in e.maps)
        scales = ranges(clear)
        of_maps = [(m, scales[m.scale or m.name]) for m in clear]
        maps = iter(beside(_map, gl.known(), of_maps)())
        return tuple(
            replace(one, drawings=(*one.drawings, *(next(maps) for _ in one.exhibit.maps)))
            for one in made
        )

    return finished


def _part(of: tuple[HasMethods, tuple[str, ...]], part: Part) -> DrawnExhibit | None:
    """A part with all that it draws but its maps, its pictures encoded; None where a section shows
    nothing. Its maps wait for those of other parts, which may share their colours."""
    result, known = of
    gl.learn(known)
    exhibit = part if isinstance(part, Exhibit) else part(result)
    if exhibit is None:
        return None
    drawings = (
        *(charts.picture(result, c) for c in exhibit.charts),
        *map(heat.picture, exhibit.heats),
        *map(regime_map.picture, exhibit.regimes),
    )
    first = (*map(intervals.picture, exhibit.intervals), *exhibit.pictures)
    brought, files = tuple(map(encoded, first)), tuple(map(encoded, exhibit.files))
    whole = replace(exhibit, pictures=brought, files=files)
    return DrawnExhibit(whole, tuple(map(encoded, drawings)))


def _map(known: tuple[str, ...], shown: tuple[NodeMap, Range]) -> Picture:
    gl.learn(known)
    if shown[0].mesh.dimension != 3 or not gl.available():
        return encoded(drawn(*shown))
    from validate.report.scenes.panels import rendered  # vtk reads its window class when imported

    return encoded(rendered(*shown))


def _require_distinct(found: Sequence[Exhibit]) -> None:
    kinds = {"report items with the anchor": [e.anchor for e in found]}
    kinds["tables"] = [t.name for e in found for t in (*e.tables, *e.data) if t.name]
    for kind in ("charts", "heats", "intervals", "maps", "regimes"):
        kinds[kind] = [one.name for e in found for one in getattr(e, kind)]
    for kind, names in kinds.items():
        name, count = next(iter(Counter(names).most_common(1)), ("", 0))
        if count > 1:
            raise ComparisonError(f"{count} {kind} '{name}'; give each a different name")


def write_files(shown: DrawnExhibit, folder: Path) -> None:
    """Tables and charts into tables/ as CSV, pictures into figures/ as PNG."""
    exhibit, tables, figures = shown.exhibit, folder / "tables", folder / "figures"
    for table in (*exhibit.tables, *exhibit.data):
        write_table(table, tables)
    for chart in exhibit.charts:
        write_chart(chart, tables)
    for picture in (*shown.pictures, *exhibit.files):
        if isinstance(picture, Picture):
            (figures / f"{safe_name(picture.name)}.png").write_bytes(encoded(picture).file)
