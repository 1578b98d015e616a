"""C3D: what another program wrote is read as it was meant; damage costs a line."""

import re
import struct
from pathlib import Path

import ezc3d
import numpy as np
import pytest

from validate.child_process import python
from validate.errors import RecordingError, UsageError
from validate.installation import install_command
from validate.recording.formats import subprocess_decoder
from validate.recording.motion_capture import c3d
from validate.recording.motion_capture.c3d import _require_whole, read_c3d

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _LOADING, _SHARED: replaced by a small number: a short test.
# private: _require_whole: a file of its length, without content.
# private: _streams: replaced, to bring a case about.

GRAVITY = Path("markers/silicone-beam/beam_gravity_V2_b.c3d")


def written(path: Path, unit: str = "mm", labels: tuple[str, ...] = ("tip", "base")) -> Path:
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit] if unit else []
    points = np.ones((4, 2, 5))
    points[:3] = np.arange(30.0).reshape(3, 2, 5)
    file["data"]["points"] = points
    file.write(str(path))
    return path


def test_points_of_a_motion_capture_are_metres_at_their_times(shared_data: Path) -> None:
    """Six markers of a silicone beam, 100 Hz, metres, as its makers describe them."""
    got = read_c3d(shared_data / GRAVITY, {})
    markers = got.marker("markers")
    assert markers.names == ("Tip - 1", "Tip - 2", "Tip - 3", "Base - 1", "Base - 2", "Base - 3")
    assert markers.x.shape == (500, 6, 3)
    assert markers.t[-1] == pytest.approx(4.99)
    between = np.linalg.norm(markers.x[:, 3] - markers.x[:, 4], axis=-1)
    assert between.mean() == pytest.approx(0.0578, abs=5e-4)  # rigid clamp
    assert between.std() < 2e-4
    assert got.metadata["provenance"]["unit"] == "m (declared)"
    assert float(got.metadata["provenance"]["residual_median_m"]) == pytest.approx(3e-4, rel=0.1)


def test_it_agrees_with_the_csv_of_the_same_motion(shared_data: Path) -> None:
    """51 markers in mm, exported by the same program as text; half a unit of its last digit."""
    got = read_c3d(shared_data / "markers/mocap/pyomeca_markers_analogs.c3d", {})
    lines = (shared_data / "markers/mocap/pyomeca_markers.csv").read_text("utf-8-sig").splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith("Trajectories"))
    rows = [line.split(",")[2:155] for line in lines[begin + 5 : begin + 585]]
    text = np.array([[float(c) if c else np.nan for c in row] for row in rows])
    markers = got.marker("markers")
    x = 1e3 * markers.x.reshape(580, -1)
    assert np.isnan(x).sum() == np.isnan(text).sum() > 500
    assert np.nanmax(np.abs(x - text)) < 0.006  # mm
    assert len(got.signals) == 38
    assert got.clock["markers"].rate_hz == pytest.approx(100)
    assert {s.t.size for s in got.signals.values()} == {11600}


def test_a_unit_that_the_file_does_not_state_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path / "x.c3d", unit="")
    with pytest.raises(UsageError, match="--map unit=mm"):
        read_c3d(path, {})
    x = read_c3d(path, {"unit": "cm"}).marker("markers").x
    assert x[0, 1].tolist() == pytest.approx([0.05, 0.15, 0.25])
    with pytest.raises(UsageError, match="has the unit 'N' of length"):
        read_c3d(written(tmp_path / "n.c3d", unit="N"), {})


def test_labels_that_stand_twice_or_nowhere_are_numbered(tmp_path: Path) -> None:
    got = read_c3d(written(tmp_path / "x.c3d", labels=("*", "*")), {"sd": "0.3mm"})
    assert got.marker("markers").names == ("* (1)", "* (2)")
    assert got.marker("markers").sd == pytest.approx(3e-4)


def test_a_marker_that_was_not_seen_is_no_position(tmp_path: Path) -> None:
    file = ezc3d.c3d(str(written(tmp_path / "x.c3d")))
    residuals = np.zeros((1, 2, 5))
    residuals[0, 1, 2] = -1
    file["data"]["meta_points"]["residuals"] = residuals
    file.write(str(tmp_path / "y.c3d"))
    got = read_c3d(tmp_path / "y.c3d", {})
    x = got.marker("markers").x
    assert np.isnan(x[2, 1]).all()
    assert np.isnan(x).sum() == 3
    assert got.metadata["provenance"]["points_not_seen"] == "1 of 10"


