"""What Vicon, Qualisys and OptiTrack export by their settings: decimal commas, separators, what was
not seen, versions of headers, units, rotations. Two points over two frames, the second not seen in
the second frame."""

from pathlib import Path

import numpy as np
import pytest
from command_line import here

from validate.errors import RecordingError, UsageError
from validate.recording.motion_capture.optitrack import read_optitrack
from validate.recording.motion_capture.qualisys import read_qualisys
from validate.recording.motion_capture.vicon import read_vicon
from validate.recording.readers import recognised
from validate.recording.types import Recording

A, B = [1.5, 2.0, 3.25], [4.0, 5.0, 6.0]
GONE = {"blank": "{s}{s}", "zeros": "0{s}0{s}0", "decimal zeros": "0.000{s}0.000{s}0.000",
        "NaN": "NaN{s}NaN{s}NaN", "NULL": "NULL{s}NULL{s}NULL"}  # fmt: skip


def rows(separator: str, gone: str, before: tuple[str, str] = ("", ""), comma: bool = False) -> str:
    def text(values: list[float]) -> str:
        return separator.join(str(v) for v in values)

    first = before[0] + text(A) + separator + text(B)
    second = before[1] + text(A) + separator + GONE[gone].format(s=separator)
    table = f"{first}\n{second}\n"
    return table.replace(".", ",") if comma else table


def vicon(
    separator: str, gone: str, unit: str = "mm", comma: bool = False, lone: bool = True
) -> str:
    s, units = separator, separator.join([unit] * 6)
    end = "" if lone else 7 * s
    head = f"Trajectories{end}\n100{end}\n{s}{s}x:A{s}{s}{s}x:B{s}{s}\nFrame{s}Sub Frame{s}"
    head += f"X{s}Y{s}Z{s}X{s}Y{s}Z\n{s}{s}{units}\n"
    return head + rows(s, gone, (f"1{s}0{s}", f"2{s}0{s}"), comma)


def qualisys(gone: str, version: int = 1, event: bool = False, comma: bool = False) -> str:
    head = "NO_OF_FRAMES\t2\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nDESCRIPTION\t--\n"
    head += "TIME_STAMP\t2020-01-01, 10:00:00.000\t12345.6\nDATA_INCLUDED\t3D\n"
    head += "EVENT\tHeel strike\t5\t0.04\n" if event else ""
    head += "MARKER_NAMES\tA\tB\n"
    if version == 1:
        return head + rows("\t", gone, comma=comma)
    head = "FILE_VERSION\t2.0.0\n" + head + "TRAJECTORY_TYPES\tMeasured\tMixed\n"
    head += "Frame\tTime\tA X\tA Y\tA Z\tB X\tB Y\tB Z\n"
    return head + rows("\t", gone, ("1\t0.00\t", "2\t0.01\t"), comma)


def optitrack(separator: str, version: str, unit: str, turn: str, comma: bool = False) -> str:
    wide = 4 if turn == "Quaternion" else 3
    kinds = ["Rigid Body"] * (wide + 4) + ["Marker"] * 6
    names = ["Box"] * (wide + 4) + ["A"] * 3 + ["B"] * 3
    parts = ["Rotation"] * wide + ["Position"] * 3 + ["Mean Marker Error"] + ["Position"] * 6
    axes = [*"XYZW"[:wide], *"XYZ", "", *"XYZXYZ"]
    lines = [["", "Type", *kinds], ["", "Name", *names], ["", "ID", *["1"] * len(names)]]
    if version == "1.24":
        lines.append(["", "Parent", *["Box"] * len(names)])
    lines += [["", "", *parts], ["Frame", "Time (Seconds)", *axes]]
    head = ["Format Version", version, "Take Name", "T", "Rotation Type", turn, "Length Units",
            unit, "Coordinate Space", "Global"]  # fmt: skip
    s = separator
    pose = [*(["0"] * (wide - 1)), "1", "7", "8", "9", "0.5"]
    before = tuple(s.join([str(k), f"0.0{k}", *pose]) + s for k in range(2))
    told = "\n".join(s.join(line) for line in [head, [], *lines])
    return f"{told}\n{rows(s, 'blank', before, comma)}"  # type: ignore[arg-type]


