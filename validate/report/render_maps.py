"""Off-screen renders of numbers at the nodes by pyvista. Import only after `gl.available()`."""

from typing import Any

import numpy as np

from validate.compare.exhibit import NodeMap, Picture
from validate.report.maps import TOWARD_EYE, Range, bar_title, colours, values, words
from validate.report.renders import BAR, aim, shot, triangulated
from validate.scene.mesh import boundary_facets

_SIZE = (880, 620)
_EDGES = 6000  # facets above which their edges would hide the colours


def rendered(shown: NodeMap, span: Range) -> Picture:
    """The map on the undeformed surface, from a camera that only the mesh moves."""
    said = words(shown, span)
    return Picture(
        f"map_{shown.name}",
        said,
        "Render: " + said,
        shot(lambda p: _fill(p, shown, span), _SIZE),
        photo=True,
    )


def _fill(plotter: Any, shown: NodeMap, span: Range) -> None:
    facets = boundary_facets(shown.mesh.simplices, 3)
    surface = triangulated(1e3 * shown.mesh.nodes, facets)
    surface.point_data["value"] = values(shown)
    bar: Any = {**BAR, "title": f"{bar_title(shown)}\n", "position_x": 0.84, "fmt": "%.3g"}
    plotter.add_mesh(
        surface, scalars="value", cmap=colours(span), clim=span, ambient=0.6, diffuse=0.45,
        show_edges=len(facets) <= _EDGES, edge_color="#505050", line_width=0.5,
        scalar_bar_args=bar,
    )  # fmt: skip
    plotter.add_axes(color="black", viewport=(0.0, 0.0, 0.17, 0.24))
    points = np.asarray(surface.points)
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    aim(plotter, 0.5 * (low + high), TOWARD_EYE, np.array([0.0, 0.0, 1.0]), size, 0.52)
