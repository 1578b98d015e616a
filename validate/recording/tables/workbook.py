"""Reader of testing machines' workbooks (.xlsx, .xls, .ods), and every specimen of an export.

The sheet is read with the same parser as text exports. The only file that imports openpyxl and
python_calamine; `arrays` runs in a subprocess.
"""

import csv
import io
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.errors import RecordingError, UsageError
from validate.files import open_file, read_bytes
from validate.recording.formats.subprocess_decoder import decoded
from validate.recording.reader import MapOption, Options, Reader, head
from validate.recording.tables.blocks import parse_tables
from validate.recording.tables.columns import OPTIONS, role_of
from validate.recording.tables.specimens import chosen, specimen_tables
from validate.recording.tables.table import Table, whole_file
from validate.recording.tables.testing_machine import INSTRON, recording_of
from validate.recording.types import Recording

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


_OPTIONS = (*OPTIONS, MapOption("sheet", "sheet of the workbook", default="the one with a test"))
ALL = "all"  # --map specimen=all
_WORKBOOK = "xl/workbook.xml"
_ARCHIVE = b"PK\x03\x04"
_CONTAINER = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_OPEN_DOCUMENT = b"application/vnd.oasis.opendocument.spreadsheet"


@dataclass(frozen=True)
class _Sheet:
    """A sheet's tables by specimen; none and why where it holds no table."""

    name: str
    tables: Mapping[str, Table]
    why: str = ""

    @property
    def is_test(self) -> bool:
        return any(
            {"force", "displacement"} <= {role_of(c) for c in t.columns}
            for t in self.tables.values()
        )


def read_xlsx(path: Path, options: Options) -> Recording:
    """Return the sheet of a workbook that holds displacement and force, as `instron.read_instron`
    reads text, with its options and `sheet` (a name) where several hold a test.

    The other sheets are named in the notes. Raises as it does, `UsageError` for an unknown sheet
    and without the library, `RecordingError` where no sheet holds a table, or several hold a test
    and none is named.
    """
    return _read(path, options)


def read_sheets(path: Path, options: Options) -> Recording:
    """`read_xlsx` of a workbook of old Excel or OpenDocument."""
    return _read(path, options, old=True)


def _read(path: Path, options: Options, *, old: bool = False) -> Recording:
    said = {key: value for key, value in options.items() if key != "sheet"}
    data = whole_file(path)
    try:
        sheets = _sheets(path, options, old)
        sheet = _chosen(sheets, options.get("sheet"))
        label, table = chosen(sheet.tables, said.get("specimen"))
        others = [f"sheet '{s.name}' not used" for s in sheets if s is not sheet]
        table = replace(
            table,
            encoding=f"sheet '{sheet.name}'",
            encoding_why="of a workbook",
            notes=(*table.notes, *others),
        )
        return recording_of(path, data, table, said, label, "workbook")
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error}") from error
    except UsageError as error:
        raise UsageError(f"{path.name}: {error}") from error


def specimens_in_book(path: Path, options: Options) -> dict[str, Options]:
    """What chooses each specimen, by its label: those of the sheet that is named or alone holds a
    test, else of all sheets that do; raises as `read_xlsx`."""
    try:
        tests = _tests(_sheets(path, options, not _is_workbook(path)), options.get("sheet"))
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error}") from error
    one = len(tests) == 1
    return {
        label if one else s.name if len(s.tables) == 1 else f"{s.name}-{label}":
        {"sheet": s.name, "specimen": label} for s in tests for label in s.tables
    }  # fmt: skip


def _sheets(path: Path, options: Options, old: bool) -> list[_Sheet]:
    found = decoded("validate.recording.tables.workbook", path, {"old": float(old)})
    texts = {str(name): found[str(i)].tobytes() for i, name in enumerate(found["names"])}
    sheets = []
    for name, text in texts.items():
        try:
            tables = specimen_tables(parse_tables(text, "utf-8", options.get("decimal") or "."))
            sheets.append(_Sheet(name, tables))
        except RecordingError as error:
            sheets.append(_Sheet(name, {}, str(error)))
    return sheets


