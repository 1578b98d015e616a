"""Points and poses that other programs wrote as text: trajectories, tracker logs, landmarks."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from validate.errors import RecordingError, UsageError
from validate.recording.formats.slicer import read_fcsv, read_markups
from validate.recording.motion_capture.c3d import read_c3d
from validate.recording.motion_capture.ndi import read_ndi
from validate.recording.motion_capture.optitrack import read_optitrack
from validate.recording.motion_capture.poses import rotations
from validate.recording.motion_capture.qualisys import read_qualisys
from validate.recording.motion_capture.trc import read_trc
from validate.recording.motion_capture.vicon import read_vicon
from validate.recording.readers import recognised

MOCAP = Path("markers/mocap")
AURORA = Path("markers/aurora/NDIdata_snakeravenTest_2_2_21.csv")


def test_a_vicon_export_is_the_c3d_of_the_same_motion(shared_data: Path) -> None:
    """51 markers, 580 frames, 305 points not seen: half a unit of the text's last digit."""
    path = shared_data / MOCAP / "pyomeca_markers.csv"
    assert recognised(path).name == "vicon"
    text = read_vicon(path, {}).marker("markers")
    binary = read_c3d(shared_data / MOCAP / "pyomeca_markers_analogs.c3d", {}).marker("markers")
    assert text.names == binary.names
    assert text.x.shape == (580, 51, 3)
    assert (np.isnan(text.x) == np.isnan(binary.x)).all()
    assert np.isnan(text.x[..., 0]).sum() == 305
    assert np.nanmax(np.abs(text.x - binary.x)) < 6e-6
    assert np.abs(text.t - binary.t).max() == 0


def test_devices_of_a_vicon_export_have_their_own_rate(tmp_path: Path) -> None:
    """Five rows a frame: the sub-frame counts, a blank channel is told, and clocks agree."""
    rows = [f"{f},{s},{10 * f + s},{0.5 * s},{'' if s else 1}" for f in (1, 2, 3) for s in range(5)]
    points = [f"{f},0,{f},0,0" for f in (1, 2, 3)]
    (tmp_path / "both.csv").write_text(
        "Devices\n500\n,,Plate - Force,,Plate - Moment\nFrame,Sub Frame,Fx,Fy,Mz\n,,N,N,N.mm\n"
        + "\n".join(rows)
        + "\n\nTrajectories\n100\n,,s:tip,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n"
        + "\n".join(points)
        + "\n"
    )
    got = read_vicon(tmp_path / "both.csv", {})
    force = got.signal("analog/Plate - Force.Fx", "N")
    assert force.y[:, 0].tolist() == [11 - 1 + s + 10 * f for f in range(3) for s in range(5)]
    assert np.diff(force.t) == pytest.approx(1 / 500)
    assert force.t[::5] == pytest.approx(got.marker("markers").t)
    assert sorted(got.signals) == ["analog/Plate - Force.Fx", "analog/Plate - Force.Fy"]
    assert "Mz: 12 blank cells" in str(dict(got.metadata))


def test_a_comma_separated_trc_is_read_and_says_that_it_is_a_part(shared_data: Path) -> None:
    path = shared_data / MOCAP / "pyomeca_markers.trc"
    got = read_trc(path, {})
    markers = got.marker("markers")
    assert markers.x.shape == (93, 51, 3)
    assert markers.names[:3] == ("ASISl", "ASISr", "PSISl")
    assert markers.x[0, 0] == pytest.approx([0.7337041, 0.0809832, 0.1918668])
    assert got.clock["markers"].rate_hz == pytest.approx(100)
    assert got.metadata["provenance"]["rows"] == "93, the header declares 652"


