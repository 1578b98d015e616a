"""The section that shows the simulated body: rendered where GL is, else drawn."""

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.report import gl
from validate.report.body import shown_body
from validate.report.cut import cut

_TITLE = "The simulated body"


def body(result: Result) -> Exhibit | None:
    """Renders of the accepted method at the last load; None when there is no 3-D body."""
    shown = shown_body(result)
    if shown is None:
        return None
    if not gl.available():
        return Exhibit("body", _TITLE, (gl.HOW_TO_GET,), pictures=(cut(shown),))
    from validate.report.renders import renders  # vtk reads its window class when imported

    return Exhibit("body", _TITLE, pictures=renders(shown))
