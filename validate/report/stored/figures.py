"""Pictures of a stored run or study as figures, for notebooks."""

from functools import partial
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from validate.report.charts.style import painted

_DPI = 130


def figure_of_file(file: Path) -> Figure:
    """Return a picture as a figure of its size."""
    with Image.open(file) as image:
        pixels = image.convert("RGB")

    def paint(figure: Figure) -> None:
        figure.set_layout_engine("none")
        figure.add_axes((0.0, 0.0, 1.0, 1.0)).set_axis_off()
        figure.axes[0].imshow(pixels)

    return painted(paint, pixels.width / _DPI, pixels.height / _DPI)


def shown_in_notebooks(figure: Figure) -> Figure:
    """Return the figure, which a notebook then shows without a set-up of matplotlib."""
    vars(figure)["_repr_png_"] = partial(_png, figure)
    return figure


def _png(figure: Figure) -> bytes:
    out = BytesIO()
    figure.savefig(out, format="png", dpi=_DPI)
    return out.getvalue()
