"""The page from its sections, by jinja2."""

from importlib.resources import files

from jinja2 import Environment, StrictUndefined

from validate.compare.result import Result
from validate.report import (
    bodies,
    curves,
    discrimination,
    exhibits,
    markers,
    outlines,
    provenance,
    registration,
    score_tables,
    verdicts,
)
from validate.report.encode import data_uri, gif_uri
from validate.report.page import Section, SectionOf

SECTIONS: tuple[tuple[str, SectionOf], ...] = (
    ("checks", verdicts.checks),
    ("exhibits", exhibits.exhibits),
    ("outlines", outlines.outlines),
    ("markers", markers.markers),
    ("curves", curves.curves),
    ("discrimination", discrimination.discrimination),
    ("body", bodies.bodies),
    ("methods", score_tables.side_by_side),
    ("published", score_tables.published),
    ("identified", score_tables.identified),
    ("scores", score_tables.scores),
    ("registration", registration.registration),
    ("recording", provenance.recording),
    ("parameters", provenance.parameters),
)


def page(
    result: Result,
    shown: tuple[Section, ...],
    created: str,
    band: tuple[str, str] | None = None,
) -> str:
    """The whole report as one HTML text that needs no other file and no script.

    `band` is the colour class and the word before the sentence; None: by the checks.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True,
                              lstrip_blocks=True)  # fmt: skip
    environment.filters["data_uri"] = data_uri
    environment.filters["gif_uri"] = gif_uri
    environment.filters["breakable"] = _breakable
    source = files("validate.report").joinpath("report.html").read_text(encoding="utf-8")
    colour, word = band or verdicts.band(result)
    return environment.from_string(source).render(
        result=result, sections=shown, created=created, colour=colour, word=word
    )


def _breakable(name: str) -> str:
    """A dotted name that may break into lines after its dots."""
    return name.replace(".", ".\u200b")
