"""Figures of a stored run or study, from its folder, for notebooks."""

import re
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from validate.checksums import read_sealed
from validate.compare.view import View
from validate.report.charts.style import painted
from validate.report.export.table_file import stored_table
from validate.report.stored.exhibit_rows import NOT_SHOWN, stored_exhibits
from validate.report.stored.folder import MARK
from validate.report.views.drawers import drawable, figure_of
from validate.report.views.standard import VIEWS
from validate.report.views.view_filling import filled_views

_DPI = 130
_DRAWN = re.compile("^(chart|intervals|heat)_")  # of files of what is drawn from numbers


def stored_figures(folder: Path) -> Mapping[str, Callable[[], Figure]]:
    """Return what draws each figure of a stored run, by a name without other signs: charts of views
    that have rows, charts of the run's own exhibits, then its other pictures as they are."""
    changed = (folder / MARK).stat().st_mtime_ns
    return _figures(folder, changed, tuple(view.name for view in VIEWS))


@lru_cache(maxsize=4)
def _figures(
    folder: Path, changed: int, views: tuple[str, ...]
) -> Mapping[str, Callable[[], Figure]]:
    table = stored_table(folder, part=NOT_SHOWN)
    own = (View.from_json(v) for v in table.head.get("views", ()))
    exhibits = [exhibit for _, exhibit in filled_views(table, own)]
    exhibits += stored_exhibits(read_sealed(folder / MARK))
    drawn = {_name(part.name): partial(figure_of, part, table)
             for exhibit in exhibits for part in drawable(exhibit)}  # fmt: skip
    files = sorted((folder / "figures").glob("*.png"))
    pictures = {_name(_DRAWN.sub("", f.stem)): partial(_picture, f) for f in files}
    return {**pictures, **drawn}


def _name(text: str) -> str:
    return re.sub(r"\W", "_", text)


def shown_in_notebooks(figure: Figure) -> Figure:
    """Return the figure, which a notebook then shows without a set-up of matplotlib."""
    vars(figure)["_repr_png_"] = partial(_png, figure)
    return figure


def _png(figure: Figure) -> bytes:
    out = BytesIO()
    figure.savefig(out, format="png", dpi=_DPI)
    return out.getvalue()


def _picture(file: Path) -> Figure:
    with Image.open(file) as image:
        pixels = image.convert("RGB")

    def paint(figure: Figure) -> None:
        figure.set_layout_engine("none")
        figure.add_axes((0.0, 0.0, 1.0, 1.0)).set_axis_off()
        figure.axes[0].imshow(pixels)

    return painted(paint, pixels.width / _DPI, pixels.height / _DPI)
