"""HTML page of a report, by jinja2, with charts and a body for `page.js`."""

import base64
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from itertools import count, pairwise
from typing import Any

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined, Template
from markupsafe import Markup

from validate.arrays import Floats
from validate.compare.exhibit import (
    Chart,
    Entry,
    ImageSeries,
    Intervals,
    Picture,
    TableCell,
    plain,
)
from validate.compare.result import MethodResult, Result
from validate.files import safe_name
from validate.numbers import duration, with_unit
from validate.report.charts.axes import (
    TOGETHER,
    band_of,
    beneath,
    floor_of,
    is_given,
    is_jagged,
    levels,
    styled,
)
from validate.report.charts.intervals import order, reach, shares
from validate.report.charts.style import DPI, HasMethods, uri
from validate.report.exhibits import DrawnExhibit
from validate.report.export.tables import caption, sheet, shown, word_columns
from validate.report.scenes.body import SurfacePart, skins
from validate.report.scenes.body_scene import (
    ShownMethod,
    body_scene,
    fields,
    shown_methods,
)
from validate.report.sections.observations import timed, where_shown
from validate.report.views.view_filling import WORDS

_SHRUNK = 0.47  # CSS pixels a pixel: letters of 8.5 points at 130 dots an inch are 7 high then
_LONG = 420  # letters of a sentence that are shown at once: four lines
#: Sections that a reader opens: how the numbers came about, and long lists.
CLOSED = ("discrimination", "body", "scores", "registration", "recording", "parameters", "made",
          "published")  # fmt: skip
_OPEN = 3  # of an experiment's own sections; its others are opened by their reader
_BODY = ("body", "markers", "outlines")  # pictures of the first screen, by name: the first there
_CHECKS = "intervals_limits"


@dataclass(frozen=True)
class Line:
    """One check on its track: the interval from `low` on, `wide` long, and its value `at`, in % of
    the track; a value `beyond` the track lies "above" or "below" it; `link` to the picture of what
    was compared."""

    label: str
    link: str
    low: float
    wide: float
    at: float
    beyond: str
    text: str
    answer: str
    colour: str


@dataclass(frozen=True)
class Forest:
    """Error intervals against their limits, the largest share first; `within` is the limit's band,
    `zero` no error, in % of the track."""

    name: str
    title: str
    caption: str
    across: str
    within: tuple[float, float]
    zero: float
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Live:
    """What the page shows of its pictures besides their pixels, by the name of the picture."""

    plots: Mapping[str, Any] = field(default_factory=dict)
    forests: Mapping[str, Forest] = field(default_factory=dict)


def page(
    result: Result,
    exhibits: Iterable[DrawnExhibit],
    created: str,
    band: tuple[str, str],
    view: Mapping[str, Any] | None = None,
) -> str:
    """Return the whole report as one HTML text that needs no other file and no request.

    `band` is the colour class and the word before the result's sentence, `view` the body that
    turns. Without scripts the page
    shows the still pictures and every row.
    """
    colour, word = band
    shown = [e for e in exhibits if e.shown]
    first = first_pictures(shown)
    # The anchor of the picture that shows a compared quantity, by the quantity
    figures = {picture.name for e in shown for picture in e.pictures}
    anchors = {e.exhibit.anchor for e in shown}
    links = {}
    for quantity, section in where_shown(result).items():
        curve = f"chart_curve_{quantity.replace('.', '_')}"
        if curve in figures or "chart_curve" in figures:
            links[quantity] = f"#figure-{curve if curve in figures else 'chart_curve'}"
        if section in anchors:
            links[quantity] = f"#{section}"
    live = Live(
        {f"chart_{c.name}": plot(result, c) for e in shown for c in e.exhibit.charts},
        {f"intervals_{i.name}": forest(i, links) for e in shown for i in e.exhibit.intervals},
    )
    body = next((p for p in first if p.name == "body"), None)
    if view is not None:  # it shows what another picture of the body would
        first = [p for p in first if p is body or p.name == _CHECKS]
    own = [e.anchor for e in result.exhibits] if result.methods else []
    return _template("report.html").render(
        result=result, exhibits=shown, created=created, colour=colour, word=word, first=first,
        above=[picture.name for picture in first], cost=cost(result), live=live,
        first_body=body, view=view, closed=(*CLOSED, *own[_OPEN:]),
        long=len(result.sentence) > _LONG,
    )  # fmt: skip


def first_pictures(exhibits: Iterable[DrawnExhibit]) -> list[Picture | ImageSeries]:
    """The body as simulated and measured, without one the first other picture, and every check
    against its limit; what is there."""
    by_name = {picture.name: picture for e in exhibits for picture in e.pictures}
    names = (*_BODY, *(name for name in by_name if name != _CHECKS))
    body = next((by_name[name] for name in names if name in by_name), None)
    return [p for p in (body, by_name.get(_CHECKS)) if p is not None]


