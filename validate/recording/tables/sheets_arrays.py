"""Sheets of workbooks other than .xlsx as text. The only file that imports python_calamine."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError
from validate.files import read_bytes
from validate.recording.tables.xlsx_arrays import require_unpacked, sheet_text

LIBRARIES = ("python_calamine",)
_SECTOR = 512  # bytes: an old Excel file is a container of whole sectors


def arrays(path: Path) -> dict[str, NDArray[Any]]:
    """As `xlsx_arrays.arrays`, of a workbook of old Excel (.xls) or OpenDocument (.ods)."""
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
    found = {str(i): np.frombuffer(text.encode(), np.uint8) for i, text in enumerate(texts)}
    return {"names": np.array(names, dtype=np.str_), **found}
