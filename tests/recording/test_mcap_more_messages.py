"""Messages of ROS 2 and Foxglove beside the first: bodies with covariances, pressures, single
points, times as text, numbers in units that are none of SI."""

import json
from pathlib import Path
from typing import Any

import foxglove
import foxglove.messages as fox
import numpy as np
import pytest
from foxglove.channels import OdometryChannel, Point3InFrameChannel
from mcap.writer import Writer as TheirWriter
from rosbags.typesys import Stores, get_typestore

from validate.errors import RecordingError
from validate.recording.mcap.read import read_all
from validate.recording.motion_capture.poses import chain_faults

STORE = get_typestore(Stores.ROS2_HUMBLE)


def plain(path: Path, message: dict[str, Any], schema: str = "") -> Path:
    """One message as JSON."""
    with path.open("wb") as stream:
        writer = TheirWriter(stream)
        writer.start()  # type: ignore[no-untyped-call]
        number = writer.register_schema(schema, "jsonschema", b"{}") if schema else 0
        channel = writer.register_channel("/x", "json", number)
        writer.add_message(channel, 0, json.dumps(message).encode(), 0)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def ros(path: Path, kind: str, topic: str = "/x", **fields: Any) -> Path:
    """One message as rosbags packs it."""
    types = STORE.types
    stamp = types["builtin_interfaces/msg/Time"](sec=5, nanosec=500_000_000)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="lab")
    definition, _ = STORE.generate_msgdef(kind, ros_version=2)
    with path.open("wb") as stream:
        writer = TheirWriter(stream)
        writer.start()  # type: ignore[no-untyped-call]
        schema = writer.register_schema(kind, "ros2msg", definition.encode())
        channel = writer.register_channel(topic, "cdr", schema)
        data = bytes(STORE.serialize_cdr(types[kind](header=header, **fields), kind))
        writer.add_message(channel, 0, data, 0)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def pose() -> Any:

    types = STORE.types
    return types["geometry_msgs/msg/PoseWithCovariance"](
        pose=types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=3.0),
            orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        ),
        covariance=np.zeros(36),
    )


def test_a_pose_with_its_covariance_is_a_pose(tmp_path: Path) -> None:
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    got = read_all(ros(tmp_path / "x.mcap", kind, pose=pose()), {})
    assert got.signal("/x/translation", "m").y.tolist() == [[1, 2, 3]]
    assert got.signal("/x/translation", "m").frame == "lab"
    assert got.t0_ns == 5_500_000_000


def test_odometry_is_the_pose_of_its_body_and_its_topic_no_frame(tmp_path: Path) -> None:
    """A topic that is called as its frame is: no pose of a frame in itself."""
    types = STORE.types
    zero = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    still = types["geometry_msgs/msg/TwistWithCovariance"](
        twist=types["geometry_msgs/msg/Twist"](linear=zero, angular=zero), covariance=np.zeros(36)
    )
    more = {"child_frame_id": "tool", "pose": pose(), "twist": still}
    got = read_all(ros(tmp_path / "x.mcap", "nav_msgs/msg/Odometry", "/lab", **more), {})
    assert got.signal("/lab/tool/translation", "m").y.tolist() == [[1, 2, 3]]
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    same = read_all(ros(tmp_path / "y.mcap", kind, "/lab", pose=pose()), {})
    assert same.signal("/lab/translation", "m").frame == "lab"
    assert not list(chain_faults(same))


def test_a_pressure_is_in_pascal(tmp_path: Path) -> None:
    kind = "sensor_msgs/msg/FluidPressure"
    got = read_all(ros(tmp_path / "x.mcap", kind, fluid_pressure=640.0, variance=0.0), {})
    assert got.signal("/x", "Pa").y.tolist() == [[640]]


def test_points_and_odometry_of_foxglove_are_read(tmp_path: Path) -> None:
    at = fox.Timestamp(50, 250_000_000)
    with foxglove.open_mcap(str(tmp_path / "x.mcap")):
        Point3InFrameChannel("/point").log(
            fox.Point3InFrame(timestamp=at, frame_id="lab", point=fox.Point3(x=1, y=2, z=3))
        )
        turn = fox.Quaternion(x=0, y=0, z=0, w=1)
        where = fox.Pose(position=fox.Vector3(x=4, y=5, z=6), orientation=turn)
        OdometryChannel("/body").log(
            fox.Odometry(timestamp=at, frame_id="lab", body_frame_id="b", pose=where)
        )
    got = read_all(tmp_path / "x.mcap", {})
    assert got.marker("/point").x.tolist() == [[[1, 2, 3]]]
    assert got.signal("/body/b/translation", "m").y.tolist() == [[4, 5, 6]]


def in_frame(stamp: Any) -> dict[str, Any]:
    return {"timestamp": stamp, "frame_id": "lab", "point": {"x": 1, "y": 2, "z": 3}}


