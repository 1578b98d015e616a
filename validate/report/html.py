"""HTML page of a report, by jinja2."""

from collections.abc import Iterable
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

from validate.compare.exhibit import Animation, Picture
from validate.compare.result import Result
from validate.report.charts.encode import uri
from validate.report.exhibits import DrawnExhibit
from validate.report.export.tables import across, caption, shown, word_columns
from validate.report.sections.observations import timed
from validate.report.views.numbers import with_unit

_SHRUNK = 0.47  # CSS pixels a pixel: letters of 8.5 points at 130 dots an inch are 7 high then


def page(
    result: Result, exhibits: Iterable[DrawnExhibit], created: str, band: tuple[str, str]
) -> str:
    """Return the whole report as one HTML text that needs no other file and no script.

    `band` is the colour class and the word before the result's sentence.
    """
    colour, word = band
    shown = [e for e in exhibits if e.shown]
    first = first_pictures(shown)
    return _template("report.html").render(
        result=result, exhibits=shown, created=created, colour=colour, word=word, first=first,
        above=[picture.name for picture in first], cost=cost(result),
    )  # fmt: skip


#: Pictures of the first screen, by name: the body with what was measured, else the body.
_BODY = ("render_markers", "render_deformed", "cut", "markers", "outlines")
_CHECKS = "intervals_limits"


def first_pictures(exhibits: Iterable[DrawnExhibit]) -> list[Picture | Animation]:
    """The body as simulated and measured, and every check against its limit; what is there."""
    by_name = {picture.name: picture for e in exhibits for picture in e.pictures}
    body = next((by_name[name] for name in _BODY if name in by_name), None)
    return [p for p in (body, by_name.get(_CHECKS)) if p is not None]


def cost(result: Result) -> str:
    """The rate of each checked method and how it was measured; "" where none finished a step."""
    found = [
        f"{m.called}: {with_unit(times.rate_hz, 'Hz')}"
        for m in result.methods
        if m.checks and (times := timed(m.run)) is not None
    ]
    return "; ".join(found)


def fragment(exhibits: Iterable[DrawnExhibit]) -> str:
    """Some exhibits alone as one HTML text that needs no other file and no script."""
    return _template("fragment.html").render(exhibits=[e for e in exhibits if e.shown], above=[])


def sections(exhibits: Iterable[DrawnExhibit]) -> str:
    """Some exhibits in HTML for a page that has a head and a style of its own."""
    return _template("sections.html").render(exhibits=[e for e in exhibits if e.shown], above=[])


def _template(name: str) -> Template:
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=FunctionLoader(lambda n: files("validate.report").joinpath(n).read_text("utf-8")),
    )  # fmt: skip
    environment.filters.update(
        uri=uri,
        across=across,
        caption=caption,
        shown=shown,
        word_columns=word_columns,
        breakable=_breakable,
        least_width=least_width,
    )
    return environment.get_template(name)


def least_width(picture: Picture) -> int:
    """CSS pixels below which the smallest letters of a picture cannot be read: it is scrolled then,
    not shrunk."""
    return int(_SHRUNK * picture.pixels.shape[1])


def _breakable(name: str) -> str:
    """A dotted name that may break into lines after its dots."""
    return name.replace(".", ".\u200b")
