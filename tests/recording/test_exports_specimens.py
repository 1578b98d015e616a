"""Several specimens in one export, rows written twice, columns that end early."""

from pathlib import Path

import numpy as np
import pytest
from exports import D, F, T, assert_test, comma, read, rows

from validate.errors import RecordingError, UsageError
from validate.recording.tables.specimens import _group, column_groups
from validate.recording.tables.table import Column, Table

# private: _group: called alone, case by case.

NAMES = "Time (s),Extension (mm),Load (N)\n"
LINES = rows().splitlines(keepends=True)
PAIRS = list(zip(T, D, F, strict=True))
GROUP = "Time,Extension,Load"

SIDE = (
    "Specimen 1,,,,Specimen 2,,\n" + f"{GROUP},,{GROUP}\ns,mm,N,,s,mm,N\n"
    + "".join(f"{t},{d:.5f},{f:.5f},,{t},{d:.5f},{2 * f:.5f}\n" for t, d, f in PAIRS)
)  # fmt: skip
NUMBERED = "Time 1 (s),Ext 1 (mm),Load 1 (N),Time 2 (s),Ext 2 (mm),Load 2 (N)\n".replace(
    "Ext ", "Extension "
) + "".join(f"{t},{d:.5f},{f:.5f},{t},{d:.5f},{2 * f:.5f}\n" for t, d, f in PAIRS)
STACKED = (
    "Compression test\nDiameter: 25mm\nSpecimen 1\n" + NAMES + rows()
    + "\nSpecimen 2\nDiameter: 26mm\n" + NAMES + rows(f=2 * F)
)  # fmt: skip
ONE_HEAD = NAMES + "Specimen 1\n" + rows() + "Specimen 2\n" + rows(f=2 * F)
COLUMN = (
    "Specimen,"
    + NAMES
    + "".join(f"A{k},{line}\n" for k in (1, 2) for line in rows(f=k * F).splitlines())
)
ZWICK = "".join(
    f"Probe {k}\nPrüfzeit;Standardweg;Standardkraft\ns;mm;N\n" + rows(";", comma, f=k * F)
    for k in (1, 2)
)  # fmt: skip
TRAPEZIUM = (
    '"1 _ 1","","","1 _ 2","",""\nTime,Stroke,Force,Time,Stroke,Force\nsec,mm,N,sec,mm,N\n'
    + "".join(f"{t},{d:.5f},{f:.5f},{t},{d:.5f},{2 * f:.5f}\n" for t, d, f in PAIRS)
)
FILES = {
    "side by side": (SIDE, "'1' .*'2' "),
    "numbered names": (NUMBERED, "'1' .*'2' "),
    "below each other": (STACKED, "'1' .*names in line 4.*'2' "),
    "one head": (ONE_HEAD, "'1' .*'2' "),
    "a column": (COLUMN, "'A1' .*'A2' "),
    "testxpert": (ZWICK, "'1' .*'2' "),
    "trapezium": (TRAPEZIUM, "'1 _ 1' .*'1 _ 2' "),
}


@pytest.mark.parametrize("name", FILES)
def test_several_specimens_are_named_and_chosen(name: str, tmp_path: Path) -> None:
    text, listed = FILES[name]
    with pytest.raises(RecordingError, match=f"2 specimens in one file: {listed}.*specimen="):
        read(tmp_path, text)
    assert_test(read(tmp_path, text, specimen="1"))
    assert_test(read(tmp_path, text, specimen="2"), f=2 * F)
    with pytest.raises(UsageError, match="specimen=9: unknown specimen"):
        read(tmp_path, text, specimen="9")


def test_each_specimen_has_its_own_header_over_the_common_one(tmp_path: Path) -> None:
    first, second = (
        read(tmp_path, STACKED, test=None, specimen=k).record("specimen") for k in "12"
    )
    assert float(first["diameter_m"]) == pytest.approx(0.025)
    assert float(second["diameter_m"]) == pytest.approx(0.026)
    assert first["test"] == second["test"] == "compression"


def test_a_shorter_specimen_ends_where_its_cells_end(tmp_path: Path) -> None:
    lines = SIDE.splitlines(keepends=True)
    for cut in (",,,", ""):
        rest = [",".join(line.split(",")[:3]) + cut + "\n" for line in lines[33:]]
        text = "".join(lines[:33] + rest)
        assert_test(read(tmp_path, text, specimen="1"))
        assert_test(read(tmp_path, text, specimen="2"), D[:30], 2 * F[:30])


def test_no_time_column_and_two_specimens(tmp_path: Path) -> None:
    text = "Extension,Load,Extension,Load\nmm,N,mm,N\n" + "".join(
        f"{d:.5f},{f:.5f},{d:.5f},{2 * f:.5f}\n" for _, d, f in PAIRS
    )
    with pytest.raises(RecordingError, match=r"no time column.*every"):
        read(tmp_path, text, specimen="2")
    assert_test(read(tmp_path, text, specimen="2", time="every:0.1s"), f=2 * F)


def test_a_damaged_specimen_is_refused_and_the_others_are_read(tmp_path: Path) -> None:
    text = COLUMN.replace("A2,3.00000", "A2,2.00000")
    with pytest.raises(RecordingError, match="line 72: time runs backward"):
        read(tmp_path, text, specimen="A2")
    assert_test(read(tmp_path, text, specimen="A1"))


