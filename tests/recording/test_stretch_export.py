"""Stress against stretch as text: units, senses, planes, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from validate.errors import RecordingError
from validate.recording.tables.stretch import read_stretch_stress

ROWS = "1,0\n1.25,0.2\n1.5,0.31\n2,0.48\n2.5,0.7\n"


def written(folder: Path, text: str, name: str = "rubber_uniaxial.csv") -> Path:
    path = folder / name
    path.write_text(text, "utf-8")
    return path


def test_a_curve_is_read_in_pascal(tmp_path: Path) -> None:
    found = read_stretch_stress(written(tmp_path, f"stretch_[-],nominal_stress_[MPa]\n{ROWS}"))
    assert found.signal("stretch", "1").y[:, 0].tolist() == [1, 1.25, 1.5, 2, 2.5]
    assert found.signal("stress", "Pa").y[:, 0] == pytest.approx([0, 2e5, 3.1e5, 4.8e5, 7e5])
    assert found.record("provenance")["stress unit"] == "MPa, from the header"


def test_a_unit_that_the_file_does_not_state_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, f"stretch,nominal_stress\n{ROWS}")
    with pytest.raises(RecordingError, match=r"'nominal_stress'.* --set unit=MPa"):
        read_stretch_stress(path)
    assert read_stretch_stress(path, "kPa").signal("stress", "Pa").y.max() == pytest.approx(700)
    with pytest.raises(RecordingError, match="'mm' is not a unit of stress"):
        read_stretch_stress(path, "mm")


def test_a_plane_has_two_of_both(tmp_path: Path) -> None:
    head = "stretch_1_[-],stretch_2_[-],nominal_stress_1_[MPa],nominal_stress_2_[MPa]\n"
    rows = "1.1,1,0.14,0.07\n1.1,1.1,0.2,0.2\n1.5,1,0.4,0.2\n1.5,1.2,0.45,0.3\n1.5,1.5,0.5,0.5\n"
    found = read_stretch_stress(written(tmp_path, head + rows))
    assert found.signal("stretch", "1").y[3].tolist() == [1.5, 1.2]
    assert found.signal("stress", "Pa").y[3] == pytest.approx([4.5e5, 3e5])


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (f"stretch,load_[N]\n{ROWS}", "1 columns of stretch and 0 of stress"),
        ("stretch,stress_[kPa]\n0,0\n25,2\n50,3\n75,4\n", "line 2: stretch 0"),
        ("stretch,stress_[kPa]\n1,0\n25,2\n50,3\n75,4\n", "is it a strain in per cent"),
        ("stretch,stress_[kPa]\n1,0\n.9,2\n.8,3\n.7,4\n", "differ in sign in 3 of 4 rows"),
    ],
)
def test_what_is_no_such_curve_is_refused(tmp_path: Path, text: str, match: str) -> None:
    with pytest.raises(RecordingError, match=match):
        read_stretch_stress(written(tmp_path, text))


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be read"):
        read_stretch_stress(tmp_path / "none.csv")


def test_compression_is_negative(tmp_path: Path) -> None:
    text = "stretch,stress_[kPa]\n1,0\n.9,-2\n.8,-3\n.7,-4\n"
    stress = read_stretch_stress(written(tmp_path, text)).signal("stress", "Pa").y[:, 0]
    assert np.array_equal(stress, [0, -2e3, -3e3, -4e3])


def test_two_curves_in_one_file_are_refused(tmp_path: Path) -> None:
    table = f"stretch,stress_[kPa]\n{ROWS}"
    with pytest.raises(RecordingError, match=r"rubber_uniaxial.csv: 2 tables"):
        read_stretch_stress(written(tmp_path, f"{table}\nstretch,stress_[MPa]\n{ROWS}"))