def test_seven_zeros_of_a_tracker_are_not_seen(shared_data: Path) -> None:
    got = read_ndi(shared_data / AURORA, {})
    assert got.metadata["provenance"]["not_seen"] == (
        "a: 2 of 158; b: 4 of 158; c: 9 of 158; d: 1 of 158"
    )
    a = got.signal("a/translation", "m")
    assert len(a.t) == 156
    assert a.y[0] == pytest.approx([0.10284, -0.06, -0.15825])
    assert np.linalg.norm(a.y, axis=1).min() > 0.1  # no position is 0 0 0
    assert a.t[0] == pytest.approx(0.035)  # the first sample of all is tool d's
    R = got.signal("a/rotation", "1").y.reshape(-1, 3, 3)
    assert np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
    assert np.linalg.det(R) == pytest.approx(1)
    assert got.metadata["provenance"]["left out"] == "line 164, cut: 6 of 33 cells"


def test_a_tool_in_another_state_than_ok_is_not_seen(tmp_path: Path) -> None:
    head = "Tools,Port 1,Frame,Face,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error,"
    head += "Port 2,Frame,Face,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error\n"
    one, two = "OK,1,0,0,0,10,20,30,0.1", "MISSING,1,0,0,0,1,2,3,0"
    body = f"2,01,1,0,{one},02,1,0,{two}\n2,01,2,0,{one},02,2,0,{two}\n"
    (tmp_path / "x.csv").write_text(head + body)
    with pytest.raises(UsageError, match="no column is a time; give --map rate=HZ"):
        read_ndi(tmp_path / "x.csv", {})
    got = read_ndi(tmp_path / "x.csv", {"rate": "60"})
    assert got.signal("port1/translation", "m").y.tolist() == [[0.01, 0.02, 0.03]] * 2
    assert dict(got.unread) == {"port2": "never seen"}


def test_a_log_over_midnight_goes_on(tmp_path: Path) -> None:
    head = "Hour,Minute,Second,ms,x,y,z,qx,qy,qz,qw\n"
    rows = "23,59,59,990,1,2,3,0,0,0,1\n0,0,0,10,1,2,3,0,0,0,1\n"
    (tmp_path / "x.csv").write_text(head + rows)
    assert read_ndi(tmp_path / "x.csv", {}).signal("tool1/translation", "m").t.tolist() == [0, 0.02]