def cost(result: Result) -> str:
    """The rate of each checked method and its slow steps, which the rate hides where most steps are
    read from a table; "" where none finished a step."""
    found = [
        f"{m.label}: {with_unit(times.rate_hz, 'Hz')}, p99 of a step {duration(times.p99)}"
        for m in result.methods
        if m.checks and (times := timed(m.run)) is not None
    ]
    return "; ".join(found)


def forest(found: Intervals, links: Mapping[str, str]) -> Forest:
    """Return intervals as lines of HTML; `links` leads from a quantity to its picture."""
    share, half, of = shares(found)
    far = reach(share, half)
    left = -far if (share - half < 0).any() else 0.0

    def place(x: float) -> float:
        return round(100 * (float(np.clip(x, left, far)) - left) / (far - left), 2)

    common = {label.partition(": ")[0] for label in found.labels if ": " in label}
    prefix = f"{common.pop()}: " if len(common) == 1 else ""
    lines = tuple(
        Line(
            found.labels[i].removeprefix(prefix),
            links.get(found.quantities[i], "") if found.quantities else "",
            low := place(share[i] - half[i]), round(place(share[i] + half[i]) - low, 2),
            place(share[i]), _beyond(share[i], far), found.texts[i], found.answers[i],
            WORDS.get(found.answers[i], "open"),
        )
        for i in order(found)
    )  # fmt: skip
    start = place(-1.0)
    name = f"intervals_{found.name}"
    within = (start, round(place(1.0) - start, 2))
    told = f"{prefix.removesuffix(': ')}. {found.caption}" if prefix else found.caption
    return Forest(name, found.title, told, of, within, place(0.0), lines)


def _beyond(share: float, far: float) -> str:
    return "" if abs(share) <= far else "above" if share > 0 else "below"


def fragment(exhibits: Iterable[DrawnExhibit]) -> str:
    """Some exhibits alone as one HTML text that needs no other file and no script."""
    return _shown("fragment.html", exhibits)


def sections(exhibits: Iterable[DrawnExhibit]) -> str:
    """Some exhibits in HTML for a page that has a head and a style of its own."""
    return _shown("sections.html", exhibits)


def _shown(template: str, exhibits: Iterable[DrawnExhibit]) -> str:
    return _template(template).render(exhibits=[e for e in exhibits if e.shown], live=Live())


def _template(name: str) -> Template:
    """A template, compiled once a process; tables of each page are numbered from 0."""
    number, environment = count(), _environment()
    environment.filters["table_id"] = lambda table: (
        f"{safe_name(table.name or 'table')}-{next(number)}"
    )
    return environment.get_template(name)


@cache
def _environment() -> Environment:
    folder = files("validate.report.page")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=FunctionLoader(lambda n: folder.joinpath(n).read_text("utf-8")),
    )  # fmt: skip
    # Files of style and script stand in the page as they are: no text of a result is in them.
    environment.globals["file"] = lambda n: Markup(folder.joinpath(n).read_text("utf-8"))
    environment.filters.update(
        uri=uri,
        caption=caption,
        sheet=sheet,
        shown=shown,
        word_columns=word_columns,
        breakable=_breakable,
        least_width=least_width,
        json=_json,
        sort_key=_sort_key,
    )
    return environment


def least_width(picture: Picture) -> int:
    """CSS pixels below which the smallest letters of a picture cannot be read: it is scrolled then,
    not shrunk."""
    return int(_SHRUNK * picture.pixels.shape[1] * DPI / picture.dpi)


def _breakable(name: str) -> str:
    """A dotted name that may break into lines after its dots."""
    return name.replace(".", ".\u200b")