def _chosen(sheets: list[_Sheet], said: str | None) -> _Sheet:
    tests = _tests(sheets, said)
    if len(tests) > 1:
        held = ", ".join(f"'{s.name}'" for s in tests[:8])
        raise RecordingError(
            f"{len(tests)} sheets may hold the test: {held}; choose one with "
            f"--map 'sheet={tests[0].name}'; import takes all as repeats with specimen={ALL}"
        )
    return tests[0]


def _tests(sheets: list[_Sheet], said: str | None) -> list[_Sheet]:
    """The sheet that is named, else those that hold a test, else those that hold a table."""
    names = ", ".join(f"'{s.name}'" for s in sheets[:8])
    if said is not None:
        named = [s for s in sheets if s.name == said]
        if not named:
            raise UsageError(f"--map sheet={said}: unknown sheet; the workbook has {names}")
        if not named[0].tables:
            raise RecordingError(f"sheet '{said}': {named[0].why}")
        return named
    tests = [s for s in sheets if s.is_test] or [s for s in sheets if s.tables]
    if not tests:
        why = sheets[0].why if sheets else "no sheet"
        raise RecordingError(f"no table in the sheets {names} of this workbook: {why}")
    return tests


def _is_workbook(path: Path) -> bool:
    return _packs(path, _WORKBOOK)


def _packs(path: Path, name: str, holding: bytes = b"") -> bool:
    """Whether it is an archive with a member that begins so."""
    if not head(path, 4).startswith(_ARCHIVE):
        return False
    try:
        with zipfile.ZipFile(path) as packed, packed.open(name) as member:
            return member.read(len(holding)) == holding
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError, KeyError, RuntimeError):
        return False


def _is_other_workbook(path: Path) -> bool:
    if head(path, 8) == _CONTAINER:
        return any(name in _first_names(path) for name in ("Workbook", "Book"))
    return _packs(path, "mimetype", _OPEN_DOCUMENT)


def _first_names(path: Path) -> list[str]:
    """Names in the first directory sector of a compound file ([MS-CFB] 2.2, 2.6)."""
    with open_file(path) as file:
        start = file.read(52)
        size = 1 << min(int.from_bytes(start[30:32], "little"), 12)
        file.seek((int.from_bytes(start[48:52], "little") + 1) * size)
        sector = file.read(size)
    entries = [sector[i : i + 64] for i in range(0, len(sector), 128)]
    return [e.decode("utf-16-le", "replace").partition("\0")[0] for e in entries]


XLSX = Reader(
    "xlsx",
    "a testing machine's export, workbook",
    _is_workbook,
    read_xlsx,
    "it is an archive with a workbook",
    options=_OPTIONS,
    extensions=(".xlsx",),
)

SHEETS = Reader(
    "sheets",
    "a testing machine's export, workbook of old Excel (.xls) or OpenDocument (.ods)",
    _is_other_workbook,
    read_sheets,
    "it is a container or archive with a workbook",
    options=_OPTIONS,
    extensions=(".xls", ".ods"),
)


def every_specimen(reader: Reader, path: Path, options: Options) -> list[Recording]:
    """Return a recording of each specimen, named by its label; raises as the reader, and
    `UsageError` for one of another format."""
    if reader in (XLSX, SHEETS):
        chosen = specimens_in_book(path, options)
    elif reader is INSTRON:
        said = (options.get("encoding"), options.get("decimal"))
        tables = specimen_tables(parse_tables(whole_file(path), *said))
        chosen = {label: {"specimen": label} for label in tables}
    else:
        raise UsageError(
            f"--map specimen={ALL}: {path.name} is {reader.doc}, which has no specimens"
        )
    logs = {label: reader.read(path, {**options, **one}) for label, one in chosen.items()}
    return [replace(log, name=f"{log.name}-{label}") for label, log in logs.items()]
