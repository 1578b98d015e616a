"""Frames along a chain: ways that agree, ways that contradict, mirrors; scales of markers."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validate.errors import RecordingError, UsageError
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import chain_faults, links, pose_signals, require_chain
from validate.recording.preflight import Inspection
from validate.recording.readers import read_recording, recognised
from validate.recording.scales import odd_scales
from validate.recording.types import Markers, Recording, Signal, Source

T = np.arange(40) / 20
RNG = np.random.default_rng(4)
FIRST = Rotation.random(40, random_state=1).as_matrix(), RNG.normal(0, 0.1, (40, 3))
SECOND = Rotation.random(40, random_state=2).as_matrix(), RNG.normal(0, 0.1, (40, 3))


def posed(name: str, R: np.ndarray, x: np.ndarray, frame: str) -> dict[str, Signal]:
    return pose_signals(name, T, R, x, frame)


def joined() -> tuple[np.ndarray, np.ndarray]:
    """The stylus in the room, by way of the tracker."""
    (R, x), (S, y) = FIRST, SECOND
    return S @ R, (S @ x[..., None])[..., 0] + y


def recording(**changed: tuple[np.ndarray, np.ndarray]) -> Recording:
    poses = {"StylusToTracker": FIRST, "TrackerToRoom": SECOND, "StylusToRoom": joined()} | changed
    signals: dict[str, Signal] = {}
    for name, (R, x) in poses.items():
        signals |= posed(name, R, x, name.rpartition("To")[2])
    return Recording("r", Source("r", "", 0, ""), 0, signals=signals)


def test_ways_that_agree_are_no_fault() -> None:
    made = recording()
    assert [(link.child, link.parent) for link in links(made)] == [
        ("Stylus", "Tracker"), ("Tracker", "Room"), ("Stylus", "Room"),
    ]  # fmt: skip
    assert list(chain_faults(made)) == []
    require_chain(made)


def test_a_transform_that_is_turned_round_contradicts() -> None:
    R, x = SECOND
    back = R.swapaxes(1, 2), -(R.swapaxes(1, 2) @ x[..., None])[..., 0]
    with pytest.raises(RecordingError, match="'Tracker' in 40 of 40 samples"):
        require_chain(recording(TrackerToRoom=back))


def test_a_shift_beyond_what_is_allowed_is_told_in_mm() -> None:
    R, x = joined()
    (line,) = chain_faults(recording(StylusToRoom=(R, x + np.array([0.0, 0.005, 0.0]))))
    assert "in 40 of 40 samples, by up to 5 mm and" in line
    assert list(chain_faults(recording(StylusToRoom=(R, x + 1e-3)))) == []


def test_a_few_poses_are_outliers_a_third_is_a_fault() -> None:
    R, x = joined()
    for count, faults in ((3, 0), (14, 1)):
        moved = x.copy()
        moved[:count] += 0.05
        assert len(list(chain_faults(recording(StylusToRoom=(R, moved))))) == faults


def test_longer_ways_pairs_and_frames_in_themselves_are_closed() -> None:
    (R, x), here = FIRST, (np.tile(np.eye(3), (40, 1, 1)), np.zeros((40, 3)))
    S, y = joined()
    off = y + np.array([0.05, 0.0, 0.0])
    back = R.swapaxes(1, 2), -(R.swapaxes(1, 2) @ (x + 0.05)[..., None])[..., 0]
    far = {"RoomToHall": here, "StylusToHall": (S, off)}
    for extra, by in ((far, "'Tracker', 'Room'"), ({"TrackerToStylus": back}, "the other pose"),
                      ({"RoomToRoom": (here[0], here[1] + 0.05)}, "the other pose")):  # fmt: skip
        (line,) = chain_faults(recording(**extra))
        assert f"contradicts the way by {by}" in line


def test_one_pose_alone_stands_for_all_times_and_sds_widen_what_is_allowed() -> None:
    (R, x), (S, y) = FIRST, SECOND
    still = {f"TrackerToRoom/{k}": Signal(T[:1], v[:1].reshape(1, -1), u, 0.0, "Room")
             for k, v, u in (("rotation", S, "1"), ("translation", y, "m"))}  # fmt: skip
    way = S[0] @ R, x @ S[0].T + y[0] + np.array([0.005, 0.0, 0.0])
    poses = posed("StylusToTracker", *FIRST, "Tracker") | still
    made = Recording("r", Source("r", "", 0, ""), 0,
                     signals=poses | posed("StylusToRoom", *way, "Room"))  # fmt: skip
    (line,) = chain_faults(made)
    assert "40 of 40 samples, by up to 5 mm" in line
    sure = {k: Signal(s.t, s.y, s.unit, 5e-3 if s.unit == "m" else 0.0, s.frame)
            for k, s in made.signals.items()}  # fmt: skip
    assert list(chain_faults(Recording("r", made.source, 0, signals=sure))) == []


def test_a_left_handed_pose_is_told() -> None:
    R, x = FIRST
    mirrored = R * np.array([1.0, 1.0, -1.0])
    lines = list(chain_faults(recording(StylusToTracker=(mirrored, x))))
    assert "40 of 40 are left-handed (determinant -1)" in lines[0]
    scaled = next(chain_faults(recording(StylusToTracker=(1.1 * R, x))))
    assert "not a rotation (error 0.21)" in scaled


def test_poses_at_other_times_are_not_compared() -> None:
    made = recording()
    late = {k: Signal(s.t + 100, s.y, s.unit, s.sd, s.frame)
            for k, s in made.signals.items() if k.startswith("StylusToRoom")}  # fmt: skip
    other = Recording("r", made.source, 0, signals={**made.signals, **late})
    assert list(chain_faults(other)) == []


def test_every_road_tells_it(tmp_path: Path) -> None:
    """Of a file of ours too: inspected as a defect, refused where it is read."""
    R, x = joined()
    write_recording(recording(StylusToRoom=(R, x + 0.05)), tmp_path / "r.mcap")
    (line,) = Inspection.of(tmp_path / "r.mcap").defects
    assert "contradicts the way by 'Tracker'" in line
    with pytest.raises(RecordingError, match="contradicts the way"):
        read_recording(tmp_path / "r.mcap")


@pytest.mark.parametrize("file", ["stylus", "freehand"])
def test_real_sequences_have_a_chain_without_fault(shared_data: Path, file: str) -> None:
    found = [p for p in sorted((shared_data / "ultrasound" / "tracked").rglob("*.m*"))
             if recognised(p).name == "metaimage"]  # fmt: skip
    some = [p for p in found if file in str(p).lower()] or found
    options = {"m_per_px": "0.1mm"}
    faults = [line for p in some for line in chain_faults(_read(p, options))]
    assert faults == []


def _read(path: Path, options: dict[str, str]) -> Recording:
    try:
        return recognised(path).read(path, {})
    except UsageError:  # no scale is stated
        return recognised(path).read(path, options)


def test_markers_of_millimetres_taken_as_metres_are_asked_back() -> None:
    x = np.array([[[0.0, 0, 0], [120.0, 30, 5]]])
    made = Recording("r", Source("r", "", 0, ""), 0,
                     markers={"m": Markers(np.zeros(1), ("a", "b"), x, 0.0, "lab")})  # fmt: skip
    (line,) = odd_scales(made)
    assert "marker distances of 120 m are outside 0.001 to 50 m" in line
    assert "a factor 1000?" in line
