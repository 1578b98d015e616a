"""Sheets of a workbook as text. The only file that imports openpyxl."""

import csv
import io
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import open_file

LIBRARIES = ("openpyxl",)
MOST_BYTES = 512 * 2**20  # unpacked
MOST_CELLS = 20_000_000


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """`names` of the sheets in their order, and the UTF-8 bytes of each by its number from 0.

    A row is a line of cells with tabs between; numbers have a point, formulas their last value.
    Raises `RecordingError` for what unpacks to more than is sensible.
    """
    import openpyxl

    require_unpacked(path)
    with open_file(path) as file:  # by its content: openpyxl refuses names of other endings
        book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        texts = [sheet_text(sheet.iter_rows(values_only=True)) for sheet in book.worksheets]
    found = {str(i): np.frombuffer(text.encode(), np.uint8) for i, text in enumerate(texts)}
    return {"names": np.array([s.title for s in book.worksheets], dtype=np.str_), **found}


def require_unpacked(path: Path) -> None:
    """Raise `RecordingError` for what unpacks to more than is sensible."""
    with zipfile.ZipFile(path) as packed:
        size = sum(member.file_size for member in packed.infolist())
    if size > MOST_BYTES:
        raise RecordingError(f"a workbook of {size} bytes unpacked, the limit is {MOST_BYTES}")


def sheet_text(rows: Iterable[Sequence[Any]]) -> str:
    """Rows of values as lines with tabs between."""
    out, count = io.StringIO(), 0
    write = csv.writer(out, delimiter="\t", lineterminator="\n").writerow
    for row in rows:
        count += len(row)
        if count > MOST_CELLS:
            raise RecordingError(f"a sheet of more than {MOST_CELLS} cells")
        cells = [_cell(value) for value in row]
        if any(cells):
            write(cells)
        else:
            out.write("\n")
    return out.getvalue()


def _cell(value: object) -> str:
    return "" if value is None else " ".join(str(value).split())
