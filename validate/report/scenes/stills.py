"""Sheets of still pictures: instants below each other, methods side by side, colour bars below.

`sheet` draws the scene of the page's view that turns. Import only after `gl.available()`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from textwrap import fill

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from PIL import Image

from validate.arrays import Floats
from validate.compare.exhibit import Picture, Pixels
from validate.numbers import significant
from validate.report.charts.style import draw
from validate.report.scenes.body_scene import BodyScene, fields
from validate.report.scenes.maps import Range
from validate.report.scenes.panels import (
    ERRORS,
    THROUGH,
    TOOL,
    Stage,
    add_markers,
    add_outlines,
    add_probes,
    rendered_body,
    triangulated,
)
from validate.report.scenes.residual_arrows import rounded_down

ONE_COLUMN, TWO_COLUMNS = 85.0, 175.0  # mm of a journal's page
DPI = 300
_INCH = 25.4  # mm
_LONGEST = 0.1  # of the body's size: the longest arrow
_POINTS, _LETTER = 7.0, 0.056  # size of the letters, and inches that one takes
_LINE, _BAR = 0.13, 0.44  # inches of a line of text, of the colour bars below a row
_PAGE = 9.0  # inches that a sheet may be high
_LEAST = 1e-9  # what is smaller, of mm, %, Pa or of what differs, is rounding
_AT_REST = 1e-3  # of the largest displacement: below it nothing has moved
_DISPLACEMENT, _ERROR = "displacement / mm", "marker error / mm"


@dataclass(frozen=True)
class _Cell:
    """One panel: instant, method, what colours it; `less`: the method that is subtracted."""

    frame: int
    method: int
    by: str
    less: int | None = None

    @property
    def scale(self) -> str:
        """What cells of one colour range share."""
        return self.by if self.less is None else f"difference of {self.by}"


Rows = tuple[tuple[_Cell, ...], ...]


def _rows(scene: BodyScene, coloured: Sequence[str], most: int) -> Rows:
    """Instants of the displacement but those at rest, then fields at the largest one: `most` panels
    in a row."""
    frames = [(f, _DISPLACEMENT) for f in _moved(scene)]
    hidden = scene.cut is not None and any(m.markers for m in scene.methods)
    at_worst = [(scene.worst, name) for name in (*[_ERROR] * hidden, *coloured)]
    if len(scene.methods) == 1:
        cells = [_Cell(f, 0, by) for f, by in frames]
        chunks = [cells[i : i + most] for i in range(0, len(cells), most)]
        return tuple(map(tuple, [*chunks, [_Cell(f, 0, by) for f, by in at_worst]]))
    first, *others = scene.methods
    other = next((j for j, m in enumerate(others, 1) if m.on_mesh_of(first)), None)
    shown = range(min(len(scene.methods), most - (other is not None)))
    return tuple(
        (*(_Cell(f, m, by) for m in shown), *([] if other is None else [_Cell(f, 0, by, other)]))
        for f, by in (*frames, *at_worst)
    )


def _moved(scene: BodyScene) -> list[int]:
    """The instants at which the body is not at rest; all where it never moves."""
    moved = np.abs(scene.methods[0].u()).max(axis=(1, 2))
    there = np.flatnonzero(moved > _AT_REST * moved.max())
    return there.tolist() or list(range(len(scene.labels)))


@dataclass(frozen=True)
class Sheet:
    """Panels by their cell, and the colour range of each scale: what both widths show."""

    scene: BodyScene
    coloured: tuple[str, ...]
    panels: Mapping[_Cell, Pixels]
    spans: Mapping[str, Range]
    magnified: float


def sheet(scene: BodyScene) -> Sheet:
    """Return all panels of a scene, rendered."""
    by_method = fields(scene.methods, [scene.worst])
    coloured = tuple(dict.fromkeys(name for f in by_method for name in f))
    rows = _rows(scene, coloured, 9)
    moved = [m.u() for m in scene.methods]

    def numbers(cell: _Cell) -> Floats | None:
        if cell.by == _ERROR:
            seen = cell.less is None and scene.methods[cell.method].markers
            return np.full(len(moved[cell.method][0]), np.nan) if seen else None
        if cell.by == _DISPLACEMENT:
            less = 0.0 if cell.less is None else moved[cell.less][cell.frame]
            return np.asarray(np.linalg.norm(moved[cell.method][cell.frame] - less, axis=1))
        own = by_method[cell.method].get(cell.by)
        of = None if cell.less is None else by_method[cell.less].get(cell.by)
        if own is None or (cell.less is not None and of is None):
            return None
        return np.asarray(own[0] if of is None else np.abs(own[0] - of[0]))

    shown = {cell: v for row in rows for cell in row if (v := numbers(cell)) is not None}
    errors = [m.markers.errors for m in scene.methods if m.markers]
    longest = max((float(np.nanmax(e, initial=0.0)) for e in errors), default=0.0)
    spans: dict[str, Range] = {_DISPLACEMENT: (0.0, _LEAST), _ERROR: (0.0, max(longest, _LEAST))}
    for cell, v in shown.items():
        low, high = spans.get(cell.scale, (0.0, 0.0))
        if cell.by != _ERROR:
            spans[cell.scale] = min(low, float(v.min())), max(high, float(v.max()))
    shown = {c: v for c, v in shown.items() if _told(spans, c)}
    by = rounded_down(_LONGEST * scene.size / longest) if longest > _LEAST else 1.0
    by = float(np.clip(by, 1.0, 100.0))
    # Opened where the body has a cavity; markers, of which those on the part that is taken away
    # would hang in the air, stand on the whole body then
    stage, found = Stage(scene.camera, scene.size), dict[_Cell, Pixels]()
    plane = (scene.cut.normal, scene.cut.at * scene.cut.normal) if scene.cut else None
    bodies = [rendered_body(m.result.scene.mesh, m.nodes, plane) for m in scene.methods]
    for cell, v in shown.items():
        method, whole = scene.methods[cell.method], plane is None or cell.by == _ERROR
        body = replace(bodies[cell.method], plane=None) if whole else bodies[cell.method]
        ramp = "viridis" if cell.less is None else "cividis"
        compared = cell.less is None and cell.by in (_DISPLACEMENT, _ERROR)
        inside = compared and method.markers is not None and method.markers.inside
        x = method.nodes + method.u()[cell.frame]
        body.add(stage, x, v, spans[cell.scale], ramp, THROUGH if inside else 1.0)
        for tool in scene.tools:
            solid = triangulated(tool.nodes + tool.shifts[cell.frame], tool.triangles)
            if plane is not None and tool.plate and not whole:
                solid = solid.clip(normal=plane[0], origin=plane[1])
            stage.add(solid, **TOOL)
        if compared and whole and method.markers:
            top = spans[_ERROR][1]
            add_markers(stage, method.markers, cell.frame, scene.size, by, top)
        if compared and method.probes is not None:
            add_probes(stage, method.probes[1][cell.frame], scene.size)
        if compared and method.outlines and not (whole and plane):
            add_outlines(stage, *method.outlines[cell.frame], scene.size)
        found[cell] = stage.shot()
    stage.plotter.close()
    return Sheet(scene, coloured, found, spans, by)


def _told(spans: Mapping[str, Range], cell: _Cell) -> bool:
    """Whether the colours of a cell show more than rounding."""
    top = spans[cell.scale][1]
    of = spans[cell.by][1] if cell.less is not None else 1.0
    return top > _LEAST * of or cell.scale in (_DISPLACEMENT, _ERROR)


def picture(drawn: Sheet, width: float) -> Picture:
    """Return the sheet for a page that is `width` mm wide, at 300 dots an inch."""
    narrow = width < TWO_COLUMNS
    alone = len(drawn.scene.methods) == 1
    rows = _rows(drawn.scene, drawn.coloured, (2 if alone else 3) if narrow else 4 if alone else 5)
    rows = tuple(tuple(c for c in row if c in drawn.panels) for row in rows)
    layout = _Layout(drawn, tuple(filter(None, rows)), width / _INCH)
    pixels = layout.pixels()
    scene = drawn.scene
    names = ", ".join(m.result.label for m in scene.methods)
    labels = ", ".join(scene.labels[f] for f in _moved(scene))
    found = [f"{names} at {labels}, true to scale: displacement in mm"]
    if drawn.coloured:
        found[0] += f"; {' and '.join(drawn.coloured)} at the largest displacement"
    found += [w for w in _notes(drawn) if w not in found]
    caption = ". ".join(w.removesuffix(".") for w in found) + "."
    name = "body_one_column" if narrow else "body"
    return Picture(name, caption, f"Renders: {caption}", pixels, photo=True, dpi=DPI)


def _notes(drawn: Sheet) -> list[str]:
    scene = drawn.scene
    found = [scene.part] if scene.part else []
    if scene.cut:
        found.append(f"Opened along {scene.cut.words}")
    if any(m.markers for m in scene.methods):
        scale = f", {drawn.magnified:g} times as long" if drawn.magnified > 1 else ""
        found.append(f"Balls: measured markers; arrows to them from the simulated place{scale}")
    if any(m.outlines for m in scene.methods):
        found.append("Black: points of the measured outline; pink line: simulated outline")
    if any(m.probes is not None for m in scene.methods):
        found.append("White: probes of the simulation")
    if scene.tools:
        found.append("Grey: plates and tools")
    return found


@dataclass(frozen=True)
class _Layout:
    """Places of panels, texts and colour bars on a figure of `width` inches."""

    drawn: Sheet
    rows: Rows
    width: float

    @property
    def across(self) -> float:
        """Inches of a column."""
        return self.width / max(len(row) for row in self.rows)

    @property
    def panel(self) -> tuple[float, float]:
        """Inches of a panel, all of which are on one page."""
        high, wide = next(iter(self.drawn.panels.values())).shape[:2]
        tall = min(self.across * high / wide, (_PAGE - self._words()) / len(self.rows))
        return tall * wide / high, tall

    @property
    def notes(self) -> str:
        text = ". ".join(w.removesuffix(".") for w in _notes(self.drawn))
        return fill(text and f"{text}.", int(self.width / _LETTER))

    @property
    def height(self) -> float:
        return self._words() + len(self.rows) * self.panel[1]

    def _words(self) -> float:
        """Inches of all that is no panel."""
        bars = sum(self._ends(i) for i in range(len(self.rows)))
        lines = self._titles() + len(self.notes.splitlines()) + sum(map(self._labelled, self.rows))
        return lines * _LINE + bars * _BAR + 0.05

    def _label(self, row: tuple[_Cell, ...], k: int) -> str:
        """The instant above a panel, where it is not that of the one before."""
        if k > 0 and row[k].frame == row[k - 1].frame:
            return ""
        several = any(c.frame != row[0].frame for c in row)
        room = self.across if several else self.width
        return fill(self.drawn.scene.labels[row[k].frame], int(room / _LETTER) - 1)

    def _labelled(self, row: tuple[_Cell, ...]) -> int:
        return max(len(self._label(row, k).splitlines()) for k in range(len(row)))

    def _ends(self, i: int) -> bool:
        """Whether colours of a row are not those of the next one."""
        after = self.rows[i + 1] if i + 1 < len(self.rows) else ()
        return {c.scale for c in self.rows[i]} != {c.scale for c in after}

    def _title(self, cell: _Cell) -> str:
        label = self.drawn.scene.methods[cell.method].result.label
        if cell.less is not None:
            label = f"difference of {label} and {self.drawn.scene.methods[cell.less].result.label}"
        alone = len(self.drawn.scene.methods) == 1
        return fill(label, int((self.width if alone else self.across) / _LETTER) - 1)

    def _titles(self) -> int:
        return max(len(self._title(c).splitlines()) for c in self.rows[0])

    def pixels(self) -> Pixels:
        """The figure (h, w, 3): texts and bars by matplotlib, panels below what is dark in it."""
        pixels = draw(self._paint, self.width, self.height, DPI)
        wide, tall = self.panel
        size = round(DPI * wide), round(DPI * tall)
        for i, row in enumerate(self.rows):
            for k, cell in enumerate(row):
                panel = Image.fromarray(self.drawn.panels[cell]).resize(
                    size, Image.Resampling.LANCZOS
                )
                left = round(DPI * ((k + 0.5) * self.across - 0.5 * wide))
                top = round(DPI * (self.height - self._bottoms[i] - tall))
                place = pixels[top : top + size[1], left : left + size[0]]
                np.minimum(place, np.asarray(panel)[: len(place), : place.shape[1]], out=place)
        return pixels

    @cached_property
    def _bottoms(self) -> list[float]:
        """Inches from below to the lower end of each row."""
        tops = [self._titles() * _LINE + 0.02]
        tops += [self.panel[1] + _BAR * self._ends(i) for i in range(len(self.rows) - 1)]
        above = [_LINE * self._labelled(row) for row in self.rows]
        return [self.height - y - self.panel[1] for y in np.cumsum(np.add(tops, above)).tolist()]

    def _paint(self, figure: Figure) -> None:
        figure.set_layout_engine("none")
        several = len(self.drawn.scene.methods) > 1
        for k, cell in enumerate(self.rows[0] if several else self.rows[0][:1]):
            self._text(figure, k * self.across + 0.03, self.height - 0.02, self._title(cell))
        for i, (row, bottom) in enumerate(zip(self.rows, self._bottoms, strict=True)):
            for k in range(len(row)):
                top = bottom + self.panel[1] + _LINE * self._labelled(row)
                self._text(figure, k * self.across + 0.03, top, self._label(row, k))
            if self._ends(i):
                self._bars(figure, row, bottom - _BAR)
        self._text(figure, 0.03, self._bottoms[-1] - _BAR - 0.01, self.notes)

    @property
    def _marked(self) -> bool:
        """Whether markers stand on the bodies that the displacement colours."""
        return self.drawn.scene.cut is None and any(m.markers for m in self.drawn.scene.methods)

    def _text(self, figure: Figure, x: float, y: float, text: str) -> None:
        figure.text(x / self.width, y / self.height, text, fontsize=_POINTS, va="top", zorder=9)

    def _bars(self, figure: Figure, row: tuple[_Cell, ...], y: float) -> None:
        start = 0
        for scale, cells in groupby(row, lambda c: c.scale):
            count = len(list(cells))
            both = [
                scale,
                *([_ERROR] if scale == _DISPLACEMENT and self._marked else []),
            ]
            each = count * self.across / len(both)
            for j, name in enumerate(both):
                ramp: Colormap = ERRORS if name == _ERROR else mpl.colormaps[
                    "cividis" if name.startswith("difference") else "viridis"]  # fmt: skip
                wide = min(0.78 * each, 2.2)
                left = (start * self.across + j * each) + 0.5 * (each - wide)
                ax = figure.add_axes((left / self.width, (y + 0.3) / self.height, wide / self.width,
                                      0.07 / self.height))  # fmt: skip
                span = self.drawn.spans[name]
                bar = figure.colorbar(ScalarMappable(Normalize(*span), ramp), cax=ax,
                                      orientation="horizontal")  # fmt: skip
                ends = np.linspace(*span, 3).tolist()
                if sum(len(significant(e)) + 1 for e in ends) * _LETTER > wide:
                    ends = [*span]  # the middle one would touch them
                bar.set_ticks(ends, labels=[significant(e) for e in ends], fontsize=_POINTS - 0.5)
                bar.ax.tick_params(length=2, pad=1)
                first, *_, last = bar.ax.get_xticklabels()
                first.set_horizontalalignment("left")
                last.set_horizontalalignment("right")
                quantity = (
                    f"difference / {name.rpartition(' / ')[2]}" if name.startswith("diff") else name
                )
                bar.set_label(quantity, fontsize=_POINTS, labelpad=1)
            start += count
