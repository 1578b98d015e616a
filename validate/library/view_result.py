"""View of a stored run as text, part of a notebook's page, figures, or a file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from validate.compare.exhibit import Exhibit
from validate.report.long_table import LongTable
from validate.report.views.drawers import figures, part, save, terminal

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
