"""Views and figures by name, of a stored run or study, a comparison, a recording.

`result.plot.limits()`, `recording.plot.force()`
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Union

import numpy as np

from validate.compare.exhibit import Chart, Exhibit, Picture, Series
from validate.numbers import scale, shown_unit
from validate.parameters import nearest_names
from validate.recording.types import Markers, Recording, Signal
from validate.report.export.table_file import stored_table
from validate.report.long_table import LongTable
from validate.report.stored.exhibit_rows import NOT_SHOWN
from validate.report.stored.folder import MARK
from validate.report.stored.tables import PICTURE, Shown, pictures, plain_name, shown_by_name
from validate.report.views.drawers import figures, part, save, terminal
from validate.report.views.standard import VIEWS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH = 100  # letters of a line of text


@dataclass(frozen=True, repr=False)
class ShownView:
    """A filled view: `print` gives its text, a notebook shows it as on the report's page."""

    exhibit: Exhibit
    table: LongTable

    def figures(self) -> "list[Figure]":
        """Return its charts as matplotlib figures; none for a table or sentences."""
        return figures(self.exhibit, self.table)

    def save(self, path: str | Path) -> None:
        """Write it as the suffix says: .svg, .pdf, .png, .csv, .tex or .html.

        Raises `UsageError` for another suffix, and for several charts or tables in one file.
        """
        save(self.exhibit, self.table, Path(path))

    def __repr__(self) -> str:
        return "\n".join(terminal(self.exhibit, _WIDTH))

    def _repr_html_(self) -> str:
        return part(self.exhibit, self.table)


Draw = Callable[[], Union["Figure", ShownView]]
_NO_RUN = LongTable({}, ())


@dataclass(frozen=True, repr=False)
class Plots:
    """What a result or a recording shows: each name is a method.

    It returns a matplotlib Figure for a chart or a picture; for a table, sentences and several
    charts a `ShownView`, which has `figures()` and `save(path)`. A notebook shows both. `dir()` and
    `list()` give the names; those of a stored run are those of `validate show`.
    """

    _views: Callable[[], Mapping[str, Draw]]

    def __getattr__(self, name: str) -> Draw:
        """Return what draws the view of that name; raises `AttributeError` with the nearest."""
        if name.startswith("_"):
            raise AttributeError(name)
        views = self._views()
        if name not in views:
            raise AttributeError(f"no figure '{name}'; {nearest_names(name, set(views))}")
        return views[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._views())

    def __dir__(self) -> list[str]:
        return sorted(self)

    def __repr__(self) -> str:
        names = [f"  .{name}()" for name in self]
        more = [f"  and {len(names) - 20} more: list(...)"] if len(names) > 20 else []
        return "\n".join([f"{len(names)} views", *names[:20], *more])


def drawn(exhibit: Exhibit, table: LongTable = _NO_RUN) -> "Figure | ShownView":
    """Return an exhibit's one chart or picture as a figure, else the exhibit as a view."""
    from validate.report.stored.figures import figure_of_pixels, shown_in_notebooks
    from validate.report.views.drawers import figures

    found = figures(exhibit, table)
    found += [figure_of_pixels(p.pixels) for p in exhibit.pictures if isinstance(p, Picture)]
    alone = len(found) == 1 and not exhibit.tables
    return shown_in_notebooks(found[0]) if alone else ShownView(exhibit, table)


# --- a stored run or study ------------------------------------------------------------------------


def plots_of(folder: Path) -> Plots:
    """Return the plots of a stored run or study."""
    return Plots(partial(_stored_views, folder))


def _stored_views(folder: Path) -> Mapping[str, Draw]:
    changed = (folder / MARK).stat().st_mtime_ns
    table, found = _read(folder, changed, tuple(view.name for view in VIEWS))
    files = pictures(folder)
    return {
        name: partial(_picture, files[name]) if form == PICTURE else partial(drawn, exhibit, table)
        for name, (form, exhibit) in found.items()
    }


@lru_cache(maxsize=4)
def _read(folder: Path, changed: int, views: tuple[str, ...]) -> tuple[LongTable, Shown]:
    table = stored_table(folder, part=NOT_SHOWN)
    return table, shown_by_name(folder, table)


def _picture(file: Path) -> "Figure":
    from validate.report.stored.figures import figure_of_file, shown_in_notebooks

    return shown_in_notebooks(figure_of_file(file))


# --- a comparison of runs, a recording ------------------------------------------------------------


def exhibit_plots(make: Callable[[], Mapping[str, Exhibit]]) -> Plots:
    """Return the plots of exhibits by name, which `make` makes where one is asked for."""
    return Plots(lambda: {plain_name(n): partial(drawn, e) for n, e in make().items()})


def recording_plots(recording: Recording) -> Plots:
    """Return the plots of a recording by topic: signals over time, and how far markers moved."""
    streams: dict[str, Signal | Markers] = {**recording.signals, **recording.markers}
    return exhibit_plots(
        lambda: {t: Exhibit(t, t, charts=(_over_time(t, s),)) for t, s in streams.items()}
    )


def _over_time(topic: str, stream: Signal | Markers) -> Chart:
    """Every column of a signal; of markers the distance from where each was seen first."""
    if isinstance(stream, Signal):
        what, unit, count = topic, stream.unit, stream.y.shape[1]
        names, lines = [f"{topic}.{i}" if count > 1 else topic for i in range(count)], stream.y.T
    else:
        what, unit, names = "distance from the first sample", "m", list(stream.names)
        seen = np.isfinite(stream.x).all(axis=2)
        first = stream.x[seen.argmax(axis=0), np.arange(len(names))]
        lines = np.linalg.norm(stream.x - first, axis=2).T
    present = [(name, y, np.isfinite(y)) for name, y in zip(names, lines, strict=True)]
    series = tuple(Series(n, stream.t[at], scale(unit) * y[at]) for n, y, at in present if at.any())
    return Chart(plain_name(topic), topic, "time / s", f"{what} / {shown_unit(unit) or 1}", series)