CASES = {
    **{f"vicon {g}": vicon(",", g) for g in GONE},
    "vicon semicolons": vicon(";", "blank", lone=False),
    "vicon decimal comma": vicon(";", "zeros", comma=True, lone=False),
    "vicon decimal comma, lone": vicon(";", "blank", comma=True),
    "vicon tabs": vicon("\t", "blank"),
    "vicon metres": vicon(",", "blank", unit="m"),
    **{f"qualisys {g}": qualisys(g) for g in GONE},
    **{f"qualisys 2 {g}": qualisys(g, 2) for g in GONE},
    "qualisys decimal comma": qualisys("blank", comma=True),
    "qualisys 2 decimal comma": qualisys("decimal zeros", 2, comma=True),
    "qualisys event": qualisys("NULL", event=True),
    "optitrack 1.21 metres": optitrack(",", "1.21", "Meters", "Quaternion"),
    "optitrack 1.23 angles": optitrack(",", "1.23", "Millimeters", "XYZ"),
    "optitrack 1.24 cm": optitrack(",", "1.24", "Centimeters", "Quaternion"),
    "optitrack decimal comma": optitrack(";", "1.23", "Millimeters", "Quaternion", comma=True),
}


def read(path: Path, text: str, start: bytes = b"") -> Recording:
    path.write_bytes(start + text.encode())
    return recognised(path).read(path, {})


@pytest.mark.parametrize("name", CASES)
def test_every_export_holds_the_same_points(name: str, tmp_path: Path) -> None:
    got = read(tmp_path / "x.csv", CASES[name])
    scale = {"metres": 1.0, "cm": 0.01}.get(name.split()[-1], 0.001)
    wanted = scale * np.array([[A, B], [A, [np.nan] * 3]])
    assert got.marker("markers").x == pytest.approx(wanted, rel=1e-12, nan_ok=True)
    assert got.marker("markers").names in (("A", "B"), ("x:A", "x:B"))
    assert got.marker("markers").t == pytest.approx([0, 0.01])
    if name.startswith("optitrack"):
        quaternion = "angles" not in name
        assert ("Box/rotation" in got.signals) == quaternion
        assert got.unread == (
            {}
            if quaternion
            else {"Box": "its rotation is not a quaternion; export it as Rotation Type Quaternion"}
        )


@pytest.mark.parametrize("name", ["vicon blank", "qualisys 2 NULL", "optitrack 1.24 cm"])
def test_a_mark_of_the_encoding_changes_nothing(name: str, tmp_path: Path) -> None:
    got = read(tmp_path / "x.csv", CASES[name], b"\xef\xbb\xbf")
    assert got.marker("markers").x.shape == (2, 2, 3)


def test_a_row_that_begins_with_null_loses_no_row(tmp_path: Path) -> None:
    """It looks like a line of the header, which ended the header there."""
    table = "1.5\t2\t3\t4\t5\t6\nNULL\tNULL\tNULL\t4\t5\t6\n1.5\t2\t3\t4\t5\t6\n"
    head = qualisys("blank").split("1.5")[0]
    x = read(tmp_path / "x.tsv", head + table).marker("markers").x
    assert x.shape == (3, 2, 3)
    assert np.isnan(x[1, 0]).all()


def test_zeros_that_were_taken_as_not_seen_are_told(tmp_path: Path) -> None:
    got = read(tmp_path / "x.csv", CASES["vicon zeros"])
    assert got.metadata["provenance"]["three zeros"] == "1 points, taken as missing"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (qualisys("blank", 2).replace("\t3D", "\tAnalog"), "data of kind 'Analog'; 3D and 6D are"),
        (qualisys("blank", 2).replace("\t3D", "\t6D"), "8 columns for 2 bodies; expected 16 each"),
        ("Objects\n100\n,,Box\nFrame,Sub Frame,RX\n,,rad\n1,0,0.1\n", "it has Objects"),
        (vicon(";", "blank").replace("1.5", "1,5"), "'1,5' is not a number"),
    ],
)
def test_what_is_not_read_is_named(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=says):
        read(tmp_path / "x.csv", text)


