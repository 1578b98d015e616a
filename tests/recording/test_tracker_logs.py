"""Logs of trackers as programs of NDI and laboratories write them: states by other names, tools
named before their letters, numbers that are none, clocks, markers of the Optotrak."""

from pathlib import Path

import numpy as np
import pytest

from validate.errors import RecordingError, UsageError
from validate.recording.motion_capture.ndi import read_ndi
from validate.recording.reader import length
from validate.recording.readers import recognised
from validate.recording.tables.point_table import read_point_table
from validate.recording.tables.testing_machine import read_instron

POSE = "1,0,0,0,{},2,3"


def log(path: Path, head: str, *rows: str) -> Path:
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.mark.parametrize("state", ["Transform Status", "TransformStatus", "State", "status:"])
@pytest.mark.parametrize("after", [False, True])
def test_a_state_by_any_name_decides_what_was_seen(tmp_path: Path, state: str, after: bool) -> None:
    columns = "q0,qx,qy,qz,tx,ty,tz"
    head = f"time,{columns},error,{state}" if after else f"time,{state},{columns},error"
    rows = [
        f"{t},{POSE.format(t)},0.1,{s}" if after else f"{t},{s},{POSE.format(t)},0.1"
        for t, s in ((0, "OK"), (1, "Missing"), (2, "ok"))
    ]
    got = read_ndi(log(tmp_path / "x.csv", head, *rows), {})
    assert got.signal("tool1/translation", "m").t.tolist() == [0, 2]


def test_states_of_single_markers_say_nothing_of_the_tool(tmp_path: Path) -> None:
    """NDI's program: a tool's state, its pose, then each marker with a state of its own."""
    tool = "Port {},State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error,Marker 1 Status,Mx,My,Mz"
    head = f"time,{tool.format(1)},{tool.format(2)}"
    row = "0,01,OK,{},0.1,Missing,0,0,0,02,OK,{},0.1,Missing,0,0,0"
    got = read_ndi(log(tmp_path / "x.csv", head, row.format(*[POSE.format(5)] * 2)), {})
    assert set(got.signals) == {f"port{k}/{s}" for k in (1, 2) for s in ("rotation", "translation")}


def test_what_was_never_seen_is_told_with_its_states(tmp_path: Path) -> None:
    path = log(tmp_path / "x.csv", "time,state,q0,qx,qy,qz,tx,ty,tz", f"0,Far,{POSE.format(1)}")
    with pytest.raises(
        RecordingError,
        match=r"no tool is visible.*\['Far'\]: --map",
    ):
        read_ndi(path, {})


NAMES = {
    "before": "Probe Q0,Probe Qx,Probe Qy,Probe Qz,Probe Tx,Probe Ty,Probe Tz",
    "dotted": "Probe.rot.w,Probe.rot.x,Probe.rot.y,Probe.rot.z,Probe.pos.x,Probe.pos.y,Probe.pos.z",
    "whole words": "Probe_orientation_w,Probe_orientation_x,Probe_orientation_y,"
    "Probe_orientation_z,Probe_position_x,Probe_position_y,Probe_position_z",
    "units": "Probe_q0,Probe_qx,Probe_qy,Probe_qz,Probe_x (mm),Probe_y (mm),Probe_z (mm)",
    "after": "q0_Probe,qx_Probe,qy_Probe,qz_Probe,tx_Probe,ty_Probe,tz_Probe",
}


@pytest.mark.parametrize("names", NAMES)
def test_a_tool_may_be_named_before_its_letters_or_after(tmp_path: Path, names: str) -> None:
    path = log(tmp_path / "x.csv", f"time,{NAMES[names]}", f"0,{POSE.format(1)}")
    assert recognised(path).name == "ndi"
    got = read_ndi(path, {})
    assert got.signal("Probe/translation", "m").y.tolist() == [[0.001, 0.002, 0.003]]
    assert ("assumed" in got.metadata["provenance"]) == (names != "units")


def test_metres_in_brackets_are_no_millimetres(tmp_path: Path) -> None:
    head = "time,x [m],y [m],z [m],qx,qy,qz,qw"
    got = read_ndi(log(tmp_path / "x.csv", head, "0,1,2,3,0,0,0,1"), {})
    assert got.signal("tool1/translation", "m").y.tolist() == [[1, 2, 3]]


def test_numbers_that_are_none_are_not_seen(tmp_path: Path) -> None:
    none = ",".join(["-3.697314e+28"] * 7)
    head = "time,q0,qx,qy,qz,tx,ty,tz"
    got = read_ndi(log(tmp_path / "x.csv", head, f"0,{POSE.format(1)}", f"1,{none}"), {})
    assert got.signal("tool1/translation", "m").t.tolist() == [0]


