"""Figure style and files: colours, fonts, rasterising without global state, PNG and WebP.

Figures are `WIDTH` wide where they can be: a telephone and a printed page show that much with
letters that can be read.
"""

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any, Protocol, overload

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

from validate.compare.exhibit import ImageSeries, Picture, Pixels

MEASURED = "#000000"
ACCEPTED = "#0072B2"
NOISE = "#D9D9D9"
_RIVALS = ("#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
PALETTE = (ACCEPTED, *_RIVALS)  # Okabe and Ito, without their yellow
_DASHES = ((0, (5, 2)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)), (0, (3, 1)), (0, (8, 3)), (0, (2, 3)))
_POINTS = ("s", "^", "D", "v", "P", "X")
_LETTERS = 9.5  # points
_SETTINGS: Mapping[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": _LETTERS,
    "axes.titlesize": 10.0,
    "axes.labelsize": _LETTERS,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E5E5E5",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.fontsize": 9.0,
    "legend.handlelength": 2.6,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "savefig.facecolor": "white",
}
DPI = 130  # dots an inch on the page
WIDTH = 5.6  # inches
_INCH = 25.4  # mm
#: Widths of a journal's page in mm by name, and the size of its letters over those of a report.
COLUMNS: Mapping[str, tuple[float, float]] = {"85mm": (85.0, 0.78), "175mm": (175.0, 0.9)}
_LETTER = 0.07  # inches of a legend's letter, about
_HANDLE = 0.6  # inches of a legend's line and the room beside it


def inches_of(column: str) -> tuple[tuple[float], float]:
    """Return the width at which a figure for a column is laid out, and its `size` then."""
    width, size = COLUMNS[column]
    return (width / _INCH / size,), size


Drawing = tuple[Callable[[Figure], None], float, float]  # fills a figure of these inches


@dataclass(frozen=True)
class Style:
    """The colour, dash and point of a method, the same in every figure of a report."""

    colour: str
    dash: Any
    point: str
    width: float


class NamedMethod(Protocol):
    """Attributes of a method that figures use."""

    @property
    def name(self) -> str: ...
    @property
    def label(self) -> str: ...
    @property
    def accepted(self) -> bool: ...


class HasMethods(Protocol):
    """A result, or a table of one, whose methods look alike in every figure."""

    @property
    def methods(self) -> Sequence[NamedMethod]: ...


def looks(result: HasMethods) -> dict[str, Style]:
    """By method: accepted ones blue and solid, rivals in the other colours and dashed."""
    found: dict[str, Style] = {}
    rivals = 0
    for method in result.methods:
        if method.accepted and not any(m.colour == ACCEPTED for m in found.values()):
            found[method.name] = Style(ACCEPTED, "-", "o", 1.8)
            continue
        i = rivals % len(_RIVALS)
        other = (rivals + rivals // len(_RIVALS)) % len(_DASHES)  # a second round looks different
        found[method.name] = Style(_RIVALS[i], _DASHES[other], _POINTS[other], 1.2)
        rivals += 1
    return found


def free_look(i: int, colour: str) -> Style:
    """Return the look of line i that is no method: the first solid, the others dashed in turn."""
    if i == 0:
        return Style(colour, "-", "o", 1.5)
    return Style(colour, _DASHES[(i - 1) % len(_DASHES)], _POINTS[(i - 1) % len(_POINTS)], 1.4)


def draw(paint: Callable[[Figure], None], width: float, height: float, dpi: float = DPI) -> Pixels:
    """Pixels (h, w, 3) of a figure of width x height inches that `paint` fills."""
    canvas: Any = painted(paint, width, height, dpi).canvas
    return np.array(canvas.buffer_rgba(), dtype=np.uint8)[..., :3].copy()


def drawn_picture(
    name: str, caption: str, alt: str, paint: Callable[[Figure], None], inches: tuple[float, float]
) -> Picture:
    """Return an experiment's own drawing as a picture of its report, in the report's style.

    `paint` fills a matplotlib figure of (width, height) `inches`; `alt` says in words what is
    seen.
    """
    return Picture(name, caption, alt, draw(paint, *inches))


def painted(
    paint: Callable[[Figure], None], width: float, height: float, dpi: float = DPI,
    size: float = 1.0,
) -> Figure:  # fmt: skip
    """Return the figure itself, laid out and drawn, letters and lines with it `size` times as
    large."""
    settings: Any = dict(_SETTINGS)
    with mpl.rc_context(settings):
        figure = Figure(figsize=(width * size, height * size), dpi=dpi, layout="constrained")
        canvas: Any = FigureCanvasAgg(figure)  # its methods carry no annotations
        paint(figure)
        if size != 1.0:
            for text in figure.findobj(Text):
                text.set_fontsize(size * float(text.get_fontsize()))
            for line in figure.findobj(Line2D):
                line.set_linewidth(size * line.get_linewidth())
                line.set_markersize(size * line.get_markersize())
            for axis in (axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)):
                now: Any = axis.get_tick_params().get("labelsize", _LETTERS)
                axis.set_tick_params(
                    labelsize=size * now
                )  # also of ticks that are still to be made
        canvas.draw()
    return figure