@pytest.mark.parametrize(
    ("kind", "name"), [("vicon", "vicon decimal comma"), ("qualisys", "qualisys 2 NULL")]
)
def test_import_and_inspect_by_the_command(kind: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(CASES[name])
    given = (str(tmp_path / "x.csv"), "--as", kind)
    assert "markers" in here("inspect", *given)[1]
    code, said, _ = here("import", *given, "-o", str(tmp_path / "y.mcap"))
    assert code == 0
    assert "markers" in said


def written(path: Path, text: str) -> Recording:
    path.write_text(text)
    return recognised(path).read(path, {})


def test_two_blocks_of_devices_are_both_read_and_events_told(tmp_path: Path) -> None:
    block = (
        "Devices\n1000\n,,Plate,Plate\nFrame,Sub Frame,Fz,Fz\n,,N,N\n1,0,{0},{0}.5\n1,1,{0},8\n\n"
    )
    events = "Events\n100\nSubject,Context,Name,Time (s)\nS,Left,Foot Strike,1.03\n\n"
    got = written(tmp_path / "x.csv", events + block.format(1) + block.format(2))
    first = {topic: s.y[0, 0] for topic, s in got.signals.items()}
    assert first == {
        "analog/Plate.Fz (1)": 1, "analog/Plate.Fz (2)": 1.5,
        "analog/Plate.Fz (2) (1)": 2, "analog/Plate.Fz (2) (2)": 2.5,
    }  # fmt: skip
    told = got.metadata["provenance"]["events"]
    assert told.startswith("Left Foot Strike 1.03 s (events of the trial")
    assert not got.unread


def test_every_event_of_qualisys_is_told(tmp_path: Path) -> None:
    text = qualisys("blank", event=True).replace(
        "MARKER_NAMES", "EVENT\tToe off\t7\t0.06\nMARKER_NAMES"
    )
    told = written(tmp_path / "x.tsv", text).metadata["provenance"]
    assert told["events"].startswith("Heel strike 0.04 s; Toe off 0.06 s (events of the trial")


def test_a_code_of_time_beside_the_times_of_qualisys_is_no_coordinate(tmp_path: Path) -> None:
    text = qualisys("blank", 2).replace("Time\t", "Time\tSMPTE\t")
    text = text.replace("0.00\t", "0.00\t10:11:12:00\t").replace("0.01\t", "0.01\t10:11:12:01\t")
    got = written(tmp_path / "x.tsv", text).marker("markers")
    assert got.x[0].tolist() == (1e-3 * np.array([A, B])).tolist()


@pytest.mark.parametrize("plate", [False, True])
def test_analog_channels_and_plates_of_qualisys_come_in(tmp_path: Path, plate: bool) -> None:
    text = "NO_OF_SAMPLES\t2\nFREQUENCY\t500\nDESCRIPTION\tForce data\n"
    if plate:
        text += "SAMPLE\tTIME\tForce_X\tForce_Z\n1\t0.000\t1\t2\n2\t0.002\t3\t4\n"
    else:
        text += "CHANNEL_NAMES\tForce_X\tForce_Z\nCHANNEL_GAIN\t1\t1\n1\t2\n3\t4\n"
    got = written(tmp_path / "x.tsv", text)
    assert got.signals["analog/Force_Z"].y[:, 0].tolist() == [2, 4]
    assert got.signals["analog/Force_X"].t.tolist() == [0, 0.002]
    assert len(got.signals) == 2


def trc(times: list[str], rate: str, z: str = "3.5") -> str:
    head = "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tNumMarkers\tUnits\n" + rate + "\t1\tmm\n"
    rows = "".join(f"{i + 1}\t{t}\t0\t0\t{z}\n" for i, t in enumerate(times))
    return f"{head}Frame#\tTime\ttip\t\t\n\t\tX1\tY1\tZ1\n\n{rows}"


def test_times_rounded_to_equal_ones_are_counted_at_the_stated_rate(tmp_path: Path) -> None:
    times = [f"{k / 2000:.3f}" for k in range(9)]
    got = written(tmp_path / "x.trc", trc(times, "2000"))
    assert got.marker("markers").t.tolist() == pytest.approx(np.arange(9) / 2000)
    assert "2000 Hz that the file declares" in got.metadata["provenance"]["assumed"]
    (tmp_path / "y.trc").write_text(trc(["0", "0.1", "0.1"], "2000"))
    with pytest.raises(RecordingError, match=r"row 3 is not after .* give --map rate=HZ"):
        recognised(tmp_path / "y.trc").read(tmp_path / "y.trc", {})


def test_three_zeros_of_a_trc_are_not_seen(tmp_path: Path) -> None:
    got = written(tmp_path / "x.trc", trc(["0", "0.1"], "10", "0"))
    assert np.isnan(got.marker("markers").x).all()
    assert got.metadata["provenance"]["three zeros"] == "2 points, taken as missing"


@pytest.mark.parametrize("before", [True, False])
@pytest.mark.parametrize("end", ["", "\t"])
@pytest.mark.parametrize("points", [1, 2, 3])
def test_residuals_beside_the_points_of_qualisys_are_no_coordinates(
    tmp_path: Path, before: bool, end: str, points: int
) -> None:
    """Two points with residuals are as wide as frame, time and two points."""
    head = f"NO_OF_FRAMES\t2\nNO_OF_MARKERS\t{points}\nFREQUENCY\t100\nDATA_INCLUDED\t3D\n"
    head += "MARKER_NAMES" + "".join(f"\tm{k}" for k in range(points)) + "\n"
    row = "\t".join(f"{k + 1}.5\t2\t3\t0.4" for k in range(points)) + end + "\n"
    rows = [f"{i + 11}\t{5 + 0.01 * i:.5f}\t{row}" if before else row for i in range(2)]
    got = written(tmp_path / "x.tsv", head + "".join(rows)).marker("markers")
    one = [[1e-3 * (k + 1.5), 2e-3, 3e-3] for k in range(points)]
    np.testing.assert_allclose(got.x, [one] * 2)


def test_zeros_of_optitrack_are_not_seen(tmp_path: Path) -> None:
    text = optitrack(",", "1.23", "Meters", "Quaternion")
    gone = ",".join(["2", "0.02", *["0"] * 8, "0,0,0", *map(str, B)])
    got = written(tmp_path / "x.csv", f"{text}{gone}\n")
    x = got.marker("markers").x
    assert np.isnan(x[2, 0]).all()
    assert x[2, 1].tolist() == B
    assert got.metadata["provenance"]["three zeros"].startswith("1 points")
    assert len(got.signals["Box/rotation"].t) == 2


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_text_of_nexus_1_is_called_so(tmp_path: Path, end: str) -> None:
    """It was taken for two tests of a testing machine."""
    path = tmp_path / "x.csv"
    path.write_bytes(f"TRAJECTORIES{end}100,Hz{end},s:A,,{end}Field #,X,Y,Z{end}".encode())
    with pytest.raises(UsageError, match=r"Vicon Nexus 1, .* as C3D"):
        recognised(path)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        (
            "x.csv",
            vicon(",", "zeros").replace("\n100\n", "\nfast\n"),
            "line 2: 'fast' is not a rate in Hz",
        ),
        (
            "x.csv",
            vicon(",", "zeros").replace("X,Y,Z", "X,Y,W"),
            "without columns X, Y, Z; damaged",
        ),
        (
            "y.csv",
            "Format Version,1.23\nFrame,Time (Seconds)\n0,0\n",
            "no lines of types and names above Frame; damaged",
        ),
    ],
)
def test_damaged_exports_name_what_is_missing(
    name: str, text: str, says: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text, "utf-8")
    reader = read_vicon if text.startswith("Traj") else read_optitrack
    with pytest.raises(RecordingError, match=says):
        reader(tmp_path / name, {})


def test_a_body_that_was_never_tracked_is_reported_with_its_count(tmp_path: Path) -> None:
    text = "NO_OF_FRAMES\t2\nNO_OF_BODIES\t1\nFREQUENCY\t100\nDATA_INCLUDED\t6D\nBODY_NAMES\tA\n"
    text += ("\t".join(["0.000"] * 6 + ["-1.000"] + ["0.000"] * 9) + "\n") * 2
    (tmp_path / "x.tsv").write_text(text, "utf-8")
    with pytest.raises(RecordingError, match=r"no body is visible: {'A': '2 of 2'}"):
        read_qualisys(tmp_path / "x.tsv", {})
    (tmp_path / "x.tsv").write_text(text.replace("Y\t100", "Y\tfast"), "utf-8")
    with pytest.raises(RecordingError, match=r"'fast'.*above 0 Hz"):
        read_qualisys(tmp_path / "x.tsv", {})
