"""Heat map: numbers over two axes as coloured squares, labelled where there is room."""

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from validate.arrays import Floats
from validate.compare.exhibit import Heat, Picture
from validate.numbers import significant
from validate.report.charts.style import Drawing, draw

_CELL = (0.6, 0.36)  # inches of a square that holds its number
_LARGEST = (6.2, 6.5)  # inches of all squares
_BESIDE = 1.9  # inches of labels and colours beside them
_LEGIBLE = 0.42  # inches across below which numbers would run into each other
_TICKS = 24  # texts of an axis
_EMPTY = "#BDBDBD"


def picture(heat: Heat) -> Picture:
    """Return the heat drawn; squares without a number are grey."""
    rows, columns = heat.values.shape
    turn = "" if heat.centre is None else f" White is {heat.centre:g}."
    scale = " Logarithmic colours." if _logarithmic(heat.values) else ""
    missing = int(np.isnan(heat.values).sum())
    empty = f" Grey: {missing} without a number." if missing else ""
    title = heat.title if heat.title.endswith(".") else f"{heat.title}."
    return Picture(
        f"heat_{heat.name}",
        f"{title} Colour: {heat.quantity}.{turn}{scale}{empty}",
        f"Heat map: {heat.title}; {heat.quantity} over {heat.x} and {heat.y}, {rows} by {columns}.",
        draw(*drawing(heat)),
    )


def drawing(heat: Heat, widest: float = _LARGEST[0] + _BESIDE) -> Drawing:
    """Return the function that fills the figure, and its width and height in inches, which is at
    most `widest`."""
    rows, columns = heat.values.shape
    width = min(max(columns * _CELL[0], 3.0), widest - _BESIDE)
    height = min(max(rows * _CELL[1], 1.6), _LARGEST[1])
    return lambda f: _fill(f, heat, width / columns), width + _BESIDE, height + 1.1


def _fill(figure: Figure, heat: Heat, across: float) -> None:
    ax, norm = figure.subplots(), _norm(heat)
    colours = mpl.colormaps["RdBu_r" if heat.centre is not None else "viridis"].with_extremes(
        bad=_EMPTY
    )
    shown = ax.imshow(heat.values, cmap=colours, norm=norm, aspect="auto", origin="lower")
    ax.grid(visible=False)
    for axis, texts in ((ax.xaxis, heat.columns), (ax.yaxis, heat.rows)):
        every = -(-len(texts) // _TICKS)
        at = list(range(0, len(texts), every))
        axis.set_ticks(at, [_short(texts[i]) for i in at])
    if max(len(_short(text)) for text in heat.columns) > 6:
        ax.tick_params(axis="x", rotation=30)
    ax.set(xlabel=heat.x, ylabel=heat.y)
    if across >= _LEGIBLE:
        # Black on light squares, white on dark ones
        for (i, j), value in np.ndenumerate(heat.values):
            if np.isfinite(value):
                red, green, blue, _ = shown.to_rgba(np.array([value]))[0]
                light = 0.299 * red + 0.587 * green + 0.114 * blue > 0.55
                ax.text(j, i, significant(value), ha="center", va="center", fontsize=8,
                        color="black" if light else "white")  # fmt: skip
    figure.colorbar(shown, ax=ax, label=heat.quantity)


def _norm(heat: Heat) -> Normalize:
    """Logarithmic where all is above 0; the same distance on both sides of the centre."""
    seen = heat.values[np.isfinite(heat.values)]
    if not seen.size:
        return Normalize(0, 1)
    low, high = float(seen.min()), float(seen.max())
    if _logarithmic(heat.values):
        if heat.centre is not None:
            most = max(high / heat.centre, heat.centre / low, 1.1)
            return LogNorm(heat.centre / most, heat.centre * most)
        return LogNorm(low, max(high, low * 1.01))
    if heat.centre is not None:
        most = max(high - heat.centre, heat.centre - low, 1e-300)
        return Normalize(heat.centre - most, heat.centre + most)
    return Normalize(low, high)


def _logarithmic(values: Floats) -> bool:
    seen = values[np.isfinite(values)]
    return bool(seen.size and seen.min() > 0)


def _short(text: str) -> str:
    """A number in three digits, any other text as it is."""
    try:
        return f"{float(text):.3g}"
    except ValueError:
        return text
