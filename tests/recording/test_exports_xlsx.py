"""A testing machine's workbook, written by openpyxl, xlwt, odfpy: the same numbers as its text."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pytest
import xlwt
from children import lacking
from exports import D, F, T, assert_test
from odf.opendocument import OpenDocumentSpreadsheet
from odf.table import Table, TableCell, TableRow
from odf.text import P

from validate.errors import RecordingError, UsageError
from validate.installation import install_command
from validate.recording.formats import subprocess_decoder
from validate.recording.readers import recognised
from validate.recording.tables import workbook
from validate.recording.tables.workbook import (
    _chosen,
    _Sheet,
    _tests,
    every_specimen,
    read_sheets,
    read_xlsx,
)

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _Sheet, _chosen, _tests: sheets of a known kind.

TABLE = [["Time", "Stauchung", "Kraft"], ["s", "mm", "N"]]
SAMPLES = [[float(t), float(d), float(f)] for t, d, f in zip(T, D, F, strict=True)]
TEST = [["Durchmesser", 25.0, "mm"], ["Probenhöhe", "20 mm"], [], *TABLE, *SAMPLES]


def written(folder: Path, **sheets: list[list[object]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, cells in sheets.items():
        sheet = book.create_sheet(name)
        for row in cells:
            sheet.append(row)
    book.save(folder / "log.xlsx")
    return folder / "log.xlsx"


def test_the_first_sheet_with_a_test_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, Info=[["made by", 'a "machine"\tof 2\nlines']], Data=TEST)
    assert recognised(path).name == "xlsx"
    recording = read_xlsx(path, {})
    assert_test(recording)
    force = recording.signals["force"].y[:, 0]
    assert np.allclose(force, F, rtol=1e-15, atol=0)  # 16 digits are written
    specimen = recording.record("specimen")
    assert float(specimen["diameter_m"]) == pytest.approx(0.025)
    assert float(specimen["height_m"]) == pytest.approx(0.020)
    assert specimen["test"] == "compression"
    provenance = recording.record("provenance")
    assert provenance["text"].startswith("sheet 'Data' (of a workbook)")
    assert "sheet 'Info' not used" in provenance["besides"]
    assert recording.source.bytes == path.stat().st_size


def test_specimens_on_sheets_of_their_own_are_all_taken(tmp_path: Path) -> None:
    """Testing machines write each specimen on a sheet: `specimen=all` was refused."""
    doubled = [[*r[:2], 2 * r[2]] for r in SAMPLES]
    path = written(tmp_path, Info=[["words"]], A=[*TABLE, *SAMPLES], B=[*TABLE, *doubled])
    said = {"test": "compression", "specimen": "all"}
    a, b = every_specimen(recognised(path), path, said)
    assert (a.name, b.name) == ("log-A", "log-B")
    assert_test(a)
    assert_test(b, f=2 * F)
    english = [["Time", "Position", "Force"], ["s", "mm", "N"], *SAMPLES]
    asking = written(tmp_path, A=english)
    with pytest.raises(UsageError, match=r"log.xlsx: unclear whether compression or"):
        read_xlsx(asking, {})
    path = written(tmp_path, A=[*TABLE, *SAMPLES], B=[*TABLE, *doubled])
    (alone,) = every_specimen(recognised(path), path, {**said, "sheet": "B"})
    assert_test(alone, f=2 * F)
    with pytest.raises(RecordingError, match=r"log.xlsx: no table in the sheets 'A'"):
        every_specimen(recognised(path), written(tmp_path, A=[["words"]]), said)


@pytest.mark.slow
def test_several_sheets_with_a_test_are_asked_for(tmp_path: Path) -> None:
    doubled = [[*r[:2], 2 * r[2]] for r in SAMPLES]
    path = written(tmp_path, A=[*TABLE, *SAMPLES], B=[*TABLE, *doubled], C=[["words"]])
    with pytest.raises(RecordingError, match=r"2 sheets.*'A', 'B'.*sheet=A"):
        read_xlsx(path, {})
    assert_test(read_xlsx(path, {"sheet": "B"}), f=2 * F)
    with pytest.raises(UsageError, match=r"sheet=X.*'A', 'B', 'C'"):
        read_xlsx(path, {"sheet": "X"})
    with pytest.raises(RecordingError, match=r"log\.xlsx.*'C'"):
        read_xlsx(path, {"sheet": "C"})


def test_lines_of_errors_are_rows_of_the_sheet(tmp_path: Path) -> None:
    bad = [list(row) for row in TEST]
    bad[19][2] = None
    with pytest.raises(RecordingError, match=r"log\.xlsx: line 20, column 'Kraft': ''"):
        read_xlsx(written(tmp_path, Data=bad), {})


def test_a_workbook_without_a_table_says_so(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no table in the sheets 'Data'"):
        read_xlsx(written(tmp_path, Data=[["words"]]), {})


def test_what_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, Data=TEST)
    monkeypatch.setattr(workbook, "MOST_CELLS", 50)
    with pytest.raises(RecordingError, match="more than 50 cells"):
        workbook.arrays(path)
    monkeypatch.setattr(workbook, "MOST_BYTES", 100)
    with pytest.raises(RecordingError, match="bytes unpacked, the limit is 100"):
        workbook.arrays(path)


@pytest.mark.own_process
def test_without_the_library_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, Data=TEST)
    monkeypatch.setattr(subprocess_decoder, "python_module", lacking("openpyxl"))
    with pytest.raises(UsageError, match=f"openpyxl.*{re.escape(install_command())}"):
        read_xlsx(path, {})


def as_xls(path: Path) -> None:
    book = xlwt.Workbook()
    book.add_sheet("Info").write(0, 0, "made by a machine")
    sheet = book.add_sheet("Data")
    for i, row in enumerate(TEST):
        for k, cell in enumerate(row):
            sheet.write(i, k, cell)
    book.save(str(path))


def as_ods(path: Path) -> None:
    book = OpenDocumentSpreadsheet()
    sheet = Table(name="Data")
    for cells in TEST:
        row = TableRow()
        for value in cells:
            kind = "float" if isinstance(value, float) else "string"
            shown = {"value": value} if kind == "float" else {}
            cell = TableCell(valuetype=kind, **shown)
            cell.addElement(P(text=str(value)))
            row.addElement(cell)
        sheet.addElement(row)
    book.spreadsheet.addElement(sheet)
    book.save(str(path))


@pytest.mark.parametrize("write", [as_xls, as_ods])
def test_other_workbooks_are_read_alike(write: Callable[[Path], None], tmp_path: Path) -> None:
    path = tmp_path / "log.bin"
    write(path)
    assert recognised(path).name == "sheets"
    recording = read_sheets(path, {})
    assert_test(recording)
    assert np.allclose(recording.signals["force"].y[:, 0], F, rtol=1e-15, atol=0)
    assert float(recording.record("specimen")["diameter_m"]) == pytest.approx(0.025)
    assert recording.record("provenance")["text"].startswith("sheet 'Data' (of a workbook)")


def test_other_documents_in_such_containers_are_none(tmp_path: Path) -> None:
    whole = tmp_path / "log.xls"
    as_xls(whole)
    data = whole.read_bytes()
    whole.write_bytes(data.replace("Workbook".encode("utf-16-le"), "Document".encode("utf-16-le")))
    with pytest.raises(UsageError, match="unknown format"):
        recognised(whole)
    whole.write_bytes(data[:20])
    with pytest.raises(UsageError, match="unknown format"):
        recognised(whole)


def test_a_displacement_field_is_no_test(tmp_path: Path) -> None:
    """Its displacements were a signal over time, by following the advice."""
    cells = [["X [mm]", "Y [mm]", "displacement [mm]", "exx"]]
    cells += [[float(x), float(y), 0.1 * x, 0.01] for y in range(4) for x in range(5)]
    path = written(tmp_path, Data=cells)
    for said in ({}, {"time": "every:0.1s", "force": "none"}):
        with pytest.raises(RecordingError, match="20 rows of X, Y, displacement, exx"):
            read_xlsx(path, said)
    timed = [["Time [s]", *cells[0]], *([0.1 * i, *row] for i, row in enumerate(cells[1:]))]
    assert read_xlsx(written(tmp_path, Data=timed), {"force": "none"}).signals.keys() == {
        "displacement"
    }


def test_an_old_workbook_that_is_cut_within_a_sector_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.xls").write_bytes(bytes(1000))
    with pytest.raises(RecordingError, match=r"1000 bytes.*size 512: truncated"):
        workbook.arrays(tmp_path / "x.xls", old=True)


def test_a_sheet_that_is_named_and_has_no_table_is_reported() -> None:
    sheets = [_Sheet("notes", {}, "no line of names"), _Sheet("test", {})]
    with pytest.raises(RecordingError, match="sheet 'notes': no line of names"):
        _tests(sheets, "notes")
    with pytest.raises(UsageError, match="sheet=log: unknown sheet; the workbook"):
        _tests(sheets, "log")
    with pytest.raises(RecordingError, match="sheets 'notes', 'test'"):
        _tests(sheets, None)
    with pytest.raises(RecordingError, match=r"in the sheets  of this workbook"):
        _tests([], None)


def test_two_sheets_that_may_contain_the_test_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    sheets = [_Sheet("first", {"": None}), _Sheet("second", {"": None})]  # type: ignore[dict-item]
    monkeypatch.setattr(_Sheet, "is_test", property(lambda self: True))
    with pytest.raises(RecordingError, match=r"2 sheets.*'first', 'second'"):
        _chosen(sheets, None)
    assert _chosen(sheets, "second").name == "second"
