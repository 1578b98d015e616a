"""Tables of points as one's own scripts write them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from exports import F, T

from validate.errors import RecordingError, UsageError
from validate.recording.formats.point_table import read_point_table
from validate.recording.readers import recognised
from validate.recording.types import Markers

X = np.random.default_rng(0).normal(size=(len(T), 2, 3)).round(4)  # mm
SEEN = {"tip": X[:, 0], "base": X[:, 1]}


def table(pattern: str, **columns: np.ndarray) -> pd.DataFrame:
    points = {
        pattern.format(name=name, axis=axis): x[:, i]
        for name, x in SEEN.items()
        for i, axis in enumerate("xyz")
    }
    return pd.DataFrame({**columns, **points})


def read(path: Path, options: Mapping[str, str] | None = None) -> Markers:
    found = read_point_table(path, options or {}).markers
    return next(iter(found.values()))


@pytest.mark.parametrize(
    "pattern",
    ["{name}_{axis} (mm)", "{name}.{axis} [mm]", "{axis}_{name} (mm)", "{name}_{axis}_mm"],
)
def test_a_column_a_coordinate_is_a_marker(pattern: str, tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    table(pattern, **{"time (s)": T + 3}).to_csv(path, index=False)
    assert recognised(path).name == "points"
    found = read(path)
    assert found.names == ("tip", "base")
    assert np.allclose(found.x, X / 1e3, rtol=0, atol=1e-12)
    assert np.allclose(found.t, T - T[0], rtol=0, atol=1e-9)


def test_decimal_commas_beside_semicolons_and_a_row_of_units(tmp_path: Path) -> None:
    """Such rows have more commas than semicolons."""
    path = tmp_path / "p.csv"
    frame = table("{name}{axis}", Zeit=T)
    frame.columns = ["Zeit", *(c[:-1] + c[-1].upper() for c in frame.columns[1:])]
    rows = frame.to_csv(index=False, sep=";", decimal=",").split("\n", 1)
    path.write_text(f"# own tracker\n{rows[0]}\nms;mm;mm;mm;mm;mm;mm\n{rows[1]}", "utf-8")
    found = read(path)
    assert np.allclose(found.x, X / 1e3, rtol=0, atol=1e-12)
    assert np.allclose(found.t, (T - T[0]) / 1e3, rtol=0, atol=1e-12)


def test_what_the_table_does_not_say_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    frame = table("{name}_{axis}", frame=np.arange(len(T)))
    frame.to_csv(path, index=False)
    with pytest.raises(UsageError, match="--map unit=mm"):
        read(path)
    with pytest.raises(UsageError, match="--map rate=HZ"):
        read(path, {"unit": "mm"})
    assert read(path, {"unit": "mm", "rate": "10"}).t[1] == 0.1
    frame.rename(columns={"frame": "t"}).to_csv(path, index=False)
    with pytest.raises(UsageError, match="'t' has no unit; say it: --map time=s"):
        read(path, {"unit": "mm"})
    with pytest.raises(UsageError, match="have a z of their own"):
        read(path, {"unit": "mm", "time": "s", "z": "0mm"})
    frame[[c for c in frame if not c.endswith("z")]].to_csv(path, index=False)
    with pytest.raises(UsageError, match="--map z=0mm"):
        read(path, {"unit": "mm", "rate": "10"})
    flat = read(path, {"unit": "mm", "rate": "10", "z": "2mm"})
    assert np.allclose(flat.x[..., 2], 2e-3)
    assert np.allclose(flat.x[..., :2], X[..., :2] / 1e3)


def test_a_row_a_point_is_a_layout(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("name,x (mm),y (mm),z (mm),remark\nA,1,2,3,\nB,4,5,6,\n", "utf-8")
    found = recognised(path).read(path, {})
    assert found.marker("landmarks").names == ("A", "B")
    assert np.allclose(found.marker("landmarks").x[0], [[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]])
    assert "'remark'" in found.metadata["provenance"]["left out, columns"]


def test_points_not_seen_and_damage(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    top = "time (s),tip_x (mm),tip_y (mm),tip_z (mm)\n"
    path.write_text(top + "0,1,2,3\n0.1,,,\n0.2,nan,nan,nan\n", "utf-8")
    assert np.isnan(read(path).x[1:]).all()
    odd = {"0.1,1,,3": "line 3: point 'tip' has 2 of 3", "0,1,2,3": "line 3: its time",
           "0.1,1,two,3": "line 3: 'two' is no number"}  # fmt: skip
    for row, why in odd.items():
        path.write_text(f"{top}0,1,2,3\n{row}\n0.2,1,2,3\n", "utf-8")
        with pytest.raises(RecordingError, match=why):
            read(path)


def test_a_log_with_a_force_is_a_machine_s_and_its_points_come_in_when_said(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    table("{name}_{axis} (mm)", **{"time (s)": T, "Force (N)": F}).to_csv(path, index=False)
    assert recognised(path).name == "instron"
    assert "'Force (N)'" in read_point_table(path, {}).metadata["provenance"]["left out, columns"]
