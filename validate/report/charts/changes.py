"""Relative changes of scores as a figure: one line per score, readable without colour."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from validate.compare.exhibit import Picture
from validate.numbers import significant
from validate.report.charts.style import ACCEPTED, MEASURED, draw

_WIDTH, _ROW, _EDGES = 8.6, 0.24, 1.0  # inches; of a score, and of axis and title
_LINEAR = 1.0  # per cent: the axis is logarithmic beyond
_LONGEST = 60  # characters of a name


def picture(name: str, title: str, labels: Sequence[str], changes: Sequence[float]) -> Picture:
    """Points at 100 `changes` per cent beside their labels, the first on top."""
    percent = 100 * np.asarray(changes, dtype=np.float64)
    pixels = draw(
        lambda f: _fill(f.add_subplot(), labels, percent), _WIDTH, _EDGES + _ROW * len(labels)
    )
    ends = f"{significant(float(percent.min()))} to {significant(float(percent.max()))} %"
    return Picture(
        name,
        f"{title}: relative change of every score, per cent; linear within ±{_LINEAR:g} %, "
        "logarithmic beyond.",
        f"Relative changes of {len(labels)} scores, from {ends}.",
        pixels,
    )


def _fill(axes: Axes, labels: Sequence[str], percent: np.ndarray) -> None:
    rows = np.arange(len(labels))
    axes.axvline(0.0, color=MEASURED, linewidth=0.8)
    axes.hlines(rows, 0.0, percent, color=ACCEPTED, linewidth=1.6)
    axes.plot(percent, rows, "o", color=ACCEPTED, markersize=5)
    axes.set_xscale("symlog", linthresh=_LINEAR)
    low, high = (max(_LINEAR, float(end)) for end in (-percent.min(), percent.max()))
    axes.set_xlim(-3 * low, 3 * high)
    ticks = [*(-t for t in _decades(low)), 0.0, *_decades(high)]
    axes.set_xticks(ticks, [f"{t:+g}".replace("-", "−") if t else "0" for t in ticks])
    axes.set_ylim(len(labels) - 0.5, -0.5)
    cut = [t if len(t) <= _LONGEST else f"{t[: _LONGEST - 1]}…" for t in labels]
    axes.set_yticks(rows, cut)
    axes.set_xlabel("change / %")


def _decades(end: float) -> list[float]:
    """Some powers of ten from the linear part to the end, at most five."""
    top = int(np.log10(end))
    return [10.0**k for k in range(0, top + 1, max(1, -(-top // 4)))]
