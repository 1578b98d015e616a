"""Columns that are not needed and cannot be used: reported, never in the way."""

from pathlib import Path

import numpy as np
import pytest
from exports import D, F, T, assert_test, read

from validate.errors import RecordingError
from validate.recording.motion_capture.text_rows import LEFT_OUT

SIZES = "Diameter: 25 mm\nHeight: 20 mm\n"
NAMES = "Time (s),Displacement (mm),Load (N)"


def beside(name: str, cell: str, units: str = "") -> str:
    """The test with one more column of equal cells."""
    table = "".join(f"{t:.1f},{d:.5f},{f:.5f},{cell}\n" for t, d, f in zip(T, D, F, strict=True))
    return f"{SIZES}{NAMES},{name}\n{units}{table}"


@pytest.mark.parametrize(
    ("name", "cell", "told"),
    [
        ("Stress (N)", "1", "column 'Stress (N)': 'N' is not a unit of stress"),
        ("Stress (MPa)", "", "column 'Stress (MPa)': empty"),
        ("Strain (%)", "", "column 'Strain (%)': empty"),
        ("Strain (%)", "---", "column 'Strain (%)': empty"),
        ("Strain", "0.1", "column 'Strain': no unit for strain"),
        ("Strain (N)", "0.1", "column 'Strain (N)': 'N' is not a unit of strain"),
        ("Force 2 (V)", "0.1", "column 'Force 2 (V)': 'V' is not a unit of force"),
        ("Force 2 (N)", "", "column 'Force 2 (N)': empty"),
        ("Position", "4", "column 'Position': no unit for displacement"),
        ("Zeit (V)", "4", "column 'Zeit (V)': 'V' is not a unit of time"),
        ("Temperature (C)", "", "column 'Temperature (C)': empty"),
    ],
)
def test_it_is_told_and_the_test_is_read(name: str, cell: str, told: str, tmp_path: Path) -> None:
    recording = read(tmp_path, beside(name, cell))
    assert_test(recording)
    assert recording.record("provenance")[LEFT_OUT] == told


def test_a_column_with_two_units_matters_where_it_is_needed(tmp_path: Path) -> None:
    recording = read(tmp_path, beside("Stress (kPa)", "1", "s,mm,N,MPa\n"))
    assert_test(recording)
    assert "unit 'kPa' in its name, 'MPa' in" in recording.record("provenance")[LEFT_OUT]
    with pytest.raises(RecordingError, match=r"'Load \(N\)': unit 'N' in its name, 'kN'"):
        read(tmp_path, beside("Stress (kPa)", "1", "s,mm,kN,kPa\n"))


def test_one_bad_cell_of_a_derived_column_is_told(tmp_path: Path) -> None:
    lines = beside("Strain (-)", "0.1").split("\n")
    lines[20] = lines[20].replace(",0.1", ",n/a")
    recording = read(tmp_path, "\n".join(lines))
    assert_test(recording)
    told = recording.record("provenance")[LEFT_OUT]
    assert told.startswith("column 'Strain (-)': not compared: line 21, column 'Strain (-)': 'n/a'")


def test_a_bad_cell_of_the_force_is_not_passed_over_for_a_rival(tmp_path: Path) -> None:
    lines = beside("Force 2 (N)", "0.1").split("\n")
    lines[20] = ",".join([*lines[20].split(",")[:2], "n/a", "0.1"])
    with pytest.raises(RecordingError, match=r"line 21, column 'Load \(N\)': 'n/a'"):
        read(tmp_path, "\n".join(lines))


def test_nothing_is_told_where_nothing_is_left(tmp_path: Path) -> None:
    recording = read(tmp_path, beside("Strain (-)", "0").replace(",0\n", ",0.0\n"))
    assert LEFT_OUT not in recording.record("provenance")
    assert np.isfinite(recording.signals["force"].y).all()