def test_four_numbers_that_are_no_rotation_are_not_taken_for_one(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("time,x,y,z,qx,qy,qz,qw\n0,1,2,3,0,0,0,2\n")
    with pytest.raises(RecordingError, match=r"sample 1.*length 2, expected 1"):
        read_ndi(tmp_path / "x.csv", {})


def test_a_quarter_turn_about_z_takes_x_to_y() -> None:
    half = np.sqrt(0.5)
    R = rotations(np.array([[0, 0, half, half]]), "x")[0]
    assert pytest.approx([0, 1, 0]) == R @ [1, 0, 0]


# Two frames and two points of a recording of Motive 1.23 (Skylark0924/Rofunc 616c8a5, Apache-2.0).
OPTITRACK = """\
Format Version,1.23,Take Name,Take 2023-03-29 06.23.40 PM,Take Notes,,Capture Frame Rate,120.000000\
,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global

,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,\
Rigid Body Marker,Rigid Body Marker,Rigid Body Marker,Marker,Marker,Marker
,Name,Left,Left,Left,Left,Left,Left,Left,Left:Marker1,Left:Marker1,Left:Marker1,\
Left:Marker1,Left:Marker1,Left:Marker1
,ID,7264,7264,7264,7264,7264,7264,7264,7264,7264,7264,"C5B9","C5B9","C5B9"
,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,Position,\
Position,Position,Position
Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z,X,Y,Z
0,0.000000,0.032550,0.490528,0.814384,0.308385,-79.610710,823.122498,212.482422,\
-91.883667,882.889648,252.572006,-91.936111,882.915283,252.950699
1,0.008000,0.033596,0.491071,0.814339,0.307528,-79.700966,823.159607,212.385559,\
-91.880798,882.931274,252.496780,,,
"""


def test_what_motive_saw_and_what_it_solved_are_apart(tmp_path: Path) -> None:
    (tmp_path / "take.csv").write_text(OPTITRACK, "utf-8")
    got = read_optitrack(tmp_path / "take.csv", {})
    assert recognised(tmp_path / "take.csv").name == "optitrack"
    assert got.marker("markers").x[0, 0] == pytest.approx([-0.091936111, 0.882915283, 0.252950699])
    assert np.isnan(got.marker("markers").x[1]).all()
    assert got.marker("solved").x[1, 0, 1] == pytest.approx(0.882931274)
    assert got.marker("markers").frame == "global"
    # The solved marker is where the body's pose puts it: the same point of the body twice.
    R = got.signal("Left/rotation", "1").y.reshape(2, 3, 3)
    p = got.signal("Left/translation", "m").y
    own = np.einsum("tji,tj->ti", R, got.marker("solved").x[:, 0] - p)
    assert np.abs(own[1] - own[0]).max() < 1e-6


# Two frames and two points of a recording of Qualisys (reiv27/biomechanics 54bd5ae).
QUALISYS = """\
NO_OF_FRAMES\t2
NO_OF_CAMERAS\t10
NO_OF_MARKERS\t2
FREQUENCY\t100
NO_OF_ANALOG\t0
ANALOG_FREQUENCY\t0
DESCRIPTION\t--
TIME_STAMP\t2026-01-19, 10:19:43.755\t2063631.96175450
DATA_INCLUDED\t3D
MARKER_NAMES\tNew 0000\tNew 0002
TRAJECTORY_TYPES\tMeasured\tMeasured
Frame\tTime\tNew 0000 X\tNew 0000 Y\tNew 0000 Z\tNew 0002 X\tNew 0002 Y\tNew 0002 Z\t
1\t0.00000\t819.834\t277.770\t22.421\t694.169\t-183.362\t97.003
2\t0.01000\t819.835\t277.770\t22.420\t0.000\t0.000\t0.000
"""


def test_three_zeros_of_qualisys_are_not_seen(tmp_path: Path) -> None:
    (tmp_path / "x.tsv").write_text(QUALISYS, "utf-8")
    markers = read_qualisys(tmp_path / "x.tsv", {}).marker("markers")
    assert markers.names == ("New 0000", "New 0002")
    assert markers.t.tolist() == [0, 0.01]
    assert markers.x[0, 1] == pytest.approx([0.694169, -0.183362, 0.097003])
    assert np.isnan(markers.x[1, 1]).all()
    (tmp_path / "six.tsv").write_text(QUALISYS.replace("\t3D", "\t6D"), "utf-8")
    with pytest.raises(RecordingError, match="8 columns for 2 bodies; expected 16 each"):
        read_qualisys(tmp_path / "six.tsv", {})


def test_landmarks_as_slicer_wrote_them_are_those_of_its_own_reader() -> None:
    """The file that the package slicerio carries, and that package as oracle."""
    slicerio = pytest.importorskip("slicerio")
    spec = importlib.util.find_spec("slicerio")
    assert spec is not None
    assert spec.origin is not None
    path = Path(spec.origin).parent / "data" / "F_1.fcsv"
    got = read_fcsv(path, {}).marker("landmarks")
    theirs = slicerio.read_markups(str(path)) if hasattr(slicerio, "read_markups") else None
    assert got.frame == "LPS"
    assert got.names[4] == "F_1-9"
    assert got.x[0, 0] == pytest.approx([-6.282824184e-3, -51.06216974e-3, -10.2143e-3])
    assert got.x.shape == (1, 12, 3)
    assert theirs is None or len(theirs["markups"]) == 1


def test_a_landmark_taken_back_is_not_seen(tmp_path: Path) -> None:
    head = "# Markups fiducial file version = 5.4\n# CoordinateSystem = RAS\n"
    (tmp_path / "x.fcsv").write_text(
        head + "1,1,2,3,0,0,0,1,1,1,0,A,,,2,0\n2,9,9,9,0,0,0,1,1,1,0,B,,,3,0\n"
    )
    got = read_fcsv(tmp_path / "x.fcsv", {}).marker("landmarks")
    assert (got.frame, got.names) == ("RAS", ("A", "B"))
    assert np.isnan(got.x[0, 1]).all()


def test_markups_of_two_frames_are_not_mixed(tmp_path: Path) -> None:
    point = {"label": "A", "position": [1.0, 2.0, 3.0]}
    taken_back = {"label": "B", "position": [0.0, 0.0, 0.0], "positionStatus": "undefined"}
    lps = {"coordinateSystem": "LPS", "controlPoints": [point, taken_back]}
    ras = {"coordinateSystem": "RAS", "controlPoints": [point]}
    path = tmp_path / "x.mrk.json"
    path.write_text(json.dumps({"@schema": "markups", "markups": [lps]}))
    got = read_markups(path, {}).marker("landmarks")
    assert got.x[0, 0] == pytest.approx([1e-3, 2e-3, 3e-3])
    assert np.isnan(got.x[0, 1]).all()
    path.write_text(json.dumps({"@schema": "markups", "markups": [lps, ras]}))
    with pytest.raises(RecordingError, match=r"in .'LPS', 'RAS'.* separate files"):
        read_markups(path, {})


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("2\t0.010\t1\t\t3\t4\t5\t6", "line 8: point 'tip' has 2 of 3 coordinates"),
        ("2\t0.010\t1\tx\t3\t4\t5\t6", "line 8: 'x' is not a number"),
        ("2\t0.010\t1\t2\t3\t4\t5\t6\t7", "'7' belongs to no column"),
        ("2\t0.010\tinf\t2\t3\t4\t5\t6", "line 8 has an infinite number"),
        ("2\t\t1\t2\t3\t4\t5\t6", "1 rows without a time"),
    ],
)
def test_an_odd_line_is_named(line: str, why: str, tmp_path: Path) -> None:
    head = "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tNumMarkers\tUnits\n100\t2\tmm\n"
    names = "Frame#\tTime\ttip\t\t\tbase\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    path = tmp_path / "x.trc"
    path.write_text(
        f"{head}{names}1\t0.000\t1\t2\t3\t4\t5\tNaN\n{line}\n".replace("5\tNaN", "5\t6")
    )
    with pytest.raises(RecordingError, match=why):
        read_trc(path, {})


