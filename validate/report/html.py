"""The page from drawn exhibits, by jinja2."""

from collections.abc import Iterable
from importlib.resources import files

from jinja2 import Environment, StrictUndefined

from validate.compare.exhibit import Picture
from validate.compare.result import Result
from validate.report.encode import uri
from validate.report.exhibits import DrawnExhibit
from validate.report.tables import across, caption, shown, word_columns

_SHRUNK = 0.47  # CSS pixels a pixel: letters of 8.5 points at 130 dots an inch are 7 high then


def page(
    result: Result, exhibits: Iterable[DrawnExhibit], created: str, band: tuple[str, str]
) -> str:
    """The whole report as one HTML text that needs no other file and no script.

    `band` is the colour class and the word before the result's sentence.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True,
                              lstrip_blocks=True)  # fmt: skip
    environment.filters.update(
        uri=uri,
        across=across,
        caption=caption,
        shown=shown,
        word_columns=word_columns,
        breakable=_breakable,
        least_width=least_width,
    )
    source = files("validate.report").joinpath("report.html").read_text(encoding="utf-8")
    colour, word = band
    return environment.from_string(source).render(
        result=result, exhibits=[e for e in exhibits if e.shown], created=created, colour=colour,
        word=word,
    )  # fmt: skip


def least_width(picture: Picture) -> int:
    """CSS pixels below which the smallest letters of a picture cannot be read: it is scrolled then,
    not shrunk."""
    return int(_SHRUNK * picture.pixels.shape[1])


def _breakable(name: str) -> str:
    """A dotted name that may break into lines after its dots."""
    return name.replace(".", ".\u200b")
