"""Off-screen renders of the simulated body and of nodal values, by pyvista.

Import only after `gl.available()`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyvista as pv

from validate.arrays import Floats, Ints
from validate.compare.exhibit import NodeMap, Picture, Pixels
from validate.report.charts.style import MEASURED, PALETTE
from validate.report.scenes.body import ShownBody, ShownIndenter
from validate.report.scenes.maps import TOWARD_EYE, Range, bar_title, colours, values, words
from validate.report.scenes.residual_arrows import rounded_down
from validate.report.scenes.skin import flat_triangles
from validate.report.views.numbers import significant
from validate.scene.contact import RigidCylinder, RigidPlane, RigidPunch, RigidSphere
from validate.scene.mesh import boundary_facets
from validate.scene.shape_functions import LATTICE

_IN_FRONT = (
    0.985  # the wall is drawn this much smaller than the hole it lines, to be seen before it
)
_SIZE, _MAP_SIZE = (880, 640), (880, 620)
_LONGEST, _MARKER = 0.12, 0.009  # of the body's size: the longest arrow, the radius of a marker
_MAP_EDGES = 6000  # facets of a map above which their edges would hide the colours
# VTK_TETRA, _HEXAHEDRON, _QUADRATIC_TETRA (local order as ours), _TRIQUADRATIC_HEXAHEDRON.
_CELL = {4: 10, 8: 12, 10: 24, 27: 29}
# Twice the places of the nodes that VTK lists behind the corners of a quadratic hexahedron: middles
# of edges, then of faces, then of the cell.
_BEHIND = "100 210 120 010 102 212 122 012 001 201 221 021 011 211 101 121 110 112 111"
BAR: dict[str, Any] = {
    "vertical": True,
    "height": 0.62,
    "width": 0.07,
    "position_y": 0.16,
    "title_font_size": 24,
    "label_font_size": 24,
    "color": "black",
    "n_labels": 5,
}


@dataclass(frozen=True)
class _View:
    """Displacements times `scale`, seen obliquely or flat, with element edges or without."""

    scale: float = 1.0
    oblique: bool = True
    edges: bool = False
    measured: bool = False  # whether markers and outline stand in the same scene


def renders(body: ShownBody) -> tuple[Picture, ...]:
    """The body deformed with what was measured on it, opened where it has a cavity; against the cut
    at rest and deformed; with element edges.

    Two of them for a whole body without plates. Markers of an opened body stand on the whole one.
    """
    wall = "" if body.pressure is None else (
        f" The cavity wall is coloured by the pressure, {body.pressure:.4g} Pa."
    )  # fmt: skip
    whole = body.normal is None
    plates = "; plates grey" if body.plates else ""
    plates += "; the rigid indenter in transparent grey" if body.indenters else ""
    opened = "whole" if whole else f"cut open through {body.cut}"
    cut = "" if whole else " at and behind the cut"
    flat = "from the side" if whole else "against the cut"
    deformed = (
        "render_deformed", f"{body.label} at {body.load}, {opened}, true to scale: displacement "
        f"magnitude in mm{plates}.{_outline_words(body)}{wall}{body.part}", _View(measured=True),
    )  # fmt: skip
    rest = (
        "render_rest", f"The same body at rest, seen {flat}, before any load (no displacement).",
        _View(scale=0.0, oblique=False),
    )  # fmt: skip
    across = (
        "render_flat", f"Seen {flat} at {body.load}: displacement magnitude in mm.{wall}",
        _View(oblique=False),
    )  # fmt: skip
    mesh = (
        "render_mesh", f"The mesh of {body.label} at {body.load}: {len(body.mesh.cells)} "
        f"elements, {len(body.mesh.nodes)} nodes; edges of the elements{cut}.", _View(edges=True),
    )  # fmt: skip
    # Else nothing shows how far it moved from rest.
    alone = whole and not (body.plates or body.indenters)
    shown = (deformed, mesh) if alone else (deformed, rest, across, mesh)
    pictures = tuple(_picture(name, words, body, view) for name, words, view in shown)
    if body.markers is None:
        return pictures
    words = (
        f"{body.label} at {body.load}, whole, true to scale: displacement magnitude in mm{plates}."
        f"{_marker_words(body)}{body.part}"
    )
    compared = replace(body, normal=None, cavity=None, outline=None, up=-body.toward)
    first = _picture("render_markers", words, compared, _View(measured=True))
    return first, *(pictures[1:] if whole else pictures)


def _marker_words(body: ShownBody) -> str:
    """The measured markers of the render in words, with the scale of their arrows."""
    assert body.markers is not None
    by, largest = _magnified(body), significant(body.markers.largest)
    scale = f"; arrows {by:g} times as long" if by > 1 else ""
    return (
        " Black: measured markers. Orange arrows point to them from their simulated place "
        f"(largest distance {largest} mm{scale})."
    )


def _outline_words(body: ShownBody) -> str:
    return " Black line: measured outline." if body.outline is not None else ""


def _magnified(body: ShownBody) -> float:
    """How much longer than to scale the arrows are: 1, 2, 5, 10, ..."""
    assert body.markers is not None
    size = float(np.linalg.norm(np.ptp(1e3 * body.mesh.nodes, axis=0)))
    longest = body.markers.largest
    return max(rounded_down(_LONGEST * size / longest), 1.0) if longest > 1e-9 * size else 1.0


def _add_measured(plotter: Any, body: ShownBody) -> None:
    """Markers with arrows, and the outline, in front of the body: what lies in it is seen too."""
    size = float(np.linalg.norm(np.ptp(1e3 * body.mesh.nodes, axis=0)))
    if body.outline is not None:
        line = pv.lines_from_points(body.outline, close=True)
        plotter.add_mesh(line.tube(radius=0.005 * size), color=MEASURED, ambient=0.5)
    if body.markers is None or body.normal is not None:
        return  # those on the part that was taken away would hang in the air
    found, by = body.markers, _magnified(body)
    radius = _MARKER * size * min(1.0, float(np.sqrt(60 / len(found.measured))))
    ball = pv.Sphere(radius=radius, theta_resolution=16, phi_resolution=16)
    points = pv.PolyData(found.measured)
    plotter.add_mesh(
        points.glyph(geom=ball, scale=False, orient=False), color=MEASURED, ambient=0.3
    )
    arrows = by * (found.measured - found.simulated)
    lengths = np.linalg.norm(arrows, axis=1)
    if (lengths > 2 * radius).any():
        long = lengths > 2 * radius
        tails = pv.PolyData(found.measured[long] - arrows[long])
        tails.point_data["arrow"], tails.point_data["length"] = arrows[long], lengths[long]
        slim = pv.Arrow(tip_radius=0.09, shaft_radius=0.035)
        plotter.add_mesh(
            tails.glyph(geom=slim, scale="length", orient="arrow", factor=1.0), color=PALETTE[1],
            ambient=0.4,
        )  # fmt: skip


def _picture(name: str, words: str, body: ShownBody, view: _View) -> Picture:
    pixels = shot(lambda plotter: _fill(plotter, body, view), _SIZE)
    return Picture(name, words, "Render: " + words, pixels, photo=True)


def shot(fill: Callable[[Any], None], size: tuple[int, int]) -> Pixels:
    """Pixels (h, w, 3) of a plotter of size (w, h) that `fill` fills and aims."""
    plotter: Any = pv.Plotter(off_screen=True, window_size=list(size), lighting="light kit")
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    fill(plotter)
    pixels = np.asarray(plotter.screenshot(return_img=True), dtype=np.uint8)
    plotter.close()
    return pixels[..., :3].copy()


def aim(plotter: Any, middle: Floats, away: Floats, up: Floats, size: float, scale: float) -> None:
    """A camera without perspective on `middle` from the direction `away`; `scale` of `size` fills
    half the height."""
    plotter.camera.focal_point = tuple(middle)
    plotter.camera.position = tuple(middle + 3 * size * away / np.linalg.norm(away))
    plotter.camera.up = tuple(up)
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = scale * size
    plotter.camera.clipping_range = (0.1 * size, 10 * size)


def triangulated(nodes: Floats, triangles: Ints) -> Any:
    """Triangles (t, 3) between nodes (n, 3) as pyvista has them."""
    return pv.PolyData(nodes, np.hstack([np.full((len(triangles), 1), 3), triangles]).ravel())


def _fill(plotter: Any, body: ShownBody, view: _View) -> None:
    _add_body(plotter, body, view.scale, view.edges)
    if view.measured:
        _add_measured(plotter, body)
    _add_wall(plotter, body, view.scale, view.edges)
    for plate in body.plates:
        x, y, z = plate.sizes
        box = pv.Cube(center=plate.centre + view.scale * plate.shift, x_length=x, y_length=y,
                      z_length=z)  # fmt: skip
        if body.normal is not None:
            box = box.clip(normal=body.normal, origin=body.origin)
        plotter.add_mesh(box, color="#A9B0B7", ambient=0.3)
    for indenter in body.indenters:
        solid = drawn_indenter(indenter)
        solid.points = np.asarray(solid.points) + view.scale * indenter.shift
        plotter.add_mesh(solid, color="#A9B0B7", ambient=0.3, opacity=0.45)
    _aim(plotter, body, view.oblique)


def drawn_indenter(part: ShownIndenter) -> Any:
    """Return its surface in mm, at rest; a plane and a bar are as long as what they may touch, a
    punch as its radius."""
    shape, long = part.shape, 1.2 * float(np.linalg.norm(part.extent))
    if isinstance(shape, RigidSphere):
        return pv.Sphere(radius=1e3 * shape.radius, center=1e3 * np.array(shape.centre),
                         theta_resolution=60, phi_resolution=60)  # fmt: skip
    if isinstance(shape, RigidCylinder):
        axis = np.array(shape.axis) / np.linalg.norm(shape.axis)
        return pv.Cylinder(center=1e3 * np.array(shape.point), direction=axis,
                           radius=1e3 * shape.radius,
                           height=1.2 * float(np.abs(axis) @ part.extent))  # fmt: skip
    if isinstance(shape, RigidPunch):
        at, radius, thick = shape.centre, 1e3 * shape.radius, 1e3 * shape.radius
    elif isinstance(shape, RigidPlane):
        at, radius, thick = shape.point, long / 2, 0.05 * long
    else:
        raise TypeError(
            f"a {type(shape).__name__} cannot be drawn; expected a rigid shape of scenes"
        )
    normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
    return pv.Cylinder(center=1e3 * np.array(at) - 0.5 * thick * normal, direction=normal,
                       radius=radius, height=thick)  # fmt: skip


def vtk_order() -> list[int]:
    """Our local number of each node of a quadratic hexahedron as VTK lists them."""
    ours = (2 * LATTICE[3]).astype(int).tolist()
    behind = [ours.index([int(c) for c in place]) for place in _BEHIND.split()]
    return [*range(8), *behind]


def _add_body(plotter: Any, body: ShownBody, scale: float, edges: bool) -> None:
    count = body.mesh.cells.shape[1]
    cells = body.mesh.cells[:, vtk_order()] if count == 27 else body.mesh.cells
    packed = np.hstack([np.full((len(cells), 1), count), cells]).ravel()
    kinds = np.full(len(body.mesh.cells), _CELL[count], dtype=np.uint8)
    grid = pv.UnstructuredGrid(packed, kinds, 1e3 * body.mesh.nodes)
    grid.point_data["u"] = body.u
    if body.normal is not None:
        grid = grid.clip(normal=body.normal, origin=body.origin, crinkle=edges)
    moved = np.asarray(grid.point_data["u"])
    grid.points = np.asarray(grid.points) + scale * moved
    if scale == 0:
        plotter.add_mesh(grid, color="#DCC9A3", ambient=0.3)
        return
    grid.point_data["displacement"] = np.linalg.norm(moved, axis=1)
    top = max(float(np.linalg.norm(body.u, axis=1).max()), 1e-9)
    bar: Any = {**BAR, "title": "u / mm\n", "position_x": 0.84, "fmt": _decimals(top)}
    plotter.add_mesh(
        grid, scalars="displacement", cmap="viridis", clim=(0.0, top), show_edges=edges,
        edge_color="#303030", line_width=1, ambient=0.3, scalar_bar_args=bar,
    )  # fmt: skip


def _decimals(top: float) -> str:
    """Two significant digits of the bar's upper end."""
    return f"%.{max(1, 1 - int(np.floor(np.log10(top))))}f" if top > 1e-5 else "%.1e"


