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
_ASIDE = ("fitted", "same model", "no requirement")  # answers that decide nothing
_GAP, _LEAST = 3.0, 1.2  # what lies so many times further off than the next is an arrow; the scale
_COLOURS = {"good": PALETTE[2], "bad": PALETTE[1]}


def picture(shown: Intervals) -> Picture:
    """Return the intervals drawn, at most `_MOST`: the largest shares of their limits."""
    _, _, of = shares(shown)
    lines = order(shown)[:_MOST]
    left = len(shown.labels) - len(lines)
    more = f" {left} more have smaller shares." if left > 0 else ""
    words = "; ".join(f"{shown.labels[i]}: {shown.texts[i]}, {shown.answers[i]}" for i in lines)
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
    high = _ROOM + _LINE * max(1, len(order(shown)[:_MOST]))
    return lambda f: _fill(f, shown, width), width, high


def order(shown: Intervals) -> list[int]:
    """Return the lines in order: those that decide first, of these the largest share."""
    share, half, _ = shares(shown)
    aside = np.array([answer in _ASIDE for answer in shown.answers])
    return [int(i) for i in np.lexsort((-(np.abs(share) + half), aside))]


def shares(shown: Intervals) -> tuple[Floats, Floats, str]:
    """Values and halves over their limits, or, where nothing has one, over the halves; of what."""
    limited = np.isfinite(shown.limits).any()
    by = shown.limits if limited else shown.halves
    with np.errstate(divide="ignore", invalid="ignore"):
        share, half = shown.values / by, shown.halves / by
    of = shown.across if limited else "error over 2 u_val"
    return np.nan_to_num(share, nan=0.0, posinf=np.inf, neginf=-np.inf), np.nan_to_num(half), of


def reach(share: Floats, half: Floats) -> float:
    """Return how far, in limits, an axis goes: to the last interval that is not much further off
    than the one before it."""
    far = _LEAST
    for k, end in enumerate(np.sort(np.abs(share) + half)):
        if k and end > _GAP * far:
            break
        far = max(far, 1.1 * float(end)) if np.isfinite(end) else far
    return far


def _fill(figure: Figure, shown: Intervals, width: float) -> None:
    share, half, of = shares(shown)
    lines, far = order(shown)[:_MOST], reach(share, half)
    ax = figure.subplots()
    ax.axvspan(-1, 1, color=NOISE, zorder=0)
    ax.axvline(0, color=MEASURED, linewidth=0.8)
    for y, i in enumerate(lines):
        colour = _COLOURS.get(WORDS.get(shown.answers[i], ""), PALETTE[4])
        ends = np.clip([share[i] - half[i], share[i] + half[i]], -far, far)
        ax.plot(ends, [y, y], color=colour, linewidth=2.2, solid_capstyle="butt")
        inside = abs(share[i]) <= far
        sign = "o" if inside else ">" if share[i] > 0 else "<"
        ax.plot([np.clip(share[i], -far, far)], [y], sign, color=colour, markersize=5)
    share_of = width / WIDTH
    labels = [fill(shown.labels[i], int(_LETTERS * share_of)) for i in lines]
    ax.set_yticks(range(len(lines)), labels)
    ax.tick_params(axis="y", labelsize=8.5)
    ax.set(ylim=(len(lines) - 0.5, -0.5), xlabel=f"{of} / 1", xlim=(-1.05 * far, 1.05 * far))
    ax.grid(visible=False, axis="y")
    title = fill(shown.title, int(66 * share_of))
    figure.suptitle(title, x=0.01, ha="left", fontsize="medium")