def _json(found: Any) -> Markup:
    """JSON inside a script element, which no text of it can end."""
    text = json.dumps(found, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return Markup(text.replace("<", "\\u003c"))


def _sort_key(entry: Entry | TableCell) -> Markup:
    """The attribute that a number is sorted by: it reads with units and spaces."""
    value = plain(entry)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return Markup(f' data-sort="{value!r}"' if number else "")


# --- charts that zoom and show values: their numbers as uPlot takes them -------------------------

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
        dash = "-" if jagged else drawn.look.dash
        look = {"label": drawn.series.name if apart else of, "colour": drawn.look.colour,
                "dash": [] if dash == "-" else [3 * float(length) for length in dash[1]],
                "width": 0.9 if jagged else drawn.look.width or 1.0,
                "hidden": of in later or bool(band_of(drawn.series, later))}  # fmt: skip
        style, across = drawn.series.style, drawn.series.x
        ways = [np.argsort(across, kind="stable")]
        if style == "line":  # parts between its turns, each in rising x; neighbours share ends
            sense = np.sign(np.diff(across))
            moving = np.flatnonzero(sense)
            turns = moving[1:][sense[moving[1:]] != sense[moving[:-1]]]
            ends = [0, *turns.tolist(), len(across) - 1]
            pieces = [np.arange(a, b + 1) for a, b in pairwise(ends)]
            if len(pieces) > _WAYS:
                style = "points"
            elif len(pieces) > 1:
                ways = [part[np.argsort(across[part], kind="stable")] for part in pieces]
        given = {"y": drawn.series.y}
        given |= {} if drawn.series.upper is None else {"upper": drawn.series.upper}
        for way in ways:
            keep = way
            if len(way) > _MOST:  # the lowest and the highest of equal parts, and both ends
                y = drawn.series.y[way]
                parts = np.array_split(np.arange(len(y)), _MOST // 2)
                peaks = [i for p in parts for i in (p[y[p].argmin()], p[y[p].argmax()])]
                keep = way[np.unique([0, *peaks, len(y) - 1])]
            x, columns = _numbers(across[keep]), {}
            for name, values in given.items():
                above = np.where(least and values[keep] < least, np.nan, values[keep])
                columns[name] = _numbers(above, _SHOWN)
            if x not in xs:
                xs.append(x)
            series.append({**look, "style": style, "x": xs.index(x), **columns})
    return {
        "x": chart.x, "y": chart.y, "log": chart.log, "linear": chart.linear, "xs": xs,
        "series": series,
        "levels": [{"label": name, "y": _number(y)} for name, y in levels(chart)],
    }  # fmt: skip


def _numbers(values: Floats, digits: int = _DIGITS) -> list[float | None]:
    return [_number(v, digits) for v in values.tolist()]


def _number(value: float, digits: int = _DIGITS) -> float | None:
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


# --- the body that turns: surfaces, displacements, measured points as JSON -----------------------

_MOST_TRIANGLES = 6000  # of one method's surface
_MOST_FRAMES, _FEWEST_FRAMES = 24, 3
_BYTES = 450_000  # of all displacements and cell fields, before base 64
_STEPS = 32767  # of a displacement: it is stored as a share of the largest one


def body_view(result: Result) -> dict[str, Any] | None:
    """Return what `page.js` draws of up to four methods that finished, the accepted one first; None
    where none of them has a mesh.

    Methods are shown at the instants of the first one, each at its own nearest output frame. Of
    several recordings the first is shown.
    """
    surfaces = [_surface(m) for m in shown_methods(result)]
    if not surfaces:
        return None
    per_frame = sum(8 * len(np.unique(np.concatenate([p.nodes for p in s]))) + 1 for s in surfaces)
    scene = body_scene(result, int(np.clip(_BYTES / per_frame, _FEWEST_FRAMES, _MOST_FRAMES)))
    if scene is None:
        return None
    coloured = fields(scene.methods, range(len(scene.labels)))
    return {
        "labels": list(scene.labels),
        "size": scene.size,
        "flat": scene.flat,
        "camera": {name: np.ravel(value).tolist() for name, value in vars(scene.camera).items()},
        "part": scene.part,
        "left_out": list(scene.left_out),
        "methods": [_method(*of) for of in zip(scene.methods, surfaces, coloured, strict=True)],
        "tools": [
            {"nodes": _packed(t.nodes, "<f4"), "triangles": _packed(t.triangles, "<u4"),
             "shifts": _packed(t.shifts, "<f4")}
            for t in scene.tools
        ],
        "cut": scene.cut and {"normal": scene.cut.normal.tolist(), "at": scene.cut.at,
                              "words": scene.cut.words},
    }  # fmt: skip


def _surface(method: MethodResult) -> tuple[SurfacePart, ...]:
    """The parts that are drawn: outside and walls, or all triangles of a planar mesh."""
    mesh = method.scene.mesh
    if mesh.dimension == 3:
        return skins(method.scene, _MOST_TRIANGLES)
    nodes, local = np.unique(mesh.simplices, return_inverse=True)
    return (SurfacePart("body", nodes, local.reshape(-1, 3), len(mesh.simplices)),)


def _method(
    shown: ShownMethod, parts: Sequence[SurfacePart], coloured: Mapping[str, Floats]
) -> dict[str, Any]:
    nodes = np.unique(np.concatenate([part.nodes for part in parts]))
    seen = shown.markers
    return {
        "label": shown.result.label,
        "nodes": _packed(shown.nodes[nodes], "<f4"),
        "parts": [
            {"name": p.name, "triangles": _packed(np.searchsorted(nodes, p.nodes)[p.triangles],
                                                  "<u4")}
            for p in parts
        ],
        "u": _shares(shown.u(nodes)),
        "fields": {name: _shares(values[:, nodes]) for name, values in coloured.items()},
        "markers": seen and {
            "names": list(seen.names), "rest": _packed(seen.rest, "<f4"),
            "measured": _packed(seen.measured, "<f4"),
            "simulated": _packed(seen.simulated, "<f4"), "inside": seen.inside,
        },
        "probes": shown.probes and {
            "rest": _packed(shown.probes[0], "<f4"), "moved": _packed(shown.probes[1], "<f4"),
        },
        "outlines": [
            {"measured": _packed(measured, "<f4"), "simulated": _packed(simulated, "<f4")}
            for measured, simulated in shown.outlines
        ] or None,
    }  # fmt: skip


def _shares(values: Floats) -> Mapping[str, Any]:
    """Values as 16-bit shares of their largest size."""
    top = float(np.abs(values).max(initial=0.0)) or 1.0
    return {"top": top, "shares": _packed(np.round(values / top * _STEPS), "<i2")}


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
