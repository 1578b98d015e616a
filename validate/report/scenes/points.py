"""Figures of points, a path and small errors, and of sets of nodes, in space."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Picture
from validate.report.charts.style import ACCEPTED, MEASURED, PALETTE, WIDTH, draw
from validate.report.scenes.maps import TOWARD_EYE, facing, screen, triad
from validate.scene.mesh import Mesh

_PATH = "#9E9E9E"
_ROOM = 0.3  # of the places' extent: what of the path lies further off is not drawn


def points_picture(
    name: str,
    caption: str,
    path: Floats,
    parts: Sequence[Floats],
    labels: Sequence[str],
    at: Floats,
    errors: Floats,
    longer: float,
) -> Picture:
    """Return a path (n, 3) mm, its parts, and named places (k, 3) mm, from which errors (k, 3) mm
    are drawn `longer` times as long as they are."""
    pixels = draw(lambda f: _fill(f, path, parts, labels, at, longer * errors), WIDTH + 0.8, WIDTH)
    alt = f"Path of {len(path)} samples in space with {len(parts)} dwells and {len(at)} points."
    return Picture(name, caption, alt, pixels)


def _fill(
    figure: Figure, path: Floats, parts: Sequence[Floats], labels: Sequence[str], at: Floats,
    arrows: Floats,
) -> None:  # fmt: skip
    ax: Any = figure.add_subplot(projection="3d")
    low, high = at.min(axis=0), at.max(axis=0)
    room = _ROOM * float((high - low).max())
    path, *parts = (_inside(x, low - room, high + room) for x in (path, *parts))
    ax.plot(*path.T, color=_PATH, linewidth=0.5, label="path of the tip")
    for i, part in enumerate(parts):
        label = "dwell" if i == 0 else None
        ax.plot(*part.T, ".", color=PALETTE[4], markersize=2.5, label=label)
    ax.plot(*at.T, "o", color=ACCEPTED, markersize=5, label="landmark, touched")
    ax.quiver(
        *at.T,
        *arrows.T,
        color=PALETTE[1],
        linewidth=1.5,
        label="to the position predicted by the others",
    )
    for label, place in zip(labels, at, strict=True):
        ax.text(*place, f"  {label}", fontsize=9)
    ax.set(xlabel="x / mm", ylabel="y / mm", zlabel="z / mm")
    ax.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    ax.set(zlim=(low[2] - room, high[2] + room))
    ax.set_box_aspect(high - low + 2 * room, zoom=0.85)
    ax.locator_params(nbins=5)
    ax.view_init(elev=22, azim=-52)
    figure.legend(loc="outside lower center", ncols=2)


def _inside(x: Floats, low: Floats, high: Floats) -> Floats:
    """Samples (n, 3), NaN where they lie outside a box."""
    inside = np.asarray((x >= low) & (x <= high)).all(axis=1)
    return np.where(np.reshape(inside, (-1, 1)), x, np.nan)


# --- figure of supports, loads and probes: the body's surface from two corners -------------------

_MM = 1e3
_BELOW = np.array([-0.62, -1.0, -0.62]) / np.linalg.norm([0.62, 1.0, 0.62])
_VIEWS = (("from above (+x −y +z)", TOWARD_EYE), ("from below (−x −y −z)", _BELOW))
_LOOKS = ((MEASURED, "o"), (PALETTE[1], "s"), (PALETTE[0], "^"), (PALETTE[2], "D"))


def node_sets_picture(
    name: str, caption: str, mesh: Mesh, sets: Mapping[str, Ints], named: Mapping[str, int]
) -> Picture:
    """Return sets of nodes (k,) by what they are, up to four, and single nodes by name, on a body.

    A node is drawn in a view where a facet that faces it has the node: those on the far side are in
    the other view, those inside the body in none.
    """
    pixels = draw(lambda f: _fill_sets(f, mesh, sets, named), WIDTH + 1.6, 4.0)
    counts = ", ".join(f"{len(nodes)} {label}" for label, nodes in sets.items())
    alt = f"Surface from two corners: nodes {counts}; {', '.join(named)} by name."
    return Picture(name, caption, alt, pixels)


def _fill_sets(
    figure: Figure, mesh: Mesh, sets: Mapping[str, Ints], named: Mapping[str, int]
) -> None:
    axes: Any = figure.subplots(1, len(_VIEWS))
    for ax, (title, eye) in zip(axes, _VIEWS, strict=True):
        polygons, facets = facing(mesh, eye)
        # Greys (f, 3): the lighter the more a facet looks at the eye
        x = mesh.nodes[facets]
        normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        light = 0.66 + 0.28 * (normals @ eye) / np.linalg.norm(normals, axis=1)
        greys = [(v, v, v) for v in light.tolist()]
        ax.add_collection(
            PolyCollection(list(polygons), facecolors=greys, edgecolors="#30303040", linewidths=0.3)
        )
        at = _MM * mesh.nodes @ np.stack(screen(eye), axis=1)
        for (label, nodes), (colour, point) in zip(sets.items(), _LOOKS, strict=False):
            seen = np.intersect1d(nodes, facets)
            ax.plot(*at[seen].T, point, color=colour, markersize=3.2, linestyle="", label=label)
        for label, node in named.items():
            if node in facets:
                ax.plot(*at[node], "*", color="white", markeredgecolor=MEASURED, markersize=13)
                ax.annotate(label, tuple(at[node]), xytext=(7, 6), textcoords="offset points",
                            weight="bold", bbox={"fc": "white", "ec": "none",
                                                 "pad": 1})  # fmt: skip
        ax.autoscale_view()
        ax.margins(0.06, 0.22)  # room below for the triad
        ax.set_aspect("equal")
        ax.set_axis_off()
        triad(ax, eye)
        ax.set_title(title)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
