"""Result of a stored study: answer, table of cells, figures."""

import csv
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from validate.checksums import read_sealed
from validate.display import Screen, listed
from validate.errors import UsageError
from validate.files import LARGEST, read_text
from validate.library.plots import Plots, plots_of
from validate.parameters import nearest_names
from validate.report.export.fields import as_dataset
from validate.report.long_table import frame
from validate.report.stored.folder import MARK
from validate.report.stored.json_values import Json

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

_COMBINATIONS = 1_000_000


@dataclass(frozen=True, repr=False)
class StudyResult:
    """One finished study: its answer, and the content of its `folder`.

    `found` is the answer in SI as `results.json` has it under "study". It can be pickled.
    """

    folder: Path
    content: Json = field(hash=False)

    @property
    def sentence(self) -> str:
        """The answer in words."""
        return str(self.content["sentence"])

    @property
    def found(self) -> Any:
        """The study's part of results.json, SI; its members depend on the kind of study."""
        return self.content["study"]

    @property
    def report(self) -> Path:
        """The report as a page."""
        return self.folder / "report.html"

    @property
    def plot(self) -> Plots:
        """The figures by name, as matplotlib Figures."""
        return plots_of(self.folder)

    def cells(self) -> tuple[tuple[str | float, ...], ...]:
        """Return the rows of `tables/cells.csv`, the head first: texts and numbers."""
        file = self.folder / "tables" / "cells.csv"
        lines = csv.reader(read_text(file, LARGEST).splitlines())
        return tuple(tuple(_value(cell) for cell in line) for line in lines)

    def to_pandas(self) -> "DataFrame":
        """Return one row a cell; raises `UsageError` where pandas is not installed."""
        head, *rows = self.cells() or ((),)
        present = [tuple(None if cell == "" else cell for cell in row) for row in rows]
        return frame(present, tuple(map(str, head)))

    def to_xarray(self, *over: str) -> "Dataset":
        """Return the cells as a Dataset with a dimension for each of the columns `over`.

        By default these are the first columns that tell all cells apart, but for those of one value
        only. A combination without a cell is NaN, and so is the coordinate of a cell that has no
        value in a column, as that of a baseline. Raises `UsageError` for a column
        that the table does not have, for columns that do not tell the cells apart, for more than
        a million combinations, and without pandas or xarray.
        """
        cells = self.to_pandas()
        names = [str(c) for c in cells.columns]
        for name in over:
            if name not in names:
                raise UsageError(f"no column '{name}' of cells; {nearest_names(name, {*names})}")
        varied = [c for c in names if cells[c].nunique(dropna=False) > 1]
        leading = (varied[:i] for i in range(1, len(varied) + 1))
        apart = (some for some in leading if not cells.duplicated(some).any())
        along = [*over] or next(apart, [])
        if not along or cells.duplicated(along).any():
            raise UsageError(
                f"{len(cells)} cells are not told apart by {listed(along) or 'any column'}; name "
                f"the columns that were varied, of {listed(names)}"
            )
        count = math.prod(cells[c].nunique(dropna=False) for c in along)
        if count > _COMBINATIONS:
            raise UsageError(
                f"{count} combinations of {listed(along)}, at most {_COMBINATIONS}: name fewer "
                "columns, or select among the rows of to_pandas()"
            )
        return as_dataset(cells, along)

    @property
    def _screen(self) -> Screen:
        head, *rows = self.cells() or ((),)
        short = tuple(tuple(_short(cell) for cell in row[:8]) for row in rows)
        below = (f"report: {self.report}",)
        return Screen(
            str(self.content["title"]), (self.sentence,), tuple(map(str, head[:8])), short, below
        )

    def __repr__(self) -> str:
        return self._screen.text

    def _repr_html_(self) -> str:
        return self._screen.html


def _value(cell: str) -> str | float:
    try:
        return float(cell)
    except ValueError:
        return cell


def _short(cell: str | float) -> str:
    """A number with four digits, a text with 24 letters."""
    if isinstance(cell, float):
        return f"{cell:.4g}"
    return cell if len(cell) <= 24 else f"{cell[:20]} ..."


def stored_study(page: Path) -> StudyResult:
    """Return the study whose report is `page`; raises `RecordingError` for an edited one."""
    return StudyResult(page.parent, read_sealed(page.parent / MARK))