def test_a_cut_file_is_told_with_its_bytes_before_any_library_reads_it(tmp_path: Path) -> None:
    path = written(tmp_path / "x.c3d")
    whole = path.read_bytes()
    for count in (0, 1, 100, 511, 512, 600, len(whole) - 600):
        path.write_bytes(whole[:count])
        with pytest.raises(RecordingError, match=r"x\.c3d: "):
            read_c3d(path, {})


@pytest.mark.own_process
@pytest.mark.parametrize(
    ("source", "line"),
    [
        ("import os; os.kill(os.getpid(), 11)", "ended with signal 11"),
        ("import sys; sys.exit(7)", "ended with code 7"),
        ("raise ValueError('odd\\nblock')", r"damaged \(odd block\)"),
        ("bytearray(2**33)", "needs more than"),
        ("any(iter(int, 1))", "its reader was stopped after 1 s for 1 bytes"),
    ],
)
def test_a_library_that_crashes_costs_one_line(
    source: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A decoder of ours on a path of its own, that does what bad libraries do."""
    (tmp_path / "decoder.py").write_text(f"def arrays(path):\n    {source}\n    return {{}}\n")
    start = _RUNNER.format(str(tmp_path))
    monkeypatch.setattr(
        subprocess_decoder, "python_module", lambda _, *given: python("-c", start, *given)
    )
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(RecordingError, match=f"^file: .*{line}"):
        subprocess_decoder.decoded("decoder", tmp_path / "file")


_RUNNER = """
import sys; sys.path.insert(0, {!r})
from pathlib import Path
from validate.recording.formats import subprocess_decoder
subprocess_decoder._HOME = ""
decoder, path, out, *limits = sys.argv[1:]
subprocess_decoder.import_module = lambda name: __import__(name.lstrip("."))
raise SystemExit(subprocess_decoder._decode(decoder, Path(path), Path(out), *limits))
"""


@pytest.mark.own_process
def test_a_missing_library_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(UsageError, match=re.escape(install_command("dicom"))):
        subprocess_decoder.decoded("absent_decoder", tmp_path / "file", extra="dicom")


@pytest.mark.parametrize("name", [b"FRAMES", b"USED", b"LABELS"])
def test_a_forged_number_of_values_is_told_before_any_library_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: bytes
) -> None:
    path = written(tmp_path / "x.c3d")
    raw = bytearray(path.read_bytes())
    at = raw.index(name) + len(name) + 3
    raw[at : at + 8] = bytes([7, *[255] * 7])
    path.write_bytes(raw)
    monkeypatch.setattr("validate.recording.motion_capture.c3d.decoded", None)
    with pytest.raises(RecordingError, match=rf"'{name.decode()}' declares 7\.01e\+16 values"):
        read_c3d(path, {})


def test_events_of_a_trial_are_told(tmp_path: Path) -> None:
    file = ezc3d.c3d(str(written(tmp_path / "x.c3d")))
    file.add_parameter("EVENT", "LABELS", ["contact", "lift"])
    file.add_parameter("EVENT", "TIMES", np.array([[0.0, 1.0], [0.05, 2.5]]))
    file.write(str(tmp_path / "y.c3d"))
    told = read_c3d(tmp_path / "y.c3d", {}).metadata["provenance"]
    assert told["events"].startswith("contact 0.05 s; lift 62.5 s")
    file.add_parameter("EVENT", "CONTEXTS", ["Left", "Right"])
    file.write(str(tmp_path / "z.c3d"))
    sided = read_c3d(tmp_path / "z.c3d", {}).metadata["provenance"]
    assert sided["events"].startswith("Left contact 0.05 s; Right lift 62.5 s")
    assert told["first_frame"].startswith("1 of the trial")


@pytest.mark.parametrize(("processor", "scale"), [(84, "cdcc4c3d"), (85, "4c3ecdcc")])
def test_a_file_of_whole_numbers_is_as_long_as_its_own_processor_says(
    tmp_path: Path, processor: int, scale: str
) -> None:
    """A scale of 0.05 in Intel's order and in DEC's, whose last byte holds no sign: coordinates
    are integers of two bytes, and three frames of two points end the file."""
    head = struct.pack("<BBHHHHH", 2, 80, 2, 0, 1, 3, 10) + bytes.fromhex(scale)
    head += struct.pack("<HHf", 3, 0, 50.0)
    path = tmp_path / "x.c3d"
    whole = head.ljust(512, b"\0") + bytes([1, 80, 1, processor]).ljust(512, b"\0")
    path.write_bytes(whole + bytes(3 * 2 * 4 * 2))
    _require_whole(path)
    path.write_bytes(whole + bytes(3 * 2 * 4 * 2 - 1))
    with pytest.raises(RecordingError, match="1072 bytes; truncated"):
        _require_whole(path)


def labelled(file: ezc3d.c3d, path: Path) -> Path:
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file.write(str(path))
    return path


def with_points(count: int, frames: int) -> ezc3d.c3d:
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(f"p{i}" for i in range(count))
    points = np.ones((4, count, frames))
    points[:3] = 1 + np.arange(3.0 * count * frames).reshape(3, count, frames) % 4096
    file["data"]["points"] = points
    return file


def test_angles_that_stand_among_the_points_are_no_positions(tmp_path: Path) -> None:
    """As Vicon's models write them: labels in the group of points, units of their own."""
    file = with_points(3, 4)
    for name, value in (("ANGLES", "p1"), ("ANGLE_UNITS", "deg"), ("MOMENTS", "p2")):
        file.add_parameter("POINT", name, [value])
    got = read_c3d(labelled(file, tmp_path / "x.c3d"), {})
    assert got.marker("markers").names == ("p0",)
    angle = got.signals["model/p1"]
    np.testing.assert_allclose(angle.y, file["data"]["points"][:3, 1].T)
    assert angle.unit == "deg"
    assert got.signals["model/p2"].unit == "not stated"


def test_poses_of_bodies_are_read(tmp_path: Path) -> None:
    """A quarter turn about z takes x to y; 7 mm along x."""
    file = with_points(1, 2)
    T = np.eye(4)
    T[:3] = [[0, -1, 0, 7], [1, 0, 0, 0], [0, 0, 1, 0]]
    file.add_parameter("ROTATION", "LABELS", ["pelvis_4X4"])
    file.add_parameter("ROTATION", "RATE", [100.0])
    file["data"]["rotations"] = np.repeat(T[:, :, None, None], 2, axis=3)
    got = read_c3d(labelled(file, tmp_path / "x.c3d"), {}).signals
    turned = got["pelvis/rotation"].y[1].reshape(3, 3) @ [1, 0, 0]
    np.testing.assert_allclose(turned, [0, 1, 0])
    np.testing.assert_allclose(got["pelvis/translation"].y, [[7e-3, 0, 0]] * 2)


def test_force_plates_alone_need_no_unit_of_length(tmp_path: Path) -> None:
    file = with_points(0, 5)
    analog = file["parameters"]["ANALOG"]
    analog["RATE"]["value"], analog["UNITS"]["value"] = [200.0], ("N", "N")
    analog["LABELS"]["value"] = ("Fz", "Fx")
    file["data"]["analogs"] = np.arange(20.0).reshape(1, 2, 10)
    file["data"]["analogs"][0, 1, 3] = np.nan
    path = labelled(file, tmp_path / "x.c3d")
    got = read_c3d(path, {})
    assert not got.markers
    np.testing.assert_allclose(got.signals["analog/Fz"].y[:, 0], np.arange(10))
    assert got.signals["analog/Fz"].t[-1] == pytest.approx(9 / 200)
    assert got.unread == {"analog/Fx": "1 values are not numbers"}


def test_points_of_three_zeros_were_not_seen(tmp_path: Path) -> None:
    file = with_points(2, 4)
    file["data"]["points"][:3, 1, 2] = 0
    got = read_c3d(labelled(file, tmp_path / "x.c3d"), {})
    assert np.isnan(got.marker("markers").x[2, 1]).all()
    assert got.metadata["provenance"]["three zeros"].startswith("1 points")


@pytest.mark.parametrize("tells", ["LONG_FRAMES", "TRIAL", "nothing"])
def test_a_trial_beyond_what_its_header_counts_is_whole_or_said_to_be_none(
    tmp_path: Path, tells: str
) -> None:
    file = with_points(1, 66_000)
    if tells == "TRIAL":
        file.add_parameter("TRIAL", "ACTUAL_START_FIELD", [1.0, 0.0])
        file.add_parameter("TRIAL", "ACTUAL_END_FIELD", [66_000.0 - 65_536, 1.0])
    elif tells == "LONG_FRAMES":
        file.add_parameter("POINT", tells, [66_000.0])
    got = read_c3d(labelled(file, tmp_path / "x.c3d"), {})
    count = 65_535 if tells == "nothing" else 66_000
    x = 1e3 * got.marker("markers").x[:, 0]
    np.testing.assert_allclose(x, file["data"]["points"][:3, 0, :count].T, rtol=1e-6)
    left = got.metadata["provenance"].get("left out", "")
    assert left.endswith("no parameter does") == (tells == "nothing")


def whole_numbers(first: int, analog: str) -> bytes:
    """Two frames of one point (8, 12, 16) mm and one analog sample, in Intel's whole numbers."""

    def record(name: bytes, group: int, kind: int, shape: list[int], data: bytes) -> bytes:
        body = struct.pack("bB", kind, len(shape)) + bytes(shape) + data + b"\0"
        return struct.pack("bb", len(name), group) + name + struct.pack("<h", 2 + len(body)) + body

    def group(name: bytes, number: int) -> bytes:
        return struct.pack("bb", len(name), -number) + name + struct.pack("<hB", 3, 0)

    words = group(b"POINT", 1) + record(b"UNITS", 1, -1, [2], b"mm")
    for name, kind, value in ((b"USED", 2, struct.pack("<h", 1)), (b"FRAMES", 2, b"\2\0"),
                              (b"SCALE", 4, struct.pack("<f", 0.5)),
                              (b"DATA_START", 2, b"\3\0"),
                              (b"RATE", 4, struct.pack("<f", 100))):  # fmt: skip
        words += record(name, 1, kind, [], value)
    words += group(b"ANALOG", 2) + record(b"FORMAT", 2, -1, [len(analog)], analog.encode())
    for name, kind, value in ((b"USED", 2, b"\1\0"), (b"SCALE", 4, struct.pack("<f", 0.25)),
                              (b"OFFSET", 2, struct.pack("<H", 32_768)),
                              (b"GEN_SCALE", 4, struct.pack("<f", 2)),
                              (b"RATE", 4, struct.pack("<f", 100))):  # fmt: skip
        words += record(name, 2, kind, [1] if name == b"OFFSET" else [], value)
    head = struct.pack("<BBHHHH", 2, 80, 1, 1, first, (first + 1) % 65_536)
    head += struct.pack("<Hf", 10, 0.5) + struct.pack("<HHf", 3, 1, 100)
    front = head.ljust(512, b"\0") + (bytes([1, 80, 1, 84]) + words).ljust(512, b"\0")
    return front + b"".join(struct.pack("<4hH", 16, 24, 32, 0, v) for v in (32_770, 32_764))


@pytest.mark.parametrize("first", [1, 65_535])
def test_whole_numbers_without_a_sign_are_read_as_such(tmp_path: Path, first: int) -> None:
    """Raw 32770 and 32764 about 32768, 0.25 x 2 N each; a trial may begin so late that its header
    counts over 65535."""
    path = tmp_path / "x.c3d"
    path.write_bytes(whole_numbers(first, "UNSIGNED"))
    got = read_c3d(path, {})
    np.testing.assert_allclose(got.marker("markers").x, [[[8e-3, 12e-3, 16e-3]]] * 2, rtol=1e-6)
    assert got.signals["analog/unnamed 1"].y[:, 0].tolist() == [1.0, -2.0]


@pytest.mark.parametrize(
    ("rate", "says"),
    [
        (0.0, "0 frames per second declared; expected above 0"),
        (float("nan"), "nan frames per second declared; expected above 0"),
        (100.0, "neither visible points nor channels: {'markers': 'never seen'}"),
    ],
)
def test_a_file_without_a_rate_or_streams_is_refused(
    rate: float, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "x.c3d")
    monkeypatch.setattr(c3d, "decoded", lambda *_: {"rates": np.array([rate])})
    monkeypatch.setattr(c3d, "_streams", lambda *_: ({}, {}, {"markers": "never seen"}))
    with pytest.raises(RecordingError, match=f"x.c3d: {says}"):
        read_c3d(path, {})


@pytest.mark.own_process
def test_a_decoder_that_the_machine_starts_too_late_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_bytes(b"x" * 7)
    monkeypatch.setattr(subprocess_decoder, "_LOADING", 0)
    monkeypatch.setattr(subprocess_decoder, "_SHARED", 0)
    with pytest.raises(RecordingError, match=r"file.*after 0 s for 7 bytes"):
        subprocess_decoder.decoded(
            "validate.recording.motion_capture.c3d_arrays", tmp_path / "file"
        )