def test_a_trc_without_unit_or_with_other_points_than_stated_is_refused(tmp_path: Path) -> None:
    head = "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tNumMarkers\n100\t{}\n"
    body = "Frame#\tTime\ttip\t\t\n\t\tX1\tY1\tZ1\n1\t0.000\t1\t2\t3\n"
    path = tmp_path / "x.trc"
    path.write_text(head.format(1) + body)
    with pytest.raises(UsageError, match="--map unit=mm"):
        read_trc(path, {})
    assert read_trc(path, {"unit": "cm"}).marker("markers").x[0, 0, 2] == pytest.approx(0.03)
    path.write_text(head.format(2) + body)
    with pytest.raises(RecordingError, match="line 4 names 1 points, line 3 states 2"):
        read_trc(path, {"unit": "mm"})


LINES_OF_TOOLS = """time,tool_id,status,q0,qx,qy,qz,tx,ty,tz
0.00,A,OK,1,0,0,0,1,2,3
0.00,B,OK,1,0,0,0,4,5,6
0.02,A,MISSING,1,0,0,0,1,2,9
0.02,B,OK,1,0,0,0,4,5,7
"""


def test_lines_of_several_tools_are_told_apart_by_the_column_that_names_them(
    tmp_path: Path,
) -> None:
    path = tmp_path / "x.csv"
    path.write_text(LINES_OF_TOOLS)
    got = read_ndi(path, {})
    assert got.signal("B/translation", "m").y.tolist() == pytest.approx(
        np.array([[4, 5, 6], [4, 5, 7]]) * 1e-3
    )
    assert got.signal("B/translation", "m").t.tolist() == [0.0, 0.02]
    assert len(got.signal("A/translation", "m").t) == 1  # its status is not OK at the second
    path.write_text(LINES_OF_TOOLS.replace("time,", "n,"))
    assert read_ndi(path, {"rate": "50"}).signal("B/rotation", "1").t.tolist() == [0.0, 0.02]
    path.write_text(LINES_OF_TOOLS.replace("time,", "n,") + "0.04,B,OK,1,0,0,0,4,5,8\n")
    with pytest.raises(RecordingError, match="their times"):
        read_ndi(path, {"rate": "50"})
    path.write_text("time,no,qw,qx,qy,qz,x,y,z\n0,1,1,0,0,0,1,2,3\n0.1,2,1,0,0,0,1,2,4\n")
    assert len(read_ndi(path, {}).signals) == 2  # a column that numbers the lines names no tools


