"""HTML page of a report, by jinja2."""

from collections.abc import Iterable
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

from validate.compare.exhibit import Picture
from validate.compare.result import Result
from validate.report.charts.encode import uri
from validate.report.exhibits import DrawnExhibit
from validate.report.export.tables import across, caption, shown, word_columns

_SHRUNK = 0.47  # CSS pixels a pixel: letters of 8.5 points at 130 dots an inch are 7 high then


def page(
    result: Result, exhibits: Iterable[DrawnExhibit], created: str, band: tuple[str, str]
) -> str:
    """Return the whole report as one HTML text that needs no other file and no script.

    `band` is the colour class and the word before the result's sentence.
    """
    colour, word = band
    return _template("report.html").render(
        result=result, exhibits=[e for e in exhibits if e.shown], created=created, colour=colour,
        word=word,
    )  # fmt: skip


def fragment(exhibits: Iterable[DrawnExhibit]) -> str:
    """Some exhibits alone as one HTML text that needs no other file and no script."""
    return _template("fragment.html").render(exhibits=[e for e in exhibits if e.shown])


def sections(exhibits: Iterable[DrawnExhibit]) -> str:
    """Some exhibits in HTML for a page that has a head and a style of its own."""
    return _template("sections.html").render(exhibits=[e for e in exhibits if e.shown])


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