def test_names_repeated_on_every_page_are_one_test(tmp_path: Path) -> None:
    text = NAMES + "".join(LINES[:20]) + NAMES + "".join(LINES[20:])
    recording = read(tmp_path, text)
    assert_test(recording)
    assert "names repeated in line 22" in recording.record("provenance")["besides"]


@pytest.mark.parametrize("count", [1, 3])
def test_first_rows_written_twice_are_used_once_and_told(count: int, tmp_path: Path) -> None:
    recording = read(tmp_path, NAMES + "".join(LINES[:count] + LINES))
    assert_test(recording)
    assert f"{count} first rows" in recording.record("provenance")["besides"]


def test_equal_rows_without_time_are_samples(tmp_path: Path) -> None:
    text = (
        "Extension (mm),Load (N)\n"
        + "0.0,-0.03125\n" * 2
        + "".join(f"{d:.5f},{f:.5f}\n" for _, d, f in PAIRS[1:])
    )
    assert len(read(tmp_path, text, time="every:0.1s").signals["force"].t) == 41


def test_rows_of_one_time_need_a_word(tmp_path: Path) -> None:
    text = NAMES + "0.00000,0.00000,0.01\n" + rows()
    with pytest.raises(RecordingError, match=r"time stands still.*repeated=last"):
        read(tmp_path, text)
    assert_test(read(tmp_path, text, repeated="last"))
    first = read(tmp_path, text, repeated="first")
    assert first.signals["force"].y[0, 0] == 0.01
    assert "1 rows left out" in first.record("provenance")["besides"]


def test_sparse_trailing_columns_are_told_and_a_cut_row_is_not_one(tmp_path: Path) -> None:
    names = "Time (s),Extension (mm),Load (N),Strain 1 (%),Temperature (C)\n"
    lines = [line.strip() + (",0.1,22" if i % 5 == 0 else "") for i, line in enumerate(LINES)]
    recording = read(tmp_path, names + "\n".join(lines) + "\n")
    assert_test(recording)
    assert "columns with gaps: Strain 1 (%)" in recording.record("provenance")["besides"]
    lines = [line.strip() + ("" if i == 30 else ",0.1,22") for i, line in enumerate(LINES)]
    with pytest.raises(RecordingError, match=r"line 32: 3 cells.*line 1 names 5 columns"):
        read(tmp_path, names + "\n".join(lines) + "\n")
    lines = [line.strip() if i % 2 else line.rpartition(",")[0] for i, line in enumerate(LINES)]
    with pytest.raises(RecordingError, match="'' is not a number"):
        read(tmp_path, NAMES + "\n".join(lines) + "\n")


def test_remarks_beside_the_table_are_told(tmp_path: Path) -> None:
    lines = [line.strip() + (",start" if i == 3 else "") for i, line in enumerate(LINES)]
    recording = read(tmp_path, NAMES + "\n".join(lines) + "\n")
    assert_test(recording)
    assert "right of the table: 1 rows, first line 5" in recording.record("provenance")["besides"]


@pytest.mark.parametrize("at", [5, 20, 35])
def test_words_amid_the_rows_never_end_a_test(at: int, tmp_path: Path) -> None:
    text = NAMES + "".join([*LINES[:at], "Pause,by,operator\n", *LINES[at:]])
    with pytest.raises(RecordingError, match="Pause"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("labels", "groups"),
    [
        (["Time", "Load", "Time", "Load"], [[0, 1], [2, 3]]),
        (["Time", "Load", "", "Time", "Load"], [[0, 1], [3, 4]]),
        (["Time", "Load 1", "Ext 1", "Load 2", "Ext 2"], [[0, 1, 2], [0, 3, 4]]),
        (["Time", "Disp", "Load 1", "Load 2"], [[0, 1, 2, 3]]),
        (["Time", "Load"], [[0, 1]]),
    ],
)
def test_column_groups(labels: list[str], groups: list[list[int]]) -> None:
    assert column_groups(labels) == groups


def test_an_idle_sensor_is_no_rival(tmp_path: Path) -> None:
    table = "".join(f"{t},{d:.5f},{f:.5f},0.0\n" for t, d, f in PAIRS)
    assert_test(read(tmp_path, "Time (s),Stroke (mm),Force (N),Deflection (mm)\n" + table))
    moving = "".join(f"{t},{d:.5f},{f:.5f},{np.sqrt(d):.5f}\n" for t, d, f in PAIRS)
    with pytest.raises(RecordingError, match="2 different columns may be displacement"):
        read(tmp_path, "Time (s),Stroke (mm),Force (N),Deflection (mm)\n" + moving)


def test_a_specimen_goes_on_while_any_of_its_columns_does() -> None:
    cells = {
        "Time": ("0", "1", "2", "3"),
        "Load 1": ("1", "2", "3", ""),
        "Way 1": ("1", "2", "", ""),
    }
    columns = tuple(Column(name, name, None, c) for name, c in cells.items())
    table = Table({}, columns, (2, 3, 4, 5), 1, "utf-8", "", ",", ".")
    assert _group(table, (0, 1, 2), "1").lines == (2, 3, 4)  # the common time alone goes on
    assert _group(table, (1, 2), "").lines == (2, 3, 4)
