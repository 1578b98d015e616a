"""Panels: one body at one instant with what was measured on it, by pyvista off screen.

Import only after `gl.available()`: vtk reads its window class when it is imported.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

from validate.arrays import Floats, Ints
from validate.compare.exhibit import NodeMap, Picture, Pixels
from validate.report.charts.style import MEASURED, PALETTE, draw
from validate.report.scenes.body import Camera, camera
from validate.report.scenes.body_scene import SeenMarkers
from validate.report.scenes.maps import Range, bar_title, colours, triad, values, words
from validate.scene.mesh import Mesh
from validate.scene.shape_functions import LATTICE, brick_values, simplex_values

# --- surface of a mesh as its elements bend, by their shape functions ----------------------------

_SMOOTH, _SIDES = 12_000, 6  # triangles of a smoothed surface, and most sides of one facet


@dataclass(frozen=True)
class Surface:
    """Facets (f, m) of a mesh, each drawn by triangles (t, 3) between points that the shape
    functions `weights` (p, m) place; `rim` (r,) runs along its edges."""

    facets: Ints
    weights: Floats
    triangles: Ints
    rim: Ints

    def at(self, x: Floats) -> Floats:
        """Return values (f p, ...) at the points for values (n, ...) at the nodes."""
        found = np.einsum("pm,fm...->fp...", self.weights, x[self.facets])
        return np.asarray(found.reshape(-1, *x.shape[1:]))

    def every(self, numbers: Ints) -> Ints:
        """Return point numbers (f, ...) of all facets for those (...) of one."""
        first = len(self.weights) * np.arange(len(self.facets))
        return np.asarray(np.add.outer(first, numbers))


def surface_of(mesh: Mesh) -> Surface:
    """Return the boundary of a body, or all cells of a planar mesh; the fewer facets that bend, the
    finer they are."""
    facets = mesh.surface if mesh.dimension == 3 else mesh.cells
    m = facets.shape[1]
    n = 1 if m == 3 else int(np.clip(np.sqrt(_SMOOTH / len(facets)), 1, _SIDES))
    places = [(i, j) for i in range(n + 1) for j in range(n + 1) if m in (4, 9) or i + j <= n]
    rim = [(s, 0) for s in range(n)]
    if m in (4, 9):
        weights = brick_values(np.array(places) / n, 1 if m == 4 else 2)
        rim += [(n, s) for s in range(n)] + [(n - s, n) for s in range(n)]
    else:
        L = np.array([(n - i - j, i, j) for i, j in places]) / n
        weights = simplex_values(1 if m == 3 else 2, L)
        rim += [(n - s, s) for s in range(n)]
    rim += [(0, n - s) for s in range(n + 1)]
    number = {place: k for k, place in enumerate(places)}
    squares = [[(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)] for i, j in places]
    halves = [half for a, b, c, d in squares for half in ((a, b, c), (b, d, c))]
    triangles = [[number[at] for at in half] for half in halves if set(half) <= set(number)]
    return Surface(facets, weights, np.array(triangles), np.array([number[at] for at in rim]))


# --- panels: one body at one instant with what was measured on it, by pyvista off screen ---------

_PIXELS = 480  # across a panel
_EDGES = 1500  # facets above which edges of elements would hide the colours
_OUTLINE = 60  # points of a measured outline
_MARKER = 0.011  # of the body's size: the radius of a marker
ERRORS = LinearSegmentedColormap.from_list("errors", ["#FFE0CC", PALETTE[1], "#4A1800"])
THROUGH = 0.25  # opacity of a body with particles in it
TOOL: Mapping[str, Any] = {"color": "#A9B0B7", "ambient": 0.3, "opacity": 0.4}
_SIMULATED = "#FF4FD8"  # of an outline: no colour of the body
_RIM: Mapping[str, Any] = {"color": "#202020", "line_width": 1, "opacity": 0.3}
_LINE_ART: Mapping[str, Any] = {"ambient": 0.7, "diffuse": 0.3}

# VTK_TETRA, _HEXAHEDRON, _QUADRATIC_TETRA (local order as ours), _TRIQUADRATIC_HEXAHEDRON.
_CELL = {4: 10, 8: 12, 10: 24, 27: 29}
# Twice the places of the nodes that VTK lists behind the corners of a quadratic hexahedron: middles
# of edges, then of faces, then of the cell.
_BEHIND = "100 210 120 010 102 212 122 012 001 201 221 021 011 211 101 121 110 112 111"


def vtk_order() -> list[int]:
    """Our local number of each node of a quadratic hexahedron as VTK lists them."""
    ours = (2 * LATTICE[3]).astype(int).tolist()
    behind = [ours.index([int(c) for c in place]) for place in _BEHIND.split()]
    return [*range(8), *behind]


class Stage:
    """A window that takes one picture after another, all with one camera."""

    def __init__(self, seen_by: Camera, size: float) -> None:
        half = 1.04 * seen_by.half
        half = np.maximum(half, half.max() * np.array([0.5, 0.3]))
        pixels = [_PIXELS, round(_PIXELS * half[1] / half[0])]
        plotter: Any = pv.Plotter
        self.plotter = plotter(off_screen=True, window_size=pixels, lighting="light kit")
        self.plotter.set_background("white")
        self.plotter.enable_anti_aliasing("msaa", multi_samples=4)
        at = self.plotter.camera
        at.focal_point = tuple(seen_by.middle)
        at.position = tuple(seen_by.middle + 5 * size * seen_by.away)
        at.up = tuple(seen_by.up)
        at.parallel_projection, at.parallel_scale = True, half[1]
        at.clipping_range = 0.1 * size, 20 * size

    def add(self, mesh: Any, **look: Any) -> None:
        if mesh.n_points:
            self.plotter.add_mesh(
                mesh, reset_camera=False, show_scalar_bar=False, render=False, **look
            )

    def shot(self) -> Pixels:
        """The picture (h, w, 3), after which the window is empty."""
        self.plotter.render_window.Render()
        taken = vtkWindowToImageFilter()  # the plotter's own way renders three times
        taken.SetInput(self.plotter.render_window)
        taken.ReadFrontBufferOff()
        taken.ShouldRerenderOff()
        taken.Update()
        image: Any = pv.wrap(taken.GetOutput())
        wide, high, _ = image.dimensions
        self.plotter.clear_actors()
        return np.array(image.active_scalars, dtype=np.uint8).reshape(high, wide, 3)[::-1]


@dataclass(frozen=True)
class RenderedBody:
    """What is drawn of a mesh: its surface, and where a plane (normal, point) opens it its cells
    (n, 3) mm at rest."""

    surface: Surface
    rest: Floats
    cells: Any = None
    plane: tuple[Floats, Floats] | None = None

    def add(
        self, stage: Stage, x: Floats, shown: Floats, span: Range, ramp: str, opacity: float = 1.0
    ) -> None:
        """Nodes at x (n, 3) mm in the colours of `shown` (n,)."""
        look = {"scalars": "value", "cmap": ramp, "clim": span, "ambient": 0.6, "diffuse": 0.45,
                "nan_color": "#C9CED3", "opacity": opacity}  # fmt: skip
        surface = self.surface
        triangles = surface.every(surface.triangles).reshape(-1, 3)
        outside = triangulated(surface.at(self.rest), triangles)
        rims = surface.every(surface.rim)
        lines = np.insert(rims, 0, rims.shape[1], axis=1).ravel()
        edges = pv.PolyData(outside.points, lines=lines)
        for one, how in ((outside, look), *([(edges, _RIM)] if len(rims) <= _EDGES else [])):
            one.point_data["value"], one.point_data["x"] = surface.at(shown), surface.at(x)
            self._moved(
                stage,
                one if self.plane is None else one.clip(normal=self.plane[0], origin=self.plane[1]),
                how,
            )
        if self.plane is not None:
            self.cells.point_data["value"], self.cells.point_data["x"] = shown, x
            self._moved(stage, self.cells.slice(normal=self.plane[0], origin=self.plane[1]), look)

    def _moved(self, stage: Stage, mesh: Any, look: Mapping[str, Any]) -> None:
        if mesh.n_points:
            mesh.points = np.asarray(mesh.point_data["x"])
            stage.add(mesh, **look)


def rendered_body(
    mesh: Mesh, rest: Floats, plane: tuple[Floats, Floats] | None = None
) -> RenderedBody:
    if plane is None:
        return RenderedBody(surface_of(mesh), rest)
    count = mesh.cells.shape[1]
    cells = mesh.cells[:, vtk_order()] if count == 27 else mesh.cells
    kinds = np.full(len(cells), _CELL[count], dtype=np.uint8)
    grid = pv.UnstructuredGrid(np.insert(cells, 0, count, axis=1).ravel(), kinds, rest)
    return RenderedBody(surface_of(mesh), rest, grid, plane)


def triangulated(nodes: Floats, triangles: Ints) -> Any:
    return pv.PolyData(nodes, np.insert(triangles, 0, 3, axis=1).ravel())


def add_markers(
    stage: Stage, seen: SeenMarkers, frame: int, size: float, by: float, top: float
) -> None:
    """Balls where markers were measured, arrows `by` times as long from where they are simulated,
    both in the colours of the error up to `top` mm."""
    error = seen.errors[frame]
    there = np.isfinite(error)
    measured, error = seen.measured[frame][there], error[there]
    if not len(measured):
        return
    radius = _MARKER * size * min(1.0, float(np.sqrt(60 / len(error))))
    look = {"scalars": "error", "cmap": ERRORS, "clim": (0.0, top), **_LINE_ART}
    points = pv.PolyData(measured)
    points.point_data["error"] = error
    ball = pv.Sphere(radius=radius, theta_resolution=14, phi_resolution=14)
    stage.add(points.glyph(geom=ball, scale=False, orient=False), **look)
    arrows = by * (measured - seen.simulated[frame][there])
    long = np.linalg.norm(arrows, axis=1) > 1.5 * radius
    if long.any():
        tails = pv.PolyData(measured[long] - arrows[long])
        tails.point_data["arrow"], tails.point_data["error"] = arrows[long], error[long]
        tails.point_data["length"] = np.linalg.norm(arrows[long], axis=1)
        slim = pv.Arrow(tip_radius=0.1, shaft_radius=0.04)
        stage.add(tails.glyph(geom=slim, scale="length", orient="arrow", factor=1.0), **look)


def add_outlines(stage: Stage, measured: Floats, simulated: Floats, size: float) -> None:
    ball = pv.Sphere(radius=0.0065 * size, theta_resolution=10, phi_resolution=10)
    points = pv.PolyData(measured[:: -(-len(measured) // _OUTLINE)])
    stage.add(points.glyph(geom=ball, scale=False, orient=False), color=MEASURED, **_LINE_ART)
    tube = pv.lines_from_points(simulated, close=True).tube(radius=0.004 * size)
    stage.add(tube, color=_SIMULATED, **_LINE_ART)


def add_probes(stage: Stage, places: Floats, size: float) -> None:
    diamond = pv.PlatonicSolid("octahedron", radius=0.009 * size)
    points = pv.PolyData(places)
    stage.add(points.glyph(geom=diamond, scale=False, orient=False), color="white", **_LINE_ART)


def rendered(shown: NodeMap, span: Range) -> Picture:
    """Return the map on the undeformed surface, from a camera that only the mesh moves."""
    nodes = 1e3 * shown.mesh.nodes
    size = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    seen_by = camera(nodes, np.array([0.0, 0.0, -1.0]), None, flat=False)
    stage = Stage(seen_by, size)
    rendered_body(shown.mesh, nodes).add(stage, nodes, values(shown), span, colours(span))
    panel, said = stage.shot(), words(shown, span)
    stage.plotter.close()

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        high, wide = panel.shape[:2]
        ax.imshow(panel, interpolation="lanczos", extent=(0, wide, 0, high))
        ax.set_axis_off()
        triad(ax, seen_by.away)
        bar = ScalarMappable(Normalize(*span), colours(span))
        figure.colorbar(bar, ax=ax, label=bar_title(shown), shrink=0.8)

    pixels = draw(paint, 5.6, 4.3)
    return Picture(f"map_{shown.name}", said, f"Render: {said}", pixels, photo=True)
