"""Picture of node sets: the body's surface from two corners, with the nodes of each side."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from validate.arrays import Floats, Ints
from validate.compare.exhibit import Picture
from validate.report.charts.style import drawn_picture
from validate.scene.mesh import Mesh

_MM = 1e3
_VIEWS = (("from above (+x −y +z)", 32.0, -58.0), ("from below (−x −y −z)", -32.0, -122.0))
_LOOKS = (("#000000", "o"), ("#D55E00", "s"), ("#0072B2", "^"), ("#009E73", "D"))


def node_sets_picture(
    name: str, caption: str, mesh: Mesh, sets: Mapping[str, Ints], named: Mapping[str, int]
) -> Picture:
    """Return sets of nodes (k,) by what they are, up to four, and single nodes by name, on a body.

    A node is drawn in a view where a facet that faces it has the node: those on the far side are in
    the other view, those inside the body in none.
    """
    counts = ", ".join(f"{len(nodes)} {label}" for label, nodes in sets.items())
    alt = f"Surface from two corners: nodes {counts}; {', '.join(named)} by name."
    return drawn_picture(name, caption, alt, lambda f: paint_sets(f, mesh, sets, named), (7.4, 3.9))


def paint_sets(
    figure: Figure, mesh: Mesh, sets: Mapping[str, Ints], named: Mapping[str, int]
) -> None:
    """Fill a figure with both views."""
    form = {"projection": "3d", "proj_type": "ortho", "computed_zorder": False}
    axes: Any = figure.subplots(1, len(_VIEWS), subplot_kw=form)
    for ax, (title, elevation, azimuth) in zip(axes, _VIEWS, strict=True):
        ax.view_init(elev=elevation, azim=azimuth)
        up, around = np.deg2rad([elevation, azimuth])
        eye = [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
        _draw_view(ax, mesh, np.array(eye), sets, named)
        ax.set_title(title, y=1.04)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))


def _draw_view(
    ax: Any, mesh: Mesh, eye: Floats, sets: Mapping[str, Ints], named: Mapping[str, int]
) -> None:
    """Draw the facets that face the eye, the lighter the more they do, and their nodes."""
    x = _MM * mesh.nodes
    corners = x[mesh.surface[:, :3]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    light = normals @ eye / np.linalg.norm(normals, axis=1)
    facing = mesh.surface[light > 0]
    grey = 0.66 + 0.28 * light[light > 0]
    ax.add_collection3d(
        Poly3DCollection(
            corners[light > 0], facecolors=[(v, v, v) for v in grey.tolist()],
            edgecolors="#30303040", linewidths=0.3, zorder=1,
        )
    )  # fmt: skip
    for (label, nodes), (colour, point) in zip(sets.items(), _LOOKS, strict=False):
        seen = x[np.intersect1d(nodes, facing)]
        ax.plot(*seen.T, point, color=colour, markersize=3.2, label=label, zorder=2)
    for label, node in named.items():
        if node in facing:
            ax.plot(*x[[node]].T, "*", color="white", markeredgecolor="#000000", markersize=13,
                    zorder=3)  # fmt: skip
            ax.text(*x[node], f"   {label}", weight="bold", zorder=4)
    low, high = x.min(axis=0), x.max(axis=0)
    ax.set(xlabel="x / mm", ylabel="y / mm")
    ax.set_zlabel("z / mm", labelpad=18)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low, zoom=0.85)
    ax.locator_params(nbins=3)
