"""Nodal maps: common ranges and, for machines that cannot render, flat drawings."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from validate.arrays import Floats, Ints
from validate.compare.exhibit import NodeMap, Picture
from validate.numbers import scale, shown_unit
from validate.report.charts.style import WIDTH, draw
from validate.scene.mesh import Mesh, boundary_facets

Range = tuple[float, float]
_MM = 1e3
_FAINT = 0.2  # of the largest of a scale
_SHORT = 0.1  # of an axis: what of it is seen when it points at the eye
# Every map is seen from the corner of +x, -y and +z, z upward on paper: its triad says so.
TOWARD_EYE = np.array([0.62, -1.0, 0.62]) / np.linalg.norm([0.62, -1.0, 0.62])


def values(shown: NodeMap) -> Floats:
    """Return the numbers (n,) in the unit that readers see."""
    return scale(shown.unit) * shown.values


def legible(maps: Iterable[NodeMap]) -> tuple[NodeMap, ...]:
    """Return the maps; one too faint to be read in the colours of its scale has colours of its
    own."""
    shown = tuple(maps)
    largest: dict[str, float] = {}
    for m in shown:
        largest[m.scale] = max(largest.get(m.scale, 0.0), _top(m))
    found = []
    for m in shown:
        if m.scale and _top(m) < _FAINT * largest[m.scale]:
            far = f"separate colour scale, far below the largest of {m.scale}"
            found.append(replace(m, title=f"{m.title.removesuffix('.')} ({far})", scale=""))
        else:
            found.append(m)
    return tuple(found)


def _top(shown: NodeMap) -> float:
    return float(np.abs(values(shown)).max())


def ranges(maps: Iterable[NodeMap]) -> dict[str, Range]:
    """Return the colour range of every scale, in the unit shown; of two signs, symmetric about
    zero."""
    found: dict[str, Range] = {}
    for one in maps:
        key, v = one.scale or one.name, values(one)
        low, high = found.get(key, (np.inf, -np.inf))
        found[key] = (min(low, float(v.min())), max(high, float(v.max())))
    return {key: _round(*span) for key, span in found.items()}


def _round(low: float, high: float) -> Range:
    if low < 0 < high:
        top = max(-low, high)
        return -top, top
    low = 0.0 if 0 <= low < 0.5 * high else low
    return (low, high) if high > low else (low, low + (abs(low) or 1.0))


def colours(span: Range) -> str:
    """Blue through white to red about zero, else viridis."""
    return "RdBu_r" if span[0] < 0 < span[1] else "viridis"


def words(shown: NodeMap, span: Range) -> str:
    """Return the caption: what, its unit, its extremes and what the colours span."""
    v, unit = values(shown), shown_unit(shown.unit) or "no unit"
    common = f" Colours as in the other maps of {shown.scale}." if shown.scale else ""
    title = shown.title.removesuffix(".")
    return (
        f"{title}, {unit}: {v.min():.3g} to {v.max():.3g} at {len(v)} nodes, on "
        f"{shown.surface}; colours from {span[0]:.3g} to {span[1]:.3g}.{common}"
    ).replace(" -", " −")


def bar_title(shown: NodeMap) -> str:
    return shown_unit(shown.unit) or "no unit"


def drawn(shown: NodeMap, span: Range) -> Picture:
    """Return the map by matplotlib: a planar mesh as it is, a body's surface seen from one
    corner."""
    pixels = draw(lambda f: _axes(f, shown, span), WIDTH, 4.3)
    said = words(shown, span)
    return Picture(f"map_{shown.name}", said, "Map: " + said, pixels, photo=True)


def _axes(figure: Figure, shown: NodeMap, span: Range) -> None:
    ax, solid = figure.subplots(), shown.mesh.dimension == 3
    polygons, facets = (facing if solid else _planar)(shown.mesh)
    face = PolyCollection(
        list(polygons), array=values(shown)[facets].mean(axis=1), cmap=colours(span),
        edgecolors="#30303055", linewidths=0.3,
    )  # fmt: skip
    face.set_clim(*span)
    ax.add_collection(face)
    ax.autoscale_view()
    ax.margins(0.04)
    ax.set_aspect("equal")
    if solid:
        ax.set_axis_off()
        triad(ax)
    else:
        ax.set(xlabel="x / mm", ylabel="y / mm")
    figure.colorbar(face, ax=ax, label=bar_title(shown), shrink=0.8)


def _planar(mesh: Mesh) -> tuple[Floats, Ints]:
    return _MM * mesh.nodes[mesh.corners], mesh.corners


def screen(eye: Floats = TOWARD_EYE) -> tuple[Floats, Floats]:
    """Directions (3,) to the right and upward on paper, seen from `eye` (3,), a unit vector."""
    right = np.cross([0.0, 0.0, 1.0], eye)
    right /= np.linalg.norm(right)
    return right, np.cross(eye, right)


def facing(mesh: Mesh, eye: Floats = TOWARD_EYE) -> tuple[Floats, Ints]:
    """Facets that face the eye as polygons (f, 3, 2) mm, from the far ones to the near ones."""
    facets = boundary_facets(mesh.corners, 3)
    points = _MM * mesh.nodes[facets]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    towards = normals @ eye > 0
    points, facets = points[towards], facets[towards]
    order = np.argsort((points @ eye).mean(axis=1))
    right, upward = screen(eye)
    return np.stack([points @ right, points @ upward], axis=2)[order], facets[order]


def triad(ax: Axes, eye: Floats = TOWARD_EYE) -> None:
    """The directions of x, y and z, in the lower left corner."""
    low, high = np.array(ax.get_xlim()), np.array(ax.get_ylim())
    axes = np.stack(screen(eye), axis=1)
    size = 0.07 * max(np.ptp(low), np.ptp(high))
    start = np.array([low[0], high[0] - 1.35 * size * axes[:, 1].min()])  # all within the axes
    for name, axis in zip("xyz", axes, strict=True):
        if np.hypot(*axis) < _SHORT:
            continue
        tip, beyond = start + size * axis, start + 1.35 * size * axis
        arrow = {"arrowstyle": "->", "color": "#404040"}
        ax.annotate("", tuple(tip), tuple(start), arrowprops=arrow, annotation_clip=False)
        ax.annotate(name, tuple(beyond), ha="center", va="center", color="#404040",
                    annotation_clip=False)  # fmt: skip
