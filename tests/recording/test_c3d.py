"""C3D: what another program wrote is read as it was meant; damage costs a line."""

import struct
import sys
from pathlib import Path

import ezc3d
import numpy as np
import pytest

from validate.errors import RecordingError, UsageError
from validate.recording.formats import apart
from validate.recording.formats.c3d import _require_whole, read_c3d

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
    assert got.metadata["provenance"]["unit"] == "m (stated)"
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
    with pytest.raises(UsageError, match="states no unit of length; say it: --map unit=mm"):
        read_c3d(path, {})
    x = read_c3d(path, {"unit": "cm"}).marker("markers").x
    assert x[0, 1].tolist() == pytest.approx([0.05, 0.15, 0.25])
    with pytest.raises(UsageError, match="states the unit 'N' of length"):
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


@pytest.mark.parametrize(
    ("source", "line"),
    [
        ("import os; os.kill(os.getpid(), 11)", "ended with signal 11"),
        ("import sys; sys.exit(7)", "ended with code 7"),
        ("raise ValueError('odd\\nblock')", r"damaged \(odd block\)"),
        ("bytearray(2**33)", "wants more than"),
        ("any(iter(int, 1))", "took over 1 s for 1 bytes and was ended"),
    ],
)
def test_a_library_that_crashes_costs_one_line(
    source: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A decoder of ours on a path of its own, that does what bad libraries do."""
    (tmp_path / "decoder.py").write_text(f"def arrays(path):\n    {source}\n    return {{}}\n")
    monkeypatch.setattr(apart, "_RUN", (sys.executable, "-c", _RUNNER.format(str(tmp_path))))
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(RecordingError, match=f"^file: .*{line}"):
        apart.decoded("decoder", tmp_path / "file", "c3d")


_RUNNER = """
import sys; sys.path.insert(0, {!r})
from pathlib import Path
from validate.recording.formats import apart
apart._HOME = ""
decoder, path, out, *limits = sys.argv[1:]
apart.import_module = lambda name: __import__(name.lstrip("."))
raise SystemExit(apart._decode(decoder, Path(path), Path(out), *limits))
"""


def test_a_missing_library_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(UsageError, match=r"pip install 'validate-tissue\[c3d\]'"):
        apart.decoded("absent_decoder", tmp_path / "file", "c3d")


@pytest.mark.parametrize("name", [b"FRAMES", b"USED", b"LABELS"])
def test_a_forged_number_of_values_is_told_before_any_library_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: bytes
) -> None:
    path = written(tmp_path / "x.c3d")
    raw = bytearray(path.read_bytes())
    at = raw.index(name) + len(name) + 3
    raw[at : at + 8] = bytes([7, *[255] * 7])
    path.write_bytes(raw)
    monkeypatch.setattr("validate.recording.formats.c3d.decoded", None)
    with pytest.raises(RecordingError, match=rf"'{name.decode()}' tells of 7\.01e\+16 values"):
        read_c3d(path, {})


def test_events_of_a_trial_are_told(tmp_path: Path) -> None:
    file = ezc3d.c3d(str(written(tmp_path / "x.c3d")))
    file.add_parameter("EVENT", "LABELS", ["contact", "lift"])
    file.add_parameter("EVENT", "TIMES", np.array([[0.0, 1.0], [0.05, 2.5]]))
    file.write(str(tmp_path / "y.c3d"))
    told = read_c3d(tmp_path / "y.c3d", {}).metadata["provenance"]
    assert told["events"].startswith("contact 0.05 s; lift 62.5 s")
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
    with pytest.raises(RecordingError, match="1072 bytes; cut"):
        _require_whole(path)


def test_a_file_of_sgi_is_not_called_damaged(tmp_path: Path) -> None:
    head = struct.pack(">BBHHHHHfHHf", 2, 80, 1, 0, 1, 2, 10, -0.1, 3, 0, 50.0)
    path = tmp_path / "x.c3d"
    path.write_bytes(head.ljust(512, b"\0") + bytes([1, 80, 1, 86]).ljust(512, b"\0") + bytes(512))
    with pytest.raises(RecordingError, match="byte order of SGI"):
        read_c3d(path, {})
