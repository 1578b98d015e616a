"""Report section of the simulated body: still pictures of the scene that turns on the page."""

from dataclasses import replace

import numpy as np

from validate.compare.exhibit import Exhibit, NodeMap
from validate.compare.result import Result
from validate.report.scenes import gl
from validate.report.scenes.body_scene import body_scene
from validate.report.scenes.maps import drawn, ranges

_TITLE = "The simulated body"
_INSTANTS = 4


def body(result: Result) -> Exhibit | None:
    """Still pictures for a page of two columns and, as a file, of one; None without a body."""
    scene = body_scene(result, _INSTANTS)
    if scene is None:
        return None
    if not gl.available():  # the first method where it is moved most, by matplotlib
        method, worst = scene.methods[0].result, scene.worst
        u = method.run.u[scene.methods[0].frames[worst]]
        mesh = replace(method.scene.mesh, nodes=method.scene.mesh.nodes + u)
        title = f"{method.label} at {scene.labels[worst]}: displacement. {scene.part}".strip()
        size = np.linalg.norm(u, axis=1)
        shown = NodeMap("body", title, mesh, size, "m", "", "the deformed surface")
        picture = replace(drawn(shown, ranges([shown])["body"]), name="body")
        return Exhibit("body", _TITLE, (gl.HOW_TO_GET,), pictures=(picture,))
    from validate.report.scenes import stills  # vtk reads its window class when imported

    sheet = stills.sheet(scene)
    wide, narrow = (stills.picture(sheet, w) for w in (stills.TWO_COLUMNS, stills.ONE_COLUMN))
    return Exhibit("body", _TITLE, pictures=(wide,), files=(narrow,))
