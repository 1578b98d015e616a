"""Error intervals against their limits as one figure, one line per check."""

from textwrap import fill

import numpy as np
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Intervals, Picture
from validate.report.charts.style import MEASURED, NOISE, PALETTE, WIDTH, Drawing, draw
from validate.report.views.view_filling import WORDS

_LINE, _ROOM = 0.3, 1.0  # inches of a line, of title and axis
_LETTERS = 34  # of a label in one line
_MOST = 40  # lines of one picture: those nearest to their limit
_FAR = 3.0  # shares of the limit; what lies beyond is an arrow
_COLOURS = {"good": PALETTE[2], "bad": PALETTE[1]}


def picture(shown: Intervals) -> Picture:
    """Return the intervals drawn, at most `_MOST`: the largest shares of their limits."""
    _, _, of = shares(shown)
    order = _order(shown)
    left = len(shown.labels) - len(order)
    more = f" {left} more have smaller shares." if left > 0 else ""
    words = "; ".join(f"{shown.labels[i]}: {shown.texts[i]}, {shown.answers[i]}" for i in order)
    return Picture(
        f"intervals_{shown.name}",
        f"{shown.title}. {shown.caption} Across: {of} (no unit); grey: within it.{more}".replace(
            "  ", " "
        ),
        f"Intervals: {words}.",
        draw(*drawing(shown)),
    )


def drawing(shown: Intervals, width: float = WIDTH) -> Drawing:
    """Return the function that fills the figure, and its width and height in inches."""
    high = _ROOM + _LINE * max(1, len(_order(shown)))
    return lambda f: _fill(f, shown, width), width, high


def _order(shown: Intervals) -> list[int]:
    """The lines that are drawn, the largest share first."""
    share, half, _ = shares(shown)
    found = np.argsort(-(np.abs(share) + half), kind="stable")[:_MOST]
    return [int(i) for i in found]


def shares(shown: Intervals) -> tuple[Floats, Floats, str]:
    """Values and halves over their limits, or, where nothing has one, over the halves; of what."""
    limited = np.isfinite(shown.limits).any()
    by = shown.limits if limited else shown.halves
    with np.errstate(divide="ignore", invalid="ignore"):
        share, half = shown.values / by, shown.halves / by
    of = shown.across if limited else "error over 2 u_val"
    return np.nan_to_num(share, nan=0.0, posinf=np.inf, neginf=-np.inf), np.nan_to_num(half), of


def _fill(figure: Figure, shown: Intervals, width: float) -> None:
    share, half, of = shares(shown)
    order = _order(shown)
    ax = figure.subplots()
    ax.axvspan(-1, 1, color=NOISE, zorder=0)
    ax.axvline(0, color=MEASURED, linewidth=0.8)
    for y, i in enumerate(order):
        colour = _COLOURS.get(WORDS.get(shown.answers[i], ""), PALETTE[4])
        ends = np.clip([share[i] - half[i], share[i] + half[i]], -_FAR, _FAR)
        ax.plot(ends, [y, y], color=colour, linewidth=2.2, solid_capstyle="butt")
        inside = abs(share[i]) <= _FAR
        sign = "o" if inside else ">" if share[i] > 0 else "<"
        ax.plot([np.clip(share[i], -_FAR, _FAR)], [y], sign, color=colour, markersize=5)
    share_of = width / WIDTH
    labels = [fill(shown.labels[i], int(_LETTERS * share_of)) for i in order]
    ax.set_yticks(range(len(order)), labels)
    ax.tick_params(axis="y", labelsize=8.5)
    ax.set(ylim=(len(order) - 0.5, -0.5), xlabel=f"{of} / 1", xlim=(-1.1 * _FAR, 1.1 * _FAR))
    ax.grid(visible=False, axis="y")
    title = fill(shown.title, int(66 * share_of))
    figure.suptitle(title, x=0.01, ha="left", fontsize="medium")
