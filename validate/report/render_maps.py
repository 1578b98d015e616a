"""Off-screen renders of numbers at the nodes by pyvista. Import only after `gl.available()`."""

from typing import Any

import numpy as np
import pyvista as pv

from validate.compare.exhibit import NodeMap, Picture, Pixels
from validate.report.maps import TOWARD_EYE, Range, bar_title, colours, values, words
from validate.report.renders import BAR
from validate.scene.mesh import boundary_facets

_SIZE = [960, 660]
_EDGES = 6000  # facets above which their edges would hide the colours


def rendered(shown: NodeMap, span: Range) -> Picture:
    """The map on the undeformed surface, from a camera that only the mesh moves."""
    said = words(shown, span)
    return Picture(f"map_{shown.name}", said, "Render: " + said, _shot(shown, span), photo=True)


def _shot(shown: NodeMap, span: Range) -> Pixels:
    plotter: Any = pv.Plotter(off_screen=True, window_size=_SIZE, lighting="light kit")
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    facets = boundary_facets(shown.mesh.simplices, 3)
    faces = np.hstack([np.full((len(facets), 1), 3), facets]).ravel()
    surface = pv.PolyData(1e3 * shown.mesh.nodes, faces)
    surface.point_data["value"] = values(shown)
    bar: Any = {**BAR, "title": f"{bar_title(shown)}\n", "position_x": 0.88, "fmt": "%.3g"}
    plotter.add_mesh(
        surface, scalars="value", cmap=colours(span), clim=span, ambient=0.6, diffuse=0.45,
        show_edges=len(facets) <= _EDGES, edge_color="#505050", line_width=0.5,
        scalar_bar_args=bar,
    )  # fmt: skip
    plotter.add_axes(color="black", viewport=(0.0, 0.0, 0.17, 0.24))
    _aim(plotter, surface)
    pixels = np.asarray(plotter.screenshot(return_img=True), dtype=np.uint8)
    plotter.close()
    return pixels[..., :3].copy()


def _aim(plotter: Any, surface: Any) -> None:
    points = np.asarray(surface.points)
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    plotter.camera.focal_point = tuple(middle)
    plotter.camera.position = tuple(middle + 3 * size * TOWARD_EYE)
    plotter.camera.up = (0.0, 0.0, 1.0)
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = 0.52 * size
    plotter.camera.clipping_range = (0.1 * size, 10 * size)
