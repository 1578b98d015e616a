"""Report section of the simulated body: rendered where OpenGL is available, else drawn."""

from dataclasses import replace

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Exhibit, NodeMap, Picture
from validate.compare.result import Result
from validate.report.charts.style import WIDTH, draw
from validate.report.scenes import gl
from validate.report.scenes.body import ShownBody, shown_body
from validate.report.scenes.maps import drawn, ranges

_TITLE = "The simulated body"
_M, _MM = 1e-3, 1e3


def body(result: Result) -> Exhibit | None:
    """Render of the accepted method at the last load; None when there is no 3-D body."""
    shown = shown_body(result)
    if shown is None:
        return None
    if not gl.available():
        return Exhibit("body", _TITLE, (gl.HOW_TO_GET,), pictures=(_without_gl(shown),))
    from validate.report.scenes.renders import renders  # vtk reads its window class when imported

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


# --- the opened body by matplotlib ----------------------------------------------------------------


def cut(body: ShownBody, normal: Floats) -> Picture:
    """Displacement magnitude where the plane across `normal` opens the body, deformed, mm."""
    pressure = "" if body.pressure is None else f" Cavity pressure {body.pressure:.4g} Pa."
    words = (
        f"{body.label} at {body.load}: cut through {body.cut}, deformed true to scale, coloured by "
        f"the displacement magnitude in mm.{pressure}{body.part}"
    )
    pixels = draw(lambda f: _axes(f, body, normal), WIDTH, 5.0)
    return Picture("cut", words, "Section: " + words, pixels, photo=True)


def _axes(figure: Figure, body: ShownBody, normal: Floats) -> None:
    polygons, size = _polygons(body, normal)
    ax = figure.subplots()
    drawn = PolyCollection(
        polygons, array=size, cmap="viridis", edgecolors="#30303055", linewidths=0.3
    )
    top = float(np.linalg.norm(body.u, axis=1).max())
    drawn.set_clim(0.0, max(top, 1e-9))
    ax.add_collection(drawn)
    points = np.vstack(polygons)
    pad = 0.06 * np.ptp(points, axis=0).max()
    ax.set_xlim(points[:, 0].min() - pad, points[:, 0].max() + pad)
    ax.set_ylim(points[:, 1].min() - pad, points[:, 1].max() + pad)
    right, upward = ("xyz"[int(np.argmax(np.abs(a)))] for a in _screen(body, normal))
    ax.set(xlabel=f"{right} / mm", ylabel=f"{upward} / mm", aspect="equal")
    figure.colorbar(drawn, ax=ax, label="displacement / mm")
    if body.pressure is not None:
        ax.set_title(f"cavity pressure {body.pressure:.0f} Pa")


def _screen(body: ShownBody, normal: Floats) -> tuple[Floats, Floats]:
    """Directions to the right and upward on paper, seen along -normal."""
    return np.abs(body.toward), np.abs(np.cross(normal, body.toward))


def _polygons(body: ShownBody, normal: Floats) -> tuple[list[Floats], Floats]:
    """Polygons where the plane cuts the cells, and the mean displacement in each, mm."""
    nodes, u = _MM * body.mesh.nodes, body.u
    height = (nodes - body.origin) @ normal
    height = np.where(np.abs(height) < 1e-9, 1e-9, height)
    corners = body.mesh.simplices
    sides = height[corners] > 0
    crossed = corners[sides.any(axis=1) & ~sides.all(axis=1)]
    right, upward = _screen(body, normal)
    polygons, size = [], []
    for cell in crossed:
        points, moved = _crossing(cell, height, nodes, u)
        flat = np.stack([(points + moved) @ right, (points + moved) @ upward], axis=1)
        away = flat - flat.mean(axis=0)
        polygons.append(flat[np.argsort(np.arctan2(away[:, 1], away[:, 0]))])
        size.append(np.linalg.norm(moved, axis=1).mean())
    return polygons, np.array(size)


def _crossing(cell: Ints, height: Floats, nodes: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Points and displacements where the edges of one tetrahedron pass the plane."""
    i, j = np.array([(a, b) for n, a in enumerate(cell) for b in cell[n + 1 :]]).T
    passing = (height[i] > 0) != (height[j] > 0)
    i, j = i[passing], j[passing]
    s = (height[i] / (height[i] - height[j]))[:, None]
    return nodes[i] + s * (nodes[j] - nodes[i]), u[i] + s * (u[j] - u[i])