def panels(figure: Figure, count: int, columns: int) -> tuple[list[Axes], list[Axes]]:
    """`count` axes of common scales in rows of `columns`, and the lowest of every column, which
    have numbers below."""
    grid = figure.subplots(-(-count // columns), columns, sharex=True, sharey=True, squeeze=False)
    for ax in grid.flat[count:]:
        ax.set_axis_off()
    shown = list(grid.flat[:count])
    for ax in shown[-columns:]:
        ax.tick_params(labelbottom=True)
    return shown, shown[-columns:]


def legend_below(figure: Figure, ax: Axes, width: float = WIDTH) -> Legend:
    """Return the legend of an axes below the whole figure."""
    handles, labels = ax.get_legend_handles_labels()
    columns = legend_columns(labels, width)
    return figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def legend_columns(labels: Sequence[str], width: float = WIDTH) -> int:
    """Return the number of legend columns that fit below a figure."""
    widest = max(len(line) for label in labels for line in label.splitlines())
    return max(1, min(len(labels), int(width / (_HANDLE + _LETTER * widest))))


def legend_height(labels: Sequence[str], width: float = WIDTH) -> float:
    """Inches that the legend takes."""
    lines = max(len(label.splitlines()) for label in labels)
    return 0.21 * lines * -(-len(labels) // legend_columns(labels, width)) + 0.1


# --- encoding of figures: PNG files, and smaller WebP data URIs for the page ---------------------

_WIDEST = 1000  # pixels of a photo on the page; its file has all


@dataclass(frozen=True)
class EncodedPicture(Picture):
    """A picture with its `file` and its data `uri`."""

    file: bytes = b""
    uri: str = ""


@dataclass(frozen=True)
class EncodedSeries(ImageSeries):
    """A series with the data `uris` of its images."""

    uris: tuple[str, ...] = ()


@overload
def encoded(picture: Picture) -> EncodedPicture: ...
@overload
def encoded(picture: Picture | ImageSeries) -> EncodedPicture | EncodedSeries: ...
def encoded(picture: Picture | ImageSeries) -> EncodedPicture | EncodedSeries:
    """Return the picture as a PNG for the folder and a lossless WebP for the page, lossy and at
    most `_WIDEST` wide for a photo; a series as lossy WebPs for the page."""
    if isinstance(picture, EncodedPicture | EncodedSeries):
        return picture
    own = vars(picture)
    if isinstance(picture, ImageSeries):
        return EncodedSeries(
            **own, uris=tuple(_webp(image, photo=True) for image in picture.images)
        )
    uri = _webp(picture.pixels, picture.photo)
    return EncodedPicture(**own, file=png(picture), uri=uri)


def png(picture: Picture) -> bytes:
    """Return a PNG; line art in 256 colours, which it does not exceed visibly."""
    image = Image.fromarray(picture.pixels)
    if not picture.photo:
        image = image.quantize(256, dither=Image.Dither.NONE)
    out = BytesIO()
    image.save(
        out, "PNG", compress_level=6, dpi=(picture.dpi, picture.dpi)
    )  # 9 takes five times as long for 5 % less
    return out.getvalue()


def uri(picture: Picture) -> str:
    """Return a data URI: WebP, lossless for line art."""
    return encoded(picture).uri


def _webp(pixels: Pixels, photo: bool) -> str:
    image, out = Image.fromarray(pixels), BytesIO()
    if photo and image.width > _WIDEST:
        image.thumbnail((_WIDEST, image.height), Image.Resampling.LANCZOS)
    how = {"quality": 76} if photo else {"lossless": True, "quality": 60}
    image.save(out, "WEBP", method=4, **how)
    return "data:image/webp;base64," + base64.b64encode(out.getvalue()).decode("ascii")
