"""Tables of points as one's own scripts write them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from exports import F, T

from validate.errors import RecordingError, UsageError
from validate.recording.motion_capture.text_rows import rows_of
from validate.recording.readers import recognised
from validate.recording.tables.point_table import read_point_table
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
    asks = "if its rows are instants, give --map rate=HZ; if they are points at one instant, name"
    with pytest.raises(UsageError, match=asks):
        read(path, {"unit": "mm"})
    assert read(path, {"unit": "mm", "rate": "10"}).t[1] == 0.1
    frame.rename(columns={"frame": "t"}).to_csv(path, index=False)
    with pytest.raises(UsageError, match="'t' has no unit; give --map time=s"):
        read(path, {"unit": "mm"})
    with pytest.raises(UsageError, match="already have a z"):
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
           "0.1,1,two,3": "line 3: 'two' is not a number"}  # fmt: skip
    for row, why in odd.items():
        path.write_text(f"{top}0,1,2,3\n{row}\n0.2,1,2,3\n", "utf-8")
        with pytest.raises(RecordingError, match=why):
            read(path)


def test_a_log_with_a_force_is_a_machine_s_and_its_points_come_in_when_said(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    table("{name}_{axis} (mm)", **{"time (s)": T, "Force (N)": F}).to_csv(path, index=False)
    assert recognised(path).name == "instron"
    assert "'Force (N)'" in read_point_table(path, {}).metadata["provenance"]["left out, columns"]


LONG = "time (s),frame,marker,x (mm),y (mm),z (mm)\n" + "".join(
    f"{k / 10},{2 * k},{name},{x[k, 0]},{x[k, 1]},{x[k, 2]}\n"
    for k in range(5)
    for name, x in SEEN.items()
    if (k, name) != (3, "base")
)


def long_table(path: Path, without: str = "") -> Path:
    names = LONG.splitlines()[0].split(",")
    keep = [i for i, name in enumerate(names) if name not in without.split("+")]
    lines = [[line.split(",")[i] for i in keep] for line in LONG.splitlines()]
    path.write_text("\n".join(map(",".join, lines)) + "\n")
    return path


def test_a_row_a_point_and_instant_is_markers_over_time(tmp_path: Path) -> None:
    """They were landmarks called `tip (1)`, `tip (2)`, or by a rate one point that jumps."""
    path = long_table(tmp_path / "p.csv")
    found = read(path)
    assert found.names == ("tip", "base")
    assert np.allclose(found.t, np.arange(5) / 10, rtol=0, atol=1e-9)
    expected = X[:5] / 1e3
    expected[3, 1] = np.nan
    assert np.allclose(found.x, expected, rtol=0, atol=1e-12, equal_nan=True)
    counted = read(long_table(path, "time (s)"), {"rate": "20"})
    assert np.allclose(counted.t, found.t, rtol=0, atol=1e-9)
    assert np.array_equal(counted.x, found.x, equal_nan=True)


@pytest.mark.parametrize(
    ("without", "said"),
    [
        ("time (s)+frame", "every one of 2 names occurs in several rows"),
        ("marker", "1.8 rows at each|is not after the one before"),
        ("marker+frame", "its time is not after the one before"),
    ],
)
def test_rows_of_several_points_need_their_names_and_instants(
    without: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=said):
        read(long_table(tmp_path / "p.csv", without))


def test_a_rate_makes_no_motion_of_points_without_names(tmp_path: Path) -> None:
    """Two points at each instant, by a rate one that jumps between them."""
    lines = [f"{t:.1f},{i},{i},0" for t in (0, 0.1, 0.2) for i in (1, 9)]
    (tmp_path / "p.csv").write_text("\n".join(["time (s),x (mm),y (mm),z (mm)", *lines]) + "\n")
    with pytest.raises(RecordingError, match=r"2 rows.*'time \(s\)'"):
        read(tmp_path / "p.csv", {"rate": "20"})


def test_two_rows_of_one_point_at_one_instant_are_refused(tmp_path: Path) -> None:
    path = long_table(tmp_path / "p.csv")
    path.write_text(LONG + "0.4,8,tip,0,0,0\n")
    with pytest.raises(RecordingError, match="line 11: 'tip'"):
        read(path)


def test_trackmates_spots_have_three_more_lines_of_names(tmp_path: Path) -> None:
    path = tmp_path / "spots.csv"
    path.write_text(
        "LABEL,ID,TRACK_ID,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME\n"
        "Label,Spot ID,Track ID,X,Y,Z,T,Frame\nLabel,Spot ID,Track ID,X,Y,Z,T,Frame\n"
        ",,,(micron),(micron),(micron),(sec),\n"
        + "".join(f"ID{i},{i},{i % 2},{i},{i % 2},0,{i // 2},{i // 2}\n" for i in range(8))
    )
    found = read(path)
    assert found.names == ("0", "1")
    assert np.allclose(found.t, range(4))
    assert np.allclose(found.x[:, 1, 0], [1e-6, 3e-6, 5e-6, 7e-6])


DEEPLABCUT = """scorer,DLC,DLC,DLC,DLC,DLC,DLC
bodyparts,tip,tip,tip,base,base,base
coords,x,y,likelihood,x,y,likelihood
0,10.5,20,0.99,30,40,0.99
1,11.5,20,0.2,30,40,0.99
2,12.5,20,0.7,30,40,0.99
"""
PLACED = {"m_per_px": "0.1mm", "z": "0mm", "rate": "25"}


def test_deeplabcuts_tables_are_markers_in_pixels(tmp_path: Path) -> None:
    """They were called specimens of a testing machine."""
    path = tmp_path / "dlc.csv"
    path.write_text(DEEPLABCUT)
    assert recognised(path).name == "points"
    with pytest.raises(UsageError, match="--map m_per_px="):
        read(path)
    found = read(path, PLACED)
    assert found.names == ("tip", "base")
    assert np.allclose(found.t, [0, 0.04, 0.08])
    assert np.allclose(found.x[:, 0, 0], [1.05e-3, np.nan, 1.25e-3], equal_nan=True)
    told = read_point_table(path, PLACED).metadata["provenance"]
    assert "likelihood below 0.6 is taken as missing (1 of 6)" in told["assumed"]
    sure = read(path, {**PLACED, "likelihood": "0.9"})
    assert np.isnan(sure.x[:, 0, 0]).tolist() == [False, True, True]


def test_deeplabcut_of_several_animals_names_them(tmp_path: Path) -> None:
    path = tmp_path / "dlc.csv"
    scorer, parts, *rest = DEEPLABCUT.splitlines()
    parts = "bodyparts" + 2 * ",tip,tip,tip"
    path.write_text("\n".join([scorer, "individuals,a,a,a,b,b,b", parts, *rest]) + "\n")
    assert read(path, PLACED).names == ("a.tip", "b.tip")


def test_deeplabcuts_table_without_coordinates_names_no_points(tmp_path: Path) -> None:
    """A point that has likelihoods alone ended in a traceback."""
    path = tmp_path / "dlc.csv"
    path.write_text(DEEPLABCUT.replace(",x,y,", ",likelihood,likelihood,"))
    with pytest.raises(RecordingError, match="no line names points"):
        read(path, PLACED)


PX, PY = (a.ravel() for a in np.meshgrid(np.arange(5) * 5.0, np.arange(4) * 5.0))
FIELD = (PX, PY, 0.01 * PX, -0.003 * PY, 0 * PX + 0.01, 0 * PY - 0.003, 0 * PX)
ADVICE = {"unit": "mm", "z": "0mm", "rate": "10"}  # as such a table was answered with


def field_table(path: Path, names: str, separator: str = ",", before: str = "") -> Path:
    """A row a point of a grid of 5 x 4, columns of those names, after a column of a time."""
    count = len(names.split(separator))
    rows = (separator.join(f"{c:.4f}" for c in row[:count]) for row in zip(*FIELD, strict=True))
    first = before and f"{before}{separator}"
    lines = [f"{first}{names}", *(f"{first and '0' + separator}{row}" for row in rows)]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ("x,y,u,v,exx", "x, y, u, v, exx"),
        ("x,y,u,v", "x, y, u, v"),
        ('"x", "y", "u", "v", "exx", "eyy", "exy"', "x, y, u, v, exx, eyy, exy"),  # Vic-2D
        ("X [mm],Y [mm],U [mm],V [mm],exx,eyy", "X, Y, U, V, exx, eyy"),
        ("x [px];y [px];u [px];v [px]", "x, y, u, v"),
        ("x (mm),y (mm),disp_x (mm),disp_y (mm),strain_xx", "x, y, disp_x, disp_y, strain_xx"),
        ("x,y,displacement", "x, y, displacement"),
        ("x [mm]\ty [mm]\tEpsilon X [%]", "x, y, Epsilon X"),
        ("COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA,VSG_STRAIN_XX",
         "COORDINATE_X, COORDINATE_Y, DISPLACEMENT_X, DISPLACEMENT_Y, VSG_STRAIN_XX"),  # DICe
        ("X [mm];Y [mm];Verschiebung X [mm];Verschiebung Y [mm];Dehnung X",
         "X, Y, Verschiebung X, Verschiebung Y, Dehnung X"),
        ("Xpos,Ypos,Ux,Uy,Exx", "Xpos, Ypos, Ux, Uy, Exx"),  # no names of points: a machine's text
    ],
)  # fmt: skip
def test_a_displacement_field_is_no_motion_of_one_point(
    names: str, columns: str, tmp_path: Path
) -> None:
    """It was read as one point that jumps from place to place, by following the advice."""
    separator = next((s for s in ";\t" if s in names), ",")
    path = field_table(tmp_path / "p.csv", names, separator)
    reader = recognised(path)
    said = ADVICE if reader.name == "points" else {"time": "every:0.1s", "force": "none"}
    for options in ({}, said):
        with pytest.raises(RecordingError) as raised:
            reader.read(path, options)
        assert str(raised.value) == (
            f"p.csv: 20 rows of {columns}: a field of displacements or strains at one instant, not "
            "the motion of one point; export chosen points over time, one row per instant, as time "
            "(s), p1_x (mm), p1_y (mm), p2_x (mm), p2_y (mm)"
        )


@pytest.mark.parametrize("before", ["time (s)", "frame"])
def test_a_field_at_each_instant_is_told_no_way_to_be_one_point(
    before: str, tmp_path: Path
) -> None:
    path = field_table(tmp_path / "p.csv", "x (mm),y (mm),u (mm),v (mm),exx", before=before)
    said = f"20 rows at each '{before}' of x, y, u, v, exx: a field".replace("(", r"\(")
    with pytest.raises(RecordingError, match=said.replace(")", r"\)")):
        read(path, {"z": "0mm"})


def test_one_point_with_displacements_over_time_is_read(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("time (s),x (mm),y (mm),u (mm),v (mm)\n0,1,2,0,0\n0.1,1.5,2,0.5,0\n", "utf-8")
    assert read(path, {"z": "0mm"}).x[:, 0, 0].tolist() == [1e-3, 1.5e-3]


def test_rows_on_a_grid_are_no_motion_of_one_point(tmp_path: Path) -> None:
    """No name tells it; a point that moves along a line or a circle is on no grid."""
    path = field_table(tmp_path / "p.csv", "x (mm),y (mm)")
    with pytest.raises(RecordingError, match=r"20 rows.*5 x 4 places"):
        read(path, ADVICE)
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    for x, y in ((np.cos(angle), np.sin(angle)), (angle, angle), (angle, 0 * angle)):
        rows = "".join(f"{a:.3f},{b:.3f}\n" for a, b in zip(x, y, strict=True))
        path.write_text(f"x (mm),y (mm)\n{rows}", "utf-8")
        assert len(read(path, {"z": "0mm", "rate": "10"}).t) == 24


def test_one_point_on_a_grid_that_comes_back_or_has_times_is_read(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    nine = [f"{x},{y}" for x in range(3) for y in range(3)]
    path.write_text("\n".join(["x (mm),y (mm)", *nine, *nine]) + "\n", "utf-8")
    assert len(read(path, {"z": "0mm", "rate": "10"}).t) == 18
    timed = [f"{i},{row}" for i, row in enumerate(nine)]
    path.write_text("\n".join(["time (s),x (mm),y (mm)", *timed]) + "\n", "utf-8")
    assert len(read(path, {"z": "0mm"}).t) == 9


@pytest.mark.parametrize(("more", "is_read"), [("u,v", True), ("exx", False)])
def test_tracks_may_have_velocities_but_grid_points_have_strains(
    more: str, is_read: bool, tmp_path: Path
) -> None:
    """Places of a field stay where they were at first: read, they would be points at rest."""
    path = tmp_path / "p.csv"
    values = ",0" * len(more.split(","))
    rows = [f"{t},{i},{i + 0.1 * t},0{values}" for t in range(3) for i in range(4)]
    path.write_text("\n".join([f"frame,id,x (mm),y (mm),{more}", *rows]) + "\n", "utf-8")
    if is_read:
        assert read(path, {"z": "0mm", "rate": "10"}).names == ("0", "1", "2", "3")
        return
    with pytest.raises(RecordingError, match=r"4 rows.*'frame'"):
        read(path, {"z": "0mm", "rate": "10"})


PLAIN = "time (s),tip_x (mm),tip_y (mm),tip_z (mm)\n0,1,2,3\n0.1,1,2,3\n0.2,1,2,3\n"


@pytest.mark.parametrize(
    ("text", "options", "says"),
    [
        (PLAIN, {"likelihood": "0.9"}, "--map likelihood: the table has none for each point"),
        (PLAIN, {"m_per_px": "0.1mm"}, "--map m_per_px: coordinates are in mm"),
        (
            PLAIN,
            {"m_per_px": "0.1mm", "unit": "px"},
            "--map unit and m_per_px exclude each other; give one",
        ),
        (PLAIN.replace("0.1,1", ",1"), {}, "line 3: it has no time; correct it"),
        (PLAIN.replace("0.2,1", "1e12,1"), {}, "markers: a time of 1e.12 s; damaged"),
        (
            "name,x (mm),y (mm),z (mm)\na,1,2,3\nb,1,,3\nc,3,2,1\n",
            {},
            "a landmark without coordinates; remove its line",
        ),
        (
            "frame,x (mm),y (mm),z (mm)\n1,1,2,3\n3,1,2,3\n2,1,2,3\n",
            {"rate": "10"},
            "line 4: its 'frame' is not after the one before",
        ),
    ],
)
def test_what_a_table_cannot_mean_is_refused(
    text: str, options: dict[str, str], says: str, tmp_path: Path
) -> None:
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises((RecordingError, UsageError), match=says):
        read(tmp_path / "p.csv", options)


def test_many_short_tracks_are_refused(tmp_path: Path) -> None:
    """60 particles, each tracked in two of 61 images: 120 rows for 3660 cells."""
    rows = [f"{(i + k) / 10},t{i},{i},0,0" for i in range(60) for k in (0, 1)]
    (tmp_path / "p.csv").write_text(
        "\n".join(["time (s),marker,x (mm),y (mm),z (mm)", *rows]) + "\n"
    )
    with pytest.raises(RecordingError, match=r"60 labels at 61 instants.*120 rows"):
        read(tmp_path / "p.csv")


def test_a_cell_longer_than_any_table_has_is_no_table() -> None:
    with pytest.raises(RecordingError, match=r"x.csv: not a table of cells .field"):
        rows_of("x.csv", b"time,x\n0," + b"1" * 140_000)
