"""Sheets of a workbook as text. The only file that imports openpyxl and python_calamine."""

import csv
import io
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import open_file, read_bytes

LIBRARIES = ("openpyxl", "python_calamine")
MOST_BYTES = 512 * 2**20  # unpacked
MOST_CELLS = 20_000_000
_SECTOR = 512  # bytes: an old Excel file is a container of whole sectors


def arrays(path: Path, old: bool = False) -> dict[str, NDArray[Any]]:
    """`names` of the sheets in their order, and the UTF-8 bytes of each by its number from 0.

    A row is a line of cells with tabs between; numbers have a point, formulas their last value.
    `old`: a workbook of old Excel (.xls) or OpenDocument (.ods), else an .xlsx. Raises
    `RecordingError` for what unpacks to more than is sensible, and for a truncated old workbook.
    """
    if old:
        import python_calamine

        data = read_bytes(path)
        if data[:4] == b"PK\x03\x04":
            require_unpacked(path)
        elif len(data) % _SECTOR:
            raise RecordingError(
                f"{len(data)} bytes, not a multiple of its sector size {_SECTOR}: truncated"
            )
        book = python_calamine.CalamineWorkbook.from_path(str(path))
        names = list(book.sheet_names)
        texts = [sheet_text(book.get_sheet_by_name(name).to_python()) for name in names]
    else:
        import openpyxl

        require_unpacked(path)
        with open_file(path) as file:  # by its content: openpyxl refuses names of other endings
            packed = openpyxl.load_workbook(file, read_only=True, data_only=True)
            names = [sheet.title for sheet in packed.worksheets]
            texts = [sheet_text(sheet.iter_rows(values_only=True)) for sheet in packed.worksheets]
    found = {str(i): np.frombuffer(text.encode(), np.uint8) for i, text in enumerate(texts)}
    return {"names": np.array(names, dtype=np.str_), **found}


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
        cells = [("" if value is None else " ".join(str(value).split())) for value in row]
        if any(cells):
            write(cells)
        else:
            out.write("\n")
    return out.getvalue()