@pytest.mark.parametrize("times", [
    ("23:59:59.750", "00:00:00.250"),
    ("2021-05-04 23:59:59,750", "2021-05-05 00:00:00,250"),
    ("2021-05-31T23:59:59.75Z", "2021-06-01T00:00:00.25Z"),
])  # fmt: skip
def test_times_of_the_day_are_seconds(tmp_path: Path, times: tuple[str, str]) -> None:
    head = "timestamp;q0;qx;qy;qz;tx;ty;tz"
    rows = [f"{t};{POSE.format(1).replace(',', ';')}" for t in times]
    got = read_ndi(log(tmp_path / "x.csv", head, *rows), {})
    assert got.signal("tool1/translation", "m").t.tolist() == pytest.approx([0, 0.5])


def test_lines_of_the_sample_of_ndi_go_on_where_its_names_end_in_dots(tmp_path: Path) -> None:
    head = "Frame#,ToolHandle,Face#,TransformStatus,q0,qx,qy,qz,tx,ty,tz,error,#markers,"
    head += "[Marker1:status,x,y,z],[Marker2..."
    row = "{},{},0,{},1,0,0,0,{},2,3,0.1,4,OK,1,2,3,OK,1,2,3,OK,4,5,6,OK,7,8,9"
    gone = "{},{},0,Missing,,,,,,,,,0"
    rows = [row.format(k, h, "Enabled", k) for k in range(3) for h in ("0A", "0B")]
    rows[3] = gone.format(1, "0B")
    got = read_ndi(log(tmp_path / "x.csv", head, *rows), {"rate": "60"})
    assert got.signal("0A/translation", "m").t.tolist() == pytest.approx([0, 1 / 60, 2 / 60])
    assert got.signal("0B/translation", "m").t.tolist() == pytest.approx([0, 2 / 60])


OPTOTRAK = """Number of frames:{s}3
Number of markers:{s}2
Frequency:{s}100.000000
Units:{s}mm

Frame{s}Marker_1 x{s}Marker_1 y{s}Marker_1 z{s}Marker_2 x{s}Marker_2 y{s}Marker_2 z{s}
1{s}1.5{s}2.5{s}3.5{s}4.5{s}5.5{s}6.5{s}
2{s}1.5{s}2.5{s}3.5{s}{s}{s}{s}
3{s}1.5{s}2.5{s}3.5{s}-3.697314e+28{s}-3.697314e+28{s}-3.697314e+28{s}
"""


