"""Tables at single spaces, as numpy and many programs of one's own write them."""

from pathlib import Path

import numpy as np
import pytest

from validate.errors import RecordingError
from validate.recording.tables.testing_machine import read_instron

T = np.linspace(0, 10, 41)
TABLE = np.column_stack([T, 0.5 * T, 2.5 * T])  # s, mm, N
PRESSED = {"test": "compression"}


def lines() -> str:
    return "".join(f"{a:.3f} {b:.4f} {c:.4f}\n" for a, b, c in TABLE)


@pytest.mark.parametrize(
    "names",
    [
        "# time(s) displacement(mm) force(N)\n",
        "Time (s) Displacement (mm) Force (N)\n",
        "Time Displacement Force\ns mm N\n",
        "Time [s] Displacement [mm] Force [N]\n",
    ],
)
def test_a_table_at_single_spaces_is_read(names: str, tmp_path: Path) -> None:
    (tmp_path / "x.txt").write_text(names + lines())
    got = read_instron(tmp_path / "x.txt", PRESSED)
    assert got.signals["displacement"].y.ravel() == pytest.approx(0.5e-3 * T, abs=1e-7)
    assert got.signals["force"].y.ravel() == pytest.approx(2.5 * T, abs=1e-4)
    assert got.signals["force"].t == pytest.approx(T)


def test_what_numpy_saves_is_read(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "x.txt", TABLE, header="time_s displacement_mm force_N")
    got = read_instron(tmp_path / "x.txt", PRESSED)
    assert got.signals["force"].y[-1] == pytest.approx(25)


@pytest.mark.parametrize(("between", "shown"), [(" ", " "), (";", ";"), ("\t", " <tab> ")])
def test_the_line_of_names_that_is_asked_for_can_be_written(
    between: str, shown: str, tmp_path: Path
) -> None:
    """With the table's own separator: commas were shown for all, and did not help."""
    (tmp_path / "x.txt").write_text(lines().replace(" ", between))
    with pytest.raises(RecordingError, match="has no column names; add a line") as raised:
        read_instron(tmp_path / "x.txt", PRESSED)
    advice = str(raised.value).split("'")[1].replace(shown, between)
    (tmp_path / "x.txt").write_text(advice + "\n" + lines().replace(" ", between))
    assert read_instron(tmp_path / "x.txt", PRESSED).signals["force"].y[-1] == pytest.approx(25)
