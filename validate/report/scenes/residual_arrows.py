"""Registration residual at every marker as an arrow, magnified to the available space."""

import numpy as np
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Picture
from validate.numbers import with_unit
from validate.register.markers.quality import Registration
from validate.report.charts.style import MEASURED, WIDTH, draw
from validate.report.scenes.body import flattest

_MM = 1e3
_NAMED = 60  # markers; the names of more would hide each other
_LONGEST = 0.12  # of the picture: the longest arrow
_NARROWEST = 0.45  # of the longer side: markers on a line have some room across it
_NEAR = 0.07  # of the longer side: markers so near share one name
_EXACT = 1e-9  # of the longer side: no residual but rounding


def residual_arrows(found: Registration) -> Picture:
    """Residuals at rest, seen along the axis that the markers spread over least."""
    plane, across = flattest(found.markers)
    along = "the normal of their plane" if across is None else "xyz"[across]
    by = magnified(found, plane)
    how = f"arrows magnified {by:g} times" if by else "none beyond rounding"
    longest = float(np.linalg.norm(found.residuals, axis=1).max())
    # As high as its markers spread, within limits
    half = _sides(found.markers[:, plane])[1]
    height = float(np.clip(0.8 * WIDTH * half[1] / half[0], 2.2, 6.0)) + 0.9
    return Picture(
        "registration",
        "Registration residuals of the markers at rest, mapped minus target, in mm, seen along "
        f"{along}; {how}. Largest: {with_unit(longest, 'm')}. A pattern "
        "(all outward, all turned) would mean a wrong scale or rotation; noise has none. Markers "
        "that lie behind one another share a name.",
        "Arrows of the registration residual at each marker, without a common direction if only "
        "noise is left.",
        draw(lambda f: arrow_axes(f, found, plane), WIDTH, height),
    )


def magnified(found: Registration, plane: list[int]) -> float:
    """1, 2 or 5 times a power of ten; 0 where the residuals are rounding."""
    longest = float(np.linalg.norm(found.residuals[:, plane], axis=1).max())
    size = float(np.ptp(found.markers, axis=0).max())
    if longest <= _EXACT * size:
        return 0.0
    return rounded_down(_LONGEST * size / longest)


def rounded_down(value: float) -> float:
    """1, 2 or 5 times a power of ten, at most `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step for step in (1, 2, 5) if step * power <= value) * power)


def _sides(points: Floats) -> tuple[Floats, Floats]:
    """Middle (2,) and half sides (2,) of what is shown of points (k, 2), with room about them."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.5 * (high - low)
    longer = float(half.max()) or 1e-3
    return 0.5 * (low + high), np.maximum(half, _NARROWEST * longer) + 0.25 * longer


def arrow_axes(figure: Figure, found: Registration, plane: list[int]) -> None:
    """Markers, arrows, names, and the length of an arrow of round size."""
    ax, by = figure.subplots(), magnified(found, plane)
    x, r = _MM * found.markers[:, plane], _MM * found.residuals[:, plane]
    middle, half = (_MM * side for side in _sides(found.markers[:, plane]))
    ax.plot(*x.T, "o", mfc="white", mec="#D55E00", ms=4)
    ax.set(xlim=(middle[0] - half[0], middle[0] + half[0]),
           ylim=(middle[1] - half[1], middle[1] + half[1]), aspect="equal")  # fmt: skip
    across, up = ("xyz"[i] for i in plane)
    ax.set(xlabel=f"{across} / mm", ylabel=f"{up} / mm")
    if by:
        arrows = ax.quiver(*x.T, *(by * r.T), angles="xy", scale_units="xy", scale=1,
                           color=MEASURED, width=0.005)  # fmt: skip
        key = rounded_down(float(np.linalg.norm(r, axis=1).max()))
        ax.quiverkey(arrows, 0.72, 1.04, by * key, f"{key:g} mm", labelpos="E")
    ax.set_title(f"residuals, magnified {by:g} times" if by else
                 "no residual beyond rounding", loc="left", pad=13)  # fmt: skip
    if len(x) > _NAMED:
        return
    # Indices of markers that lie together: they share a name
    groups: list[list[int]] = []
    for i, at in enumerate(x):
        near = 2 * _NEAR * float(half.max())
        group = next((g for g in groups if np.linalg.norm(x[g[0]] - at) < near), None)
        if group is None:
            groups.append([i])
        else:
            group.append(i)
    # Names on the side that an arrow leaves free; above or below outer markers
    for group in groups:
        below = r[group].sum(axis=0)[1] >= 0
        ax.annotate(
            ", ".join(found.names[i] for i in group), tuple(x[group].mean(axis=0)),
            xytext=(0, -4 if below else 4), textcoords="offset points", fontsize=8,
            color="#404040", ha="center", va="top" if below else "bottom", annotation_clip=False,
        )  # fmt: skip
