"""Picture of a tip's path in space, where it stood, and errors of named places."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Picture
from validate.report.charts.style import drawn_picture

_PATH, _DWELL, _PLACE, _ERROR = "#9E9E9E", "#E69F00", "#0072B2", "#D55E00"
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
    low, high = at.min(axis=0), at.max(axis=0)
    room = _ROOM * float((high - low).max())

    def inside(x: Floats) -> Floats:
        """Samples (n, 3), NaN where they lie outside the drawn box."""
        kept = np.asarray((x >= low - room) & (x <= high + room)).all(axis=1)
        return np.where(np.reshape(kept, (-1, 1)), x, np.nan)

    def paint(figure: Figure) -> None:
        ax: Any = figure.add_subplot(projection="3d")
        ax.plot(*inside(path).T, color=_PATH, linewidth=0.5, label="path of the tip")
        for i, part in enumerate(parts):
            label = "dwell" if i == 0 else None
            ax.plot(*inside(part).T, ".", color=_DWELL, markersize=2.5, label=label)
        ax.plot(*at.T, "o", color=_PLACE, markersize=5, label="landmark, touched")
        ax.quiver(
            *at.T, *(longer * errors).T, color=_ERROR, linewidth=1.5,
            label="to the position predicted by the others",
        )  # fmt: skip
        for label, place in zip(labels, at, strict=True):
            ax.text(*place, f"  {label}", fontsize=9)
        ax.set(xlabel="x / mm", ylabel="y / mm", zlabel="z / mm")
        ax.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
        ax.set(zlim=(low[2] - room, high[2] + room))
        ax.set_box_aspect(high - low + 2 * room, zoom=0.85)
        ax.locator_params(nbins=5)
        ax.view_init(elev=22, azim=-52)
        figure.legend(loc="outside lower center", ncols=2)

    alt = f"Path of {len(path)} samples in space with {len(parts)} dwells and {len(at)} points."
    return drawn_picture(name, caption, alt, paint, (6.4, 5.6))