def _add_wall(plotter: Any, body: ShownBody, scale: float, edges: bool) -> None:
    if body.cavity is None:
        return
    facets = body.mesh.facets[body.cavity]
    triangles = flat_triangles(facets)
    nodes = 1e3 * body.mesh.nodes
    if edges and body.normal is not None:  # whole triangles, as the elements beside them
        below = (nodes - body.origin) @ body.normal < 0
        triangles = triangles[below[triangles].any(axis=1)]
    wall = triangulated(nodes, triangles)
    wall.point_data["u"] = body.u
    if body.normal is not None and not edges:
        wall = wall.clip(normal=body.normal, origin=body.origin)
    moved = np.asarray(wall.points) + scale * np.asarray(wall.point_data["u"])
    centre = body.origin + scale * body.u[np.unique(triangles)].mean(axis=0)
    wall.points = centre + _IN_FRONT * (moved - centre)
    if scale == 0 or body.pressure is None:
        plotter.add_mesh(wall, color="#B98B5E", ambient=0.3)
        return
    wall.point_data["pressure"] = np.full(wall.n_points, body.pressure)
    bar: Any = {**BAR, "title": "p / Pa\n", "position_x": 0.03, "fmt": "%.0f"}
    plotter.add_mesh(
        wall,
        scalars="pressure",
        cmap="Oranges",
        clim=body.pressures,
        scalar_bar_args=bar,
        ambient=0.45,
    )


