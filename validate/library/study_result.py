"""Result of a stored study: answer, table of cells, figures."""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from validate.checksums import read_sealed
from validate.display import Screen
from validate.files import LARGEST, read_text
from validate.library.plots import Plots, plots_of
from validate.report.long_table import frame
from validate.report.stored.folder import MARK
from validate.report.stored.json_values import Json

if TYPE_CHECKING:
    from pandas import DataFrame


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
