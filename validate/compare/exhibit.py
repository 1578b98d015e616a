"""Report items as plain data: sentences, tables, charts, maps on the mesh, images."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, Ints, checked
from validate.errors import ComparisonError
from validate.scene.mesh import Mesh

Entry = float | int | str | None
Emphasis = Literal["", "good", "bad", "open", "strong"]
Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class TableCell:
    """A table entry with its SI unit ("": the number is as shown) and its emphasis.

    `text` is how it reads, where that is not the rule; an emphasis never replaces words. `link` is
    the address that a page leads to from it. A number that is not finite is none.
    """

    value: Entry
    unit: str = ""
    text: str = ""
    emphasis: Emphasis = ""
    link: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.value, float) and not math.isfinite(self.value):
            object.__setattr__(self, "value", None)


def plain(entry: Entry | TableCell) -> Entry:
    """Return the entry itself, without its unit and emphasis."""
    return entry.value if isinstance(entry, TableCell) else entry


@dataclass(frozen=True)
class NumberTable:
    """Rows under headings that carry their units; None where there is no number, and `note` why.

    Values are as shown (mm where the heading says mm) but for cells with a unit, which are SI.
    `name` is the file's in tables/; empty: only on the page, its numbers stand in another table.
    `folded` tables are opened by their reader. `below` is a heading whose texts stand on a line of
    their own below the row, so that no width of a page hides them.
    """

    name: str
    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[Entry | TableCell, ...], ...]
    note: str = ""
    folded: bool = False
    below: str = ""

    def __post_init__(self) -> None:
        named = f"table '{self.name or self.title}'"
        if self.below and self.below not in self.headings:
            raise ComparisonError(f"{named}: no heading '{self.below}' to stand below")
        for row in self.rows:
            if len(row) != len(self.headings):
                raise ComparisonError(
                    f"{named}: a row of {len(row)} under {len(self.headings)} headings"
                )
            if any(isinstance(v, float) and not math.isfinite(v) for v in row):
                raise ComparisonError(f"{named}: a number is not finite in {row[0]}")


@dataclass(frozen=True)
class Series:
    """y (k,) over x (k,), drawn as a line, as points, or as a band to `upper` (k,).

    `of` tells lines of one label apart: the recording that each belongs to.
    """

    label: str
    x: Floats
    y: Floats
    style: Literal["line", "points", "band"] = "line"
    upper: Floats | None = None
    of: str = ""

    @property
    def name(self) -> str:
        """The label, and what the line is of."""
        return f"{self.label}, {self.of}" if self.of else self.label

    def __post_init__(self) -> None:
        x = checked(self.x, f"series '{self.label}' x", (None,), error=ComparisonError)
        y = checked(self.y, f"series '{self.label}' y", (len(x),), error=ComparisonError)
        object.__setattr__(self, "x", x)
        object.__setattr__(self, "y", y)


@dataclass(frozen=True)
class Chart:
    """One chart: axes with units, series, and named levels (horizontal lines).

    `linear`: y is linear between -linear and linear and logarithmic beyond (0: `log` alone counts).
    `scale` is the size, in y's unit, of what y is a difference of: on a logarithmic axis a y far
    below it is rounding and is not drawn.
    """

    name: str
    title: str
    x: str
    y: str
    series: tuple[Series, ...]
    levels: tuple[tuple[str, float], ...] = ()
    log: Literal["", "x", "y", "xy"] = ""
    caption: str = ""
    linear: float = 0.0
    scale: float = 0.0


@dataclass(frozen=True)
class NodeMap:
    """A number at every node (n,) in `unit`, drawn on the mesh's surface.

    Maps of one `scale` share their colour range. `surface` says what the mesh is: a deformed shape
    is a map on the moved mesh.
    """

    name: str
    title: str
    mesh: Mesh
    values: Floats
    unit: str
    scale: str = ""
    surface: str = "the undeformed surface"

    def __post_init__(self) -> None:
        n = len(self.mesh.nodes)
        values = checked(self.values, f"map '{self.name}'", (n,), error=ComparisonError)
        object.__setattr__(self, "values", values)


@dataclass(frozen=True)
class Heat:
    """Numbers over two axes: values (rows, columns) under the axes' own texts, NaN = none.

    `centre` is the value that colours turn at (None: they only rise); all numbers above 0 are
    coloured by their logarithms.
    """

    name: str
    title: str
    x: str
    y: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    values: Floats
    quantity: str
    centre: float | None = None

    def __post_init__(self) -> None:
        shape = (len(self.rows), len(self.columns))
        fail = ComparisonError
        values = checked(self.values, f"heat '{self.name}'", shape, nan=True, error=fail)
        object.__setattr__(self, "values", values)


@dataclass(frozen=True)
class Panel:
    """One part of a regime map: codes (rows, columns) into its regimes, and a predicted border.

    `border` (rows,) is the x at which every row is predicted to turn, NaN = nowhere.
    """

    title: str
    codes: Ints
    border: Floats


@dataclass(frozen=True)
class Mark:
    """A named place on a regime map: x, and the index of its row.

    `on_map` is False where it only lies above: something else is not as on the map.
    """

    label: str
    x: float
    row: float
    on_map: bool = True


@dataclass(frozen=True)
class RegimeMap:
    """Regimes over logarithmic x (columns,) and the texts of rows, one panel a method."""

    name: str
    title: str
    x_label: str
    y_label: str
    x: Floats
    rows: tuple[str, ...]
    regimes: tuple[str, ...]
    panels: tuple[Panel, ...]
    marks: tuple[Mark, ...] = ()
    caption: str = ""

    def __post_init__(self) -> None:
        shape = (len(self.rows), len(self.x))
        for panel in self.panels:
            if panel.codes.shape != shape or len(panel.border) != len(self.rows):
                raise ComparisonError(
                    f"map '{self.name}', {panel.title}: codes {panel.codes.shape}, needs {shape}"
                )


@dataclass(frozen=True)
class Intervals:
    """values (k,) ± halves (k,) each with its limit (k,), all in the unit of its line, NaN = none.

    `texts` are the numbers as read, `answers` what follows from them, `quantities` what each line
    compares (empty: not told), `across` what is divided by the limits.
    """

    name: str
    title: str
    labels: tuple[str, ...]
    values: Floats
    halves: Floats
    limits: Floats
    texts: tuple[str, ...]
    answers: tuple[str, ...]
    caption: str = ""
    quantities: tuple[str, ...] = ()
    across: str = "error ± 2 u_val over its limit"

    def __post_init__(self) -> None:
        shape, fail = (len(self.labels),), ComparisonError
        for name in ("values", "halves", "limits"):
            found = checked(getattr(self, name), f"intervals '{self.name}' {name}", shape, nan=True,
                            error=fail)  # fmt: skip
            object.__setattr__(self, name, found)


@dataclass(frozen=True)
class Picture:
    """Image: pixels (h, w, 3) sRGB with a caption and a text alternative (alt).

    `photo` pictures are shaded renders, which a lossy code may touch; the others are line art.
    `dpi` are the dots an inch at which its letters have their size.
    """

    name: str
    caption: str
    alt: str
    pixels: Pixels
    photo: bool = False
    dpi: int = 130


@dataclass(frozen=True)
class ImageSeries:
    """Images (h, w, 3) sRGB of one size that a slider goes through, each with its label.

    Raises `ComparisonError` unless there is a label for each of one image or more.
    """

    name: str
    caption: str
    alt: str
    images: tuple[Pixels, ...]
    labels: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.images or len(self.images) != len(self.labels):
            raise ComparisonError(
                f"series '{self.name}': {len(self.images)} images and {len(self.labels)} labels; "
                "give each image one label"
            )


@dataclass(frozen=True)
class Exhibit:
    """A part of a report: its sentences, then pictures, tables, charts, heats, intervals, maps.

    `data` and `files` are tables and pictures for files only: the numbers behind what is shown, SI
    with a column of units, and what a page shows in another size.
    """

    anchor: str
    title: str
    words: tuple[str, ...] = ()
    tables: tuple[NumberTable, ...] = ()
    charts: tuple[Chart, ...] = ()
    maps: tuple[NodeMap, ...] = ()
    heats: tuple[Heat, ...] = ()
    intervals: tuple[Intervals, ...] = ()
    regimes: tuple[RegimeMap, ...] = ()
    pictures: tuple[Picture | ImageSeries, ...] = ()
    data: tuple[NumberTable, ...] = ()
    files: tuple[Picture, ...] = ()


def captioned(exhibit: Exhibit, captions: Mapping[str, str]) -> Exhibit:
    """Return the exhibit with a sentence under each of its charts that is named."""
    charts = (replace(c, caption=captions.get(c.name, c.caption)) for c in exhibit.charts)
    return replace(exhibit, charts=tuple(charts))
