"""HTML page of a report, by jinja2, with what `page.js` makes of its figures and tables."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from itertools import count
from typing import Any

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined, Template
from markupsafe import Markup

from validate.compare.exhibit import (
    Entry,
    ImageSeries,
    Intervals,
    Picture,
    TableCell,
    plain,
)
from validate.compare.result import Result
from validate.files import safe_name
from validate.numbers import duration, with_unit
from validate.report.charts.encode import uri
from validate.report.charts.intervals import order, reach, shares
from validate.report.charts.style import DPI
from validate.report.exhibits import DrawnExhibit
from validate.report.export.tables import caption, sheet, shown, word_columns
from validate.report.page.plots import plot
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
