"""The section that shows the simulated body: rendered where GL is, else drawn."""

from dataclasses import replace

import numpy as np

from validate.compare.exhibit import Exhibit, NodeMap, Picture
from validate.compare.result import Result
from validate.report import gl
from validate.report.body import ShownBody, shown_body
from validate.report.cut import cut
from validate.report.maps import drawn, ranges

_TITLE = "The simulated body"
_M = 1e-3


def body(result: Result) -> Exhibit | None:
    """Renders of the accepted method at the last load; None when there is no 3-D body."""
    shown = shown_body(result)
    if shown is None:
        return None
    if not gl.available():
        return Exhibit("body", _TITLE, (gl.HOW_TO_GET,), pictures=(_without_gl(shown),))
    from validate.report.renders import renders  # vtk reads its window class when imported

    return Exhibit("body", _TITLE, pictures=renders(shown))


def _without_gl(body: ShownBody) -> Picture:
    """The opened body, or the surface of a whole one."""
    if body.normal is not None:
        return cut(body, body.normal)
    u = _M * body.u
    title = f"{body.label} at {body.load}: displacement.{body.part}"
    moved = replace(body.mesh, nodes=body.mesh.nodes + u)
    size = NodeMap("body", title, moved, np.linalg.norm(u, axis=1), "m", "", "the deformed surface")
    return drawn(size, ranges([size])["body"])
