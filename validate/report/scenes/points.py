"""Figures of points, a path and small errors in space."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Picture
from validate.report.charts.style import ACCEPTED, PALETTE, WIDTH, draw

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
