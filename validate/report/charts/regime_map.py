"""Regime map: outcomes over a logarithmic axis as coloured squares, one panel per method.

Colours, hatches and words tell regimes apart; the predicted border is a line, named settings are
marks.
"""

from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from validate.arrays import Floats
from validate.compare.exhibit import Mark, Picture, RegimeMap
from validate.report.charts.style import WIDTH, draw, legend_columns, legend_height, panels

_COLOURS = ("#56B4E9", "#CFE8F7", "#D55E00", "#7F7F7F")  # Okabe-Ito, the second a paler first
_HATCHES = ("", "", "////", "....")  # what colours say, on paper without any
_COLUMNS = 2
_PANEL, _ROW = 0.62, 0.16  # inches of a panel before its rows, and of a row
_BORDER, _MARK = "#000000", "#F0E442"
_SIGNS = ("o", "s", "D", "^", "v", "P")


def picture(shown: RegimeMap) -> Picture:
    """Return the map drawn; its caption explains line and marks."""
    columns = min(_COLUMNS, len(shown.panels))
    rows = -(-len(shown.panels) // columns)
    height = _PANEL + _ROW * len(shown.rows)
    below = legend_height([str(e.get_label()) for e in _entries(shown)])
    pixels = draw(lambda f: _fill(f, shown, columns), WIDTH, rows * height + 0.4 + below)
    counted = ", ".join(
        f"{name} {sum(int((p.codes == i).sum()) for p in shown.panels)}"
        for i, name in enumerate(shown.regimes)
    )
    return Picture(
        f"regimes_{shown.name}",
        f"{shown.title}. Points: {counted}. {shown.caption}".strip(),
        f"Map of regimes: {shown.title}; {shown.x_label} and {shown.y_label}, "
        f"{len(shown.panels)} panels of {len(shown.rows)} by {len(shown.x)}.",
        pixels,
    )


def _fill(figure: Figure, shown: RegimeMap, columns: int) -> None:
    axes, lowest = panels(figure, len(shown.panels), columns)
    colours = ListedColormap(_COLOURS[: len(shown.regimes)])
    norm = BoundaryNorm(np.arange(len(shown.regimes) + 1) - 0.5, len(shown.regimes))
    edges, x = np.arange(len(shown.rows) + 1) - 0.5, _edges(shown.x)
    for ax, panel in zip(axes, shown.panels, strict=True):
        ax.set_xscale("log")
        ax.pcolormesh(x, edges, panel.codes, cmap=colours, norm=norm, edgecolors="white",
                      linewidth=0.2)  # fmt: skip
        # Strokes over the regimes that grey paper would not tell apart
        for code, hatch in enumerate(_HATCHES[: len(shown.regimes)]):
            for row, column in np.argwhere(panel.codes == code) if hatch else ():
                ax.fill_between(x[column : column + 2], row - 0.5, row + 0.5, facecolor="none",
                                edgecolor="#00000055", hatch=hatch, lw=0)  # fmt: skip
        for row, at in enumerate(panel.border):
            if np.isfinite(at) and x[0] < at < x[-1]:
                ax.plot([at, at], [row - 0.5, row + 0.5], color=_BORDER, linewidth=1.6)
        for i, mark in enumerate(shown.marks):
            ax.plot(mark.x, mark.row, **_look(i, mark))
        ax.set_title(panel.title, loc="left", fontsize=8.5)
        ax.set(xlim=(x[0], x[-1]), ylim=(edges[0], edges[-1]))
        ax.grid(visible=False)
        ax.minorticks_off()
    for ax in lowest:
        ax.set_xlabel(shown.x_label)
    for ax in axes[::columns]:
        ax.set_yticks(range(len(shown.rows)), shown.rows, fontsize=8)
    figure.supylabel(shown.y_label, fontsize="medium")
    entries = _entries(shown)
    count = legend_columns([str(e.get_label()) for e in entries])
    figure.legend(handles=entries, loc="outside lower center", ncols=count)


def _look(i: int, mark: Mark) -> dict[str, Any]:
    """Filled on the map, hollow where the place only lies above."""
    face = _MARK if mark.on_map else "none"
    return {"marker": _SIGNS[i % len(_SIGNS)], "markerfacecolor": face, "markersize": 7,
            "markeredgecolor": "black", "markeredgewidth": 1.3, "linestyle": "none"}  # fmt: skip


def _edges(x: Floats) -> Floats:
    """Borders (k + 1,) halfway between logarithms of x (k,)."""
    logs = np.log(x)
    middles = (logs[1:] + logs[:-1]) / 2
    ends = 2 * logs[0] - middles[0], 2 * logs[-1] - middles[-1]
    return np.asarray(np.exp(np.array([ends[0], *middles, ends[1]])))


def _entries(shown: RegimeMap) -> list[Patch | Line2D]:
    entries: list[Patch | Line2D] = [
        Patch(facecolor=_COLOURS[i], edgecolor="#00000088", hatch=_HATCHES[i], lw=0, label=name)
        for i, name in enumerate(shown.regimes)
    ]
    entries.append(Line2D([], [], color=_BORDER, linewidth=1.6, label="predicted limit"))
    for i, mark in enumerate(shown.marks):
        entries.append(Line2D([], [], label=mark.label, **_look(i, mark)))
    return entries
