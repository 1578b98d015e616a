"""Figures of a stored run by name: `result.plot.limits()`."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from validate.parameters import nearest_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[[], "Figure"]


def views_of(folder: Path) -> Mapping[str, Draw]:
    """Return what draws each figure of a stored run, by name: charts of the views that have rows,
    and what its report shows besides."""
    from validate.report.stored.figures import stored_figures

    return stored_figures(folder)


@dataclass(frozen=True, repr=False)
class Plots:
    """The figures of one stored run: each name is a method that returns a matplotlib Figure.

    A notebook shows the figure. `dir()` and `list()` give the names.
    """

    _folder: Path

    def __getattr__(self, name: str) -> Draw:
        """Return what draws the figure of that name; raises `AttributeError` with the nearest."""
        if name.startswith("_"):
            raise AttributeError(name)
        views = views_of(self._folder)
        if name not in views:
            raise AttributeError(f"no figure '{name}'; {nearest_names(name, set(views))}")
        draw = views[name]

        def shown() -> "Figure":
            from validate.report.stored.figures import shown_in_notebooks

            return shown_in_notebooks(draw())

        return shown

    def __iter__(self) -> Iterator[str]:
        return iter(views_of(self._folder))

    def __dir__(self) -> list[str]:
        return sorted(self)

    def __repr__(self) -> str:
        names = [f"  .{name}()" for name in self]
        more = [f"  and {len(names) - 20} more: list(...)"] if len(names) > 20 else []
        return "\n".join([f"{len(names)} figures", *names[:20], *more])