def _aim(plotter: Any, body: ShownBody, oblique: bool) -> None:
    """A camera fixed by the body at rest, so that a wrong size shows.

    Without plates to see it by, the deformed body is kept in the picture.
    """
    nodes = 1e3 * body.mesh.nodes
    if body.normal is None and not body.plates:
        nodes = np.vstack([nodes, nodes + body.u])
    if body.normal is None and body.markers is not None:
        nodes = np.vstack([nodes, body.markers.measured])
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    up, along = body.up, -body.toward
    if abs(float(up @ along)) > 0.9:
        along = np.roll(up, 1)
    side = np.cross(along, up)
    opened = body.normal is not None
    flat, flat_up = (up, -side) if opened else (side, up)
    above = (0.95, 0.9, 0.3) if opened else (0.45, 1.0, 0.55)
    away = above[0] * up + above[1] * side + above[2] * along if oblique else flat
    drop = 0.16 * size if oblique and opened else 0.0  # the upper half is gone
    scale = 0.42 if not oblique else 0.47 if opened else 0.56
    aim(plotter, middle - drop * up, away, up if oblique else flat_up, size, scale)


# --- numbers at the nodes -------------------------------------------------------------------------


def rendered(shown: NodeMap, span: Range) -> Picture:
    """Return the map on the undeformed surface, from a camera that only the mesh moves."""
    said = words(shown, span)
    return Picture(
        f"map_{shown.name}",
        said,
        "Render: " + said,
        shot(lambda p: _fill_map(p, shown, span), _MAP_SIZE),
        photo=True,
    )


def _fill_map(plotter: Any, shown: NodeMap, span: Range) -> None:
    facets = boundary_facets(shown.mesh.simplices, 3)
    surface = triangulated(1e3 * shown.mesh.nodes, facets)
    surface.point_data["value"] = values(shown)
    bar: Any = {**BAR, "title": f"{bar_title(shown)}\n", "position_x": 0.84, "fmt": "%.3g"}
    plotter.add_mesh(
        surface, scalars="value", cmap=colours(span), clim=span, ambient=0.6, diffuse=0.45,
        show_edges=len(facets) <= _MAP_EDGES, edge_color="#505050", line_width=0.5,
        scalar_bar_args=bar,
    )  # fmt: skip
    plotter.add_axes(color="black", viewport=(0.0, 0.0, 0.17, 0.24))
    points = np.asarray(surface.points)
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    aim(plotter, 0.5 * (low + high), TOWARD_EYE, np.array([0.0, 0.0, 1.0]), size, 0.52)
