"""What every report shows, in order: each section is a function from the result to an exhibit."""

from collections.abc import Callable, Iterator

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.report.bodies import body
from validate.report.curves import curves
from validate.report.discrimination import discrimination
from validate.report.markers import markers
from validate.report.outlines import outlines
from validate.report.provenance import parameters, recording
from validate.report.registration import registration
from validate.report.score_tables import identified, methods, published, scores
from validate.report.verdicts import checks

SECTIONS: tuple[Callable[[Result], Exhibit | None], ...] = (
    checks,
    outlines,
    markers,
    curves,
    discrimination,
    body,
    methods,
    published,
    identified,
    scores,
    registration,
    recording,
    parameters,
)


def exhibits(result: Result, progress: Callable[[str], None]) -> Iterator[Exhibit]:
    """The sections that apply, and the experiment's own exhibits after the checks."""
    for make in SECTIONS:
        progress(make.__name__)
        made = make(result)
        if made is not None:
            yield made
        if make is checks:
            yield from result.exhibits