@pytest.mark.parametrize("separator", [",", "\t"])
def test_markers_of_an_optotrak_are_points(tmp_path: Path, separator: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(OPTOTRAK.format(s=separator))
    assert recognised(path).name == "points"
    markers = read_point_table(path, {}).marker("markers")
    assert markers.names == ("Marker_1", "Marker_2")
    np.testing.assert_allclose(markers.x[:, 0], [[1.5e-3, 2.5e-3, 3.5e-3]] * 3)
    assert np.isnan(markers.x[1:, 1]).all()
    assert markers.t.tolist() == pytest.approx([0, 0.01, 0.02])


def test_bodies_of_an_optotrak_have_the_times_of_their_frequency(tmp_path: Path) -> None:
    above = "Number of rigid bodies:,1\nFrequency:,50\nUnits:,cm\n\n"
    path = tmp_path / "x.csv"
    path.write_text(f"{above}Frame,{NAMES['before']}\n1,{POSE.format(1)}\n2,{POSE.format(2)}\n")
    got = read_ndi(path, {}).signal("Probe/translation", "m")
    assert got.t.tolist() == [0, 0.02]
    assert got.y[:, 0].tolist() == [0.01, 0.02]


def test_each_tool_has_the_state_of_its_name_wherever_it_stands(tmp_path: Path) -> None:
    group = "{0}_qw,{0}_qx,{0}_qy,{0}_qz,{0}_tx,{0}_ty,{0}_tz,{0}_status"
    rows = [f"{t},{POSE.format(1)},OK,{POSE.format(2)},{'OK' if t else 'LOST'}" for t in (0, 1)]
    path = log(tmp_path / "x.csv", f"time,{group.format('A')},{group.format('B')}", *rows)
    got = read_ndi(path, {})
    assert got.signal("A/translation", "m").t.tolist() == [0, 1]
    assert got.signal("B/translation", "m").t.tolist() == [1]


@pytest.mark.parametrize(("column", "seen", "lost"), [
    ("Valid", "True", "False"), ("visible", "yes", "no"), ("tracking status", "1", "0"),
])  # fmt: skip
def test_what_counts_as_seen_is_known_or_asked_for(
    tmp_path: Path, column: str, seen: str, lost: str
) -> None:
    head = f"time,{column},q0,qx,qy,qz,tx,ty,tz"
    rows = [f"{t},{s},{POSE.format(1)}" for t, s in enumerate((seen, lost, seen))]
    path = log(tmp_path / "x.csv", head, *rows)
    said = {}
    if seen == "1":  # of NDI's numbers 0, of others 1 is good
        with pytest.raises(RecordingError, match=r"\['0', '1'\]: --map ok="):
            read_ndi(path, {})
        said = {"ok": "1"}
    assert read_ndi(path, said).signal("tool1/translation", "m").t.tolist() == [0, 2]


@pytest.mark.parametrize(
    ("name", "step"), [("timestamp_ms", 1e-3), ("Zeit", 1), ("Temps (ms)", 1e-3), ("time_us", 1e-6)]
)
def test_a_time_by_other_names_is_one(tmp_path: Path, name: str, step: float) -> None:
    rows = [f"{t},{POSE.format(1)}" for t in (100, 120)]
    got = read_ndi(log(tmp_path / "x.csv", f"{name},q0,qx,qy,qz,tx,ty,tz", *rows), {})
    assert got.signal("tool1/translation", "m").t.tolist() == pytest.approx([0, 20 * step])


@pytest.mark.parametrize("name", ["acc", "gyro", "linear_velocity", "Moment", "q"])
def test_axes_of_what_is_no_place_make_no_point(tmp_path: Path, name: str) -> None:
    """An inertial unit's log was taken for points, and asked for their unit of length."""
    head = f"time (s),{name}_x,{name}_y,{name}_z"
    path = log(tmp_path / "x.csv", head, *(f"{t},1,2,3" for t in range(12)))
    assert recognised(path).name == "instron"
    mixed = log(tmp_path / "y.csv", f"{head},tip_x (mm),tip_y (mm),tip_z (mm)", "0,1,2,3,4,5,6")
    markers = recognised(mixed).read(mixed, {}).marker("markers")
    assert (markers.names, markers.x.tolist()) == (("tip",), [[[0.004, 0.005, 0.006]]])


TUM = ["1305031102.10 0.1 0.2 0.3 0 0 0 1", "1305031102.12 0.4  0.5 0.6 0 0 0 1"]


def test_a_trajectory_of_words_and_numbers_at_spaces(tmp_path: Path) -> None:
    """It was called no table; its lengths are in m, where a tracker of NDI writes mm."""
    path = log(tmp_path / "t.txt", "# timestamp tx ty tz qx qy qz qw", *TUM)
    assert recognised(path).name == "ndi"
    with pytest.raises(UsageError, match=r"--map unit=m \(as"):
        read_ndi(path, {})
    got = read_ndi(path, {"unit": "m"}).signal("tool1/translation", "m")
    assert np.allclose(got.y, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    assert np.allclose(got.t, [0, 0.02], atol=1e-6)


def test_a_trajectory_without_names_is_told_which_to_write(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="for poses over time, the line: #"):
        read_instron(log(tmp_path / "t.txt", *TUM), {})


def test_points_at_spaces(tmp_path: Path) -> None:
    path = log(tmp_path / "p.txt", "# t[s] A_x[mm] A_y[mm] A_z[mm]", "0.0  1 2 3", "0.1  4 5 6")
    assert recognised(path).name == "points"
    assert read_point_table(path, {}).marker("markers").x.tolist() == [
        [[0.001, 0.002, 0.003]],
        [[0.004, 0.005, 0.006]],
    ]


def test_velocities_and_quaternions_beside_a_point_are_none(tmp_path: Path) -> None:
    """As EuRoC's ground truth has them: `--map unit=mm` was advised, for all of them."""
    names = ["#timestamp", *(f" p_R_{c} [m]" for c in "xyz"), *(f" q_R_{c} []" for c in "wxyz")]
    names += [f" v_R_{c} [m s^-1]" for c in "xyz"]
    rows = [f"{1403636580838555648 + k * 5000000},{k},2,3,1,0,0,0,9,9,9" for k in range(3)]
    found = read_point_table(log(tmp_path / "e.csv", ",".join(names), *rows), {"time": "ns"})
    markers = found.marker("markers")
    assert markers.names == ("p_R",)
    assert markers.x[:, 0, 0].tolist() == [0, 1, 2]
    assert np.allclose(markers.t, [0, 0.005, 0.01], rtol=0, atol=5e-7)  # ns since 1970 as float


def test_rows_without_a_time_are_damage(tmp_path: Path) -> None:
    head = "time,q0,qx,qy,qz,tx,ty,tz,error"
    path = log(tmp_path / "x.csv", head, *(f"{t},{POSE.format(0)},0.1" for t in ("0", "", "0.2")))
    with pytest.raises(RecordingError, match=r"x.csv: 1 rows without a time; damaged"):
        read_ndi(path, {})


@pytest.mark.parametrize("text", ["0", "-1mm", "5kg", "wide", "nan", "inf"])
def test_a_length_is_above_zero_and_has_a_unit_of_length(text: str) -> None:
    with pytest.raises(UsageError, match=f"--map side={text}: expected a length, as 0.1mm"):
        length({"side": text}, "side", "0.1mm")
    assert length({"side": "0"}, "side", "0.1mm", zero=True) == 0.0
    assert length({"side": "mm"}, "side", "0.1mm") == 1e-3
