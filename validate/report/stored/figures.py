"""Pictures of a stored run or study as figures, for notebooks."""

from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from validate.compare.exhibit import Pixels
from validate.report.charts.style import painted

_DPI = 130


def figure_of_file(file: Path) -> Figure:
    """Return a picture as a figure of its size."""
    with Image.open(file) as image:
        return figure_of_pixels(np.asarray(image.convert("RGB")))


def figure_of_pixels(pixels: Pixels) -> Figure:
    """Return an image (h, w, 3) sRGB as a figure of its size."""

    def paint(figure: Figure) -> None:
        figure.set_layout_engine("none")
        figure.add_axes((0.0, 0.0, 1.0, 1.0)).set_axis_off()
        figure.axes[0].imshow(pixels)

    height, width, _ = pixels.shape
    return painted(paint, width / _DPI, height / _DPI)


def shown_in_notebooks(figure: Figure) -> Figure:
    """Return the figure, which a notebook then shows without a set-up of matplotlib."""
    vars(figure)["_repr_png_"] = partial(_png, figure)
    return figure


def _png(figure: Figure) -> bytes:
    out = BytesIO()
    figure.savefig(out, format="png", dpi=_DPI)
    return out.getvalue()
