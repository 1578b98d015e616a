"""Views and figures of a stored run by name: `result.plot.limits()`."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from validate.library.view_result import ShownView
from validate.parameters import nearest_names
from validate.report.export.table_file import stored_table
from validate.report.long_table import LongTable
from validate.report.stored.exhibit_rows import NOT_SHOWN
from validate.report.stored.folder import MARK
from validate.report.stored.views import PICTURE, Shown, pictures, shown_by_name
from validate.report.views.standard import VIEWS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def views_of(folder: Path) -> Shown:
    """Return what a stored run shows, by the names of `validate show`: form and content."""
    return _stored(folder)[1]


def _stored(folder: Path) -> tuple[LongTable, Shown]:
    changed = (folder / MARK).stat().st_mtime_ns
    return _read(folder, changed, tuple(view.name for view in VIEWS))


@lru_cache(maxsize=4)
def _read(folder: Path, changed: int, views: tuple[str, ...]) -> tuple[LongTable, Shown]:
    table = stored_table(folder, part=NOT_SHOWN)
    return table, shown_by_name(folder, table)


@dataclass(frozen=True, repr=False)
class Plots:
    """What one stored run shows: each name of `validate show` is a method.

    It returns a matplotlib Figure for a chart or a picture; for a table, sentences and several
    charts a `ShownView`, which has `figures()` and `save(path)`. A notebook shows both. `dir()` and
    `list()` give the names.
    """

    _folder: Path

    def __getattr__(self, name: str) -> "Callable[[], Figure | ShownView]":
        """Return what draws the view of that name; raises `AttributeError` with the nearest."""
        if name.startswith("_"):
            raise AttributeError(name)
        table, views = _stored(self._folder)
        if name not in views:
            raise AttributeError(f"no figure '{name}'; {nearest_names(name, set(views))}")
        form, exhibit = views[name]

        def shown() -> "Figure | ShownView":
            from validate.report.stored.figures import figure_of_file, shown_in_notebooks

            view = ShownView(exhibit, table)
            if form == PICTURE:
                return shown_in_notebooks(figure_of_file(pictures(self._folder)[name]))
            figures = view.figures()
            return shown_in_notebooks(figures[0]) if len(figures) == 1 else view

        return shown

    def __iter__(self) -> Iterator[str]:
        return iter(views_of(self._folder))

    def __dir__(self) -> list[str]:
        return sorted(self)

    def __repr__(self) -> str:
        names = [f"  .{name}()" for name in self]
        more = [f"  and {len(names) - 20} more: list(...)"] if len(names) > 20 else []
        return "\n".join([f"{len(names)} views", *names[:20], *more])