@pytest.mark.parametrize(
    ("text", "fraction"),
    [("2023-11-14T22:13:20Z", 0), ("2023-11-14T22:13:20.5Z", 500_000_000),
     ("2023-11-14T22:13:20.000000007Z", 7)],
)  # fmt: skip
def test_a_time_may_be_text(tmp_path: Path, text: str, fraction: int) -> None:
    path = plain(tmp_path / "x.mcap", in_frame(text), "foxglove.Point3InFrame")
    assert read_all(path, {}).t0_ns == 1_700_000_000 * 10**9 + fraction


@pytest.mark.parametrize("stamp", ["yesterday", 5])
def test_what_is_no_time_is_called_so(tmp_path: Path, stamp: Any) -> None:
    path = plain(tmp_path / "x.mcap", in_frame(stamp), "foxglove.Point3InFrame")
    with pytest.raises(RecordingError, match="is not a time"):
        read_all(path, {})


def test_a_number_that_is_named_comes_in_si(tmp_path: Path) -> None:
    path = plain(tmp_path / "x.mcap", {"load": 1.5, "way": 2.5, "cell": {"mV": 3}})
    got = read_all(path, {"/x.load": "kN", "/x.way": "mm", "/x.cell.mV": "mV"})
    assert got.signal("/x.load", "N").y.tolist() == [[1500]]
    assert got.signal("/x.way", "m").y.tolist() == [[0.0025]]
    assert got.signal("/x.cell.mV", "mV").y.tolist() == [[3]]


@pytest.mark.parametrize(
    ("field", "why"),
    [("pos", r"'/x.pos' holds fields; name one: /x.pos.x, /x.pos.y"),
     ("name", r"'/x.name' is 'cell', not numbers")],
)  # fmt: skip
def test_a_field_that_is_no_number_says_what_it_is(tmp_path: Path, field: str, why: str) -> None:
    path = plain(tmp_path / "x.mcap", {"pos": {"x": 1, "y": 2}, "name": "cell"})
    with pytest.raises(RecordingError, match=why):
        read_all(path, {f"/x.{field}": "m"})


def poses(path: Path, *messages: dict[str, Any]) -> Path:
    """foxglove.PoseInFrame as JSON, a second apart from 2023 on; fields in place of the usual."""
    usual = {"timestamp": {"sec": 0, "nsec": 0}, "frame_id": "lab", "x": 1.0, "w": 1.0}
    with path.open("wb") as stream:
        writer = TheirWriter(stream)
        writer.start()  # type: ignore[no-untyped-call]
        number = writer.register_schema("foxglove.PoseInFrame", "jsonschema", b"{}")
        channel = writer.register_channel("/x", "json", number)
        for i, message in enumerate(messages):
            m = usual | message
            place = {"x": m.pop("x"), "y": 0, "z": 0}
            turn = {"x": 0, "y": 0, "z": 0, "w": m.pop("w")}
            m["pose"] = {"position": place, "orientation": turn}
            at = (1_700_000_000 + i) * 10**9
            writer.add_message(channel, at, json.dumps(m).encode(), at)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.parametrize("lost", [{"w": 0}, {"x": float("nan")}, {"w": float("nan")}])
def test_a_pose_that_was_lost_is_left_out_and_told(tmp_path: Path, lost: dict[str, Any]) -> None:
    got = read_all(poses(tmp_path / "x.mcap", {}, lost, {}), {})
    for part in ("rotation", "translation"):
        assert got.signals[f"/x/{part}"].t.tolist() == [0, 2]
        told = got.metadata["provenance"][f"/x/{part}"]
        assert told.startswith("1 samples without numbers left out")
    with pytest.raises(RecordingError, match="numbers that are not finite"):
        read_all(poses(tmp_path / "y.mcap", lost), {})


def test_stamps_that_were_never_set_are_no_times(tmp_path: Path) -> None:
    """All messages stood at one instant in 1970."""
    at = {"timestamp": {"sec": 1_700_000_009, "nsec": 0}}
    got = read_all(poses(tmp_path / "x.mcap", {}, {}), {})
    assert got.t0_ns == 1_700_000_000 * 10**9
    assert got.signal("/x/translation", "m").t.tolist() == [0, 1]
    assert (
        got.metadata["provenance"]["/x/translation"]
        == "2 stamps of 0: replaced by the publish time"
    )
    some = read_all(poses(tmp_path / "y.mcap", {}, at), {}).signal("/x/translation", "m")
    assert some.t.tolist() == [0, 9]


def test_a_clock_that_begins_at_0_is_one(tmp_path: Path) -> None:
    got = read_all(poses(tmp_path / "x.mcap", {}, {"timestamp": {"sec": 2, "nsec": 0}}), {})
    assert got.t0_ns == 0
    assert got.signal("/x/translation", "m").t.tolist() == [0, 2]