def test_a_body_alone_with_the_mean_error_of_its_markers_is_read(tmp_path: Path) -> None:
    """Motive names that column in the line above, and leaves its axis blank."""
    path = tmp_path / "x.csv"
    path.write_text(
        "Format Version,1.23,Rotation Type,Quaternion,Length Units,Meters\n\n"
        f",Type{8 * ',Rigid Body'}\n,Name{8 * ',Tool'}\n,ID{8 * ',1'}\n"
        f",{4 * ',Rotation'}{3 * ',Position'},Mean Marker Error\n"
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,\n"
        "0,0.00,0,0,0,1,0.1,0.2,0.3,0.0001\n1,0.01,0,0,0,1,0.1,0.2,0.4,0.0001\n"
    )
    got = read_optitrack(path, {})
    assert got.signal("Tool/translation", "m").y[1].tolist() == pytest.approx([0.1, 0.2, 0.4])


def test_qualisys_bodies_are_read_by_their_matrix_column_by_column(tmp_path: Path) -> None:
    """As IMUSim reads such files: Rot[0..2] is the first column, a residual of -1 is not seen."""
    turn = "0 1 0 -1 0 0 0 0 1"  # of the body's x to the room's y
    rows = [
        f"100 200 300 9 9 9 0.1 {turn}",
        "0 0 0 0 0 0 -1 0 0 0 0 0 0 0 0 0",
        f"100 200 400 9 9 9 0.1 {turn}",
    ]
    head = "NO_OF_FRAMES 3|NO_OF_BODIES 1|FREQUENCY 100|DATA_INCLUDED 6D|BODY_NAMES Tool"
    names = "X Y Z Roll Pitch Yaw Residual " + " ".join(f"Rot[{i}]" for i in range(9))
    text = "\n".join([*head.split("|"), names, *rows]).replace(" ", "\t") + "\n"
    path = tmp_path / "x.tsv"
    path.write_text(text)
    got = read_qualisys(path, {})
    assert got.signal("Tool/translation", "m").y.tolist() == [[0.1, 0.2, 0.3], [0.1, 0.2, 0.4]]
    assert got.signal("Tool/translation", "m").t.tolist() == [0.0, 0.02]
    R = got.signal("Tool/rotation", "1").y[0].reshape(3, 3)
    assert (R @ [1, 0, 0]).tolist() == [0, 1, 0]
    path.write_text(text.replace("-1\t0\t0\t0\t0\t1\n", "-1\t0\t0\t0\t0\t2\n"))
    with pytest.raises(RecordingError, match="Tool: sample 1 is not a rotation"):
        read_qualisys(path, {})


def test_a_trc_file_without_a_name_is_none(tmp_path: Path) -> None:
    text = (
        "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tNumFrames\n100\t1\nFrame#\tTime\n\tX1\n1\t0\n"
    )
    (tmp_path / "x.trc").write_text(text)
    with pytest.raises(RecordingError, match="line 4 names no point"):
        read_trc(tmp_path / "x.trc", {})
