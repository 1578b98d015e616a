"""What every figure keeps: lines apart, no text on another, nothing cut, no rounding as data."""

from collections.abc import Iterator, Sequence
from itertools import combinations

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

# private: _left_title: matplotlib has no other way to it.

_DECADES = 1e10  # from the lowest to the highest place on a logarithmic axis
_OVER = 1.0  # pixels that boxes may share


def faults(figure: Figure) -> list[str]:
    """What is wrong with a figure that was drawn, in words."""
    return [
        *_alike(figure),
        *_on_another("tick labels", [t for ax in figure.axes for t in _ticks(ax)]),
        *_on_another("texts", [t for ax in figure.axes for t in (*ax.texts, *_titles(ax))]),
        *_cut(figure),
        *_legend_over_data(figure),
        *_rounding(figure),
    ]


def drawn_lines(ax: Axes) -> list[Line2D]:
    """The lines with a name: what is measured, simulated or expected, as lines."""
    lines = [line for line in ax.get_lines() if not str(line.get_label()).startswith("_")]
    return [line for line in lines if line.get_linestyle() != "None"]


def _alike(figure: Figure) -> Iterator[str]:
    for ax in figure.axes:
        for one, other in combinations(drawn_lines(ax), 2):
            if to_hex(one.get_color()) == to_hex(other.get_color()):
                yield f"'{one.get_label()}' and '{other.get_label()}' are one colour"


def _ticks(ax: Axes) -> list[Text]:
    return [*_seen(ax.xaxis), *_seen(ax.yaxis)]


def _seen(axis: Axis) -> list[Text]:
    low, high = sorted(axis.get_view_interval())
    low, high = low - 1e-9 * abs(low), high + 1e-9 * abs(high)
    ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
    labels = [tick.label1 for tick in ticks if low <= tick.get_loc() <= high]
    return [t for t in labels if t.get_visible() and t.get_text()]


def _titles(ax: Axes) -> list[Text]:
    return [t for t in (ax.title, ax._left_title) if t.get_text()]  # type: ignore[attr-defined]


def _on_another(what: str, texts: Sequence[Text]) -> Iterator[str]:
    boxes = [(t.get_text(), t.get_window_extent().padded(-_OVER)) for t in texts]
    for (one, a), (other, b) in combinations(boxes, 2):
        if a.overlaps(b):
            yield f"{what} '{one}' and '{other}' overlap"


def _cut(figure: Figure) -> Iterator[str]:
    texts = [t for ax in figure.axes for t in (*ax.texts, *_titles(ax), *_ticks(ax))]
    texts += [*figure.texts, *(t for legend in figure.legends for t in legend.get_texts())]
    for text in (t for t in texts if t.get_text()):
        box = text.get_window_extent()
        page = figure.bbox.padded(_OVER)
        if box.x0 < page.x0 or box.x1 > page.x1 or box.y0 < page.y0 or box.y1 > page.y1:
            yield f"'{text.get_text()}' is cut by the border"


def _legend_over_data(figure: Figure) -> Iterator[str]:
    for legend in figure.legends:
        mine = legend.get_window_extent().padded(-_OVER)
        boxes = [(ax.get_title(loc="left"), ax.get_tightbbox()) for ax in figure.axes]
        boxes += [(t.get_text(), t.get_window_extent()) for t in figure.texts]
        for name, box in boxes:
            if box is not None and mine.overlaps(box):
                yield f"the legend lies on '{name}'"


def _rounding(figure: Figure) -> Iterator[str]:
    for ax in figure.axes:
        low, high = ax.get_ylim()
        if ax.get_yscale() == "log" and high > _DECADES * low:
            yield f"a logarithmic axis from {low:.1e} to {high:.1e}"
