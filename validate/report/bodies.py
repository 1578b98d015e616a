"""The section that shows the simulated body: rendered where GL is, else drawn."""

from validate.compare.result import Result
from validate.report import gl
from validate.report.body import body
from validate.report.cut import cut
from validate.report.page import Paragraph, Section, section


def bodies(result: Result) -> Section | None:
    """Renders of the accepted method at the last load; None when there is no 3-D body."""
    shown = body(result)
    if shown is None:
        return None
    if not gl.available():
        return section("body", "The simulated body", Paragraph(gl.HOW_TO_GET), cut(shown))
    from validate.report.renders import renders  # vtk reads its window class when imported

    return section("body", "The simulated body", *renders(shown))
