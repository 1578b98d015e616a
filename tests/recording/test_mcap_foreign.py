"""Messages of ROS 2 and Foxglove, written by libraries of others, as streams."""

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import foxglove
import foxglove.messages as fox
import numpy as np
import pytest
from foxglove.channels import (
    CompressedImageChannel,
    FrameTransformsChannel,
    PointCloudChannel,
    PoseInFrameChannel,
    PosesInFrameChannel,
    RawImageChannel,
)
from mcap.writer import Writer as TheirWriter
from mcap_ros2.writer import Writer as RosWriter
from PIL import Image

from validate.errors import RecordingError, UsageError
from validate.recording.mcap import third_party_channels
from validate.recording.mcap.decoders import messages_in
from validate.recording.mcap.read import read_all
from validate.recording.preflight import Inspection

ROS2 = Path("mcap/ros2")
HEADER = "std_msgs/Header header\n"
STAMPED = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
VECTOR = "\n" + "=" * 80 + "\nMSG: geometry_msgs/{}\nfloat64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = "\n" + "=" * 80 + "\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\n"
QUATERNION += "float64 z\nfloat64 w\n"
POSE = "\n" + "=" * 80 + "\nMSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n"
POSES = POSE + VECTOR.format("Point") + QUATERNION
WRENCH = "\n" + "=" * 80 + "\nMSG: geometry_msgs/Wrench\nVector3 force\nVector3 torque\n"
IMAGE = (
    "uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data"
)
TURN = {"x": 0.0, "y": 0.0, "z": np.sqrt(0.5), "w": np.sqrt(0.5)}


def header(i: int, frame: str = "lab") -> dict[str, Any]:
    return {"stamp": {"sec": 100, "nanosec": 10_000_000 * i}, "frame_id": frame}


def ros(path: Path, kind: str, definition: str, messages: list[dict[str, Any]]) -> Path:
    """As the writer of the ROS 2 support of MCAP's makers writes them."""
    with path.open("wb") as stream:
        writer = RosWriter(stream)
        schema = writer.register_msgdef(kind, definition + STAMPED)
        for i, message in enumerate(messages):
            writer.write_message("/x", schema, message, 10**9 * (200 + i), 10**9 * (200 + i))
        writer.finish()
    return path


def test_a_wrench_is_a_force_and_a_torque(tmp_path: Path) -> None:
    messages = [
        {
            "header": header(i),
            "wrench": {
                "force": {"x": 1.0 + i, "y": 2.0, "z": 3.0},
                "torque": {"x": 0.1, "y": 0.2, "z": 0.3},
            },
        }
        for i in (1, 0)
    ]
    definition = HEADER + "Wrench wrench" + WRENCH + VECTOR.format("Vector3")
    got = read_all(ros(tmp_path / "x.mcap", "geometry_msgs/msg/WrenchStamped", definition,
                       messages), {})  # fmt: skip
    force = got.signal("/x/force", "N")
    assert force.y.tolist() == [[1, 2, 3], [2, 2, 3]]  # in the order of the stamps
    assert force.t.tolist() == [0, 0.01]
    assert force.frame == "lab"
    assert got.signal("/x/torque", "N m").y[0].tolist() == [0.1, 0.2, 0.3]
    assert got.t0_ns == 100 * 10**9
    assert "2 of 2 samples were not in the order" in got.metadata["provenance"]["/x/force"]


def test_a_pose_is_a_rotation_and_a_translation(tmp_path: Path) -> None:
    pose = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": TURN}
    path = ros(tmp_path / "x.mcap", "geometry_msgs/msg/PoseStamped", HEADER + "Pose pose" + POSES,
               [{"header": header(0), "pose": pose}])  # fmt: skip
    got = read_all(path, {})
    assert got.signal("/x/translation", "m").y.tolist() == [[1, 2, 3]]
    R = got.signal("/x/rotation", "1").y.reshape(3, 3)
    assert pytest.approx([0, 1, 0]) == R @ [1, 0, 0]


def test_poses_of_a_constant_number_are_markers_and_of_another_are_told(tmp_path: Path) -> None:
    def poses(count: int) -> list[dict[str, Any]]:
        return [
            {"position": {"x": float(k), "y": 0.0, "z": 0.0}, "orientation": TURN}
            for k in range(count)
        ]

    definition = HEADER + "Pose[] poses" + POSES
    kind = "geometry_msgs/msg/PoseArray"
    same = [{"header": header(i), "poses": poses(3)} for i in range(2)]
    got = read_all(ros(tmp_path / "a.mcap", kind, definition, same), {}).marker("/x")
    assert got.names == ("1", "2", "3")
    assert got.x[1, 2].tolist() == [2, 0, 0]
    other = [*same, {"header": header(2), "poses": poses(2)}]
    with pytest.raises(RecordingError, match=r"/x: its number of values changes"):
        read_all(ros(tmp_path / "b.mcap", kind, definition, other), {})


def cloud(points: np.ndarray, order: str) -> dict[str, Any]:
    rows = b"".join(struct.pack(f"{order}ffff", *p, 7.0) for p in points)
    fields = [{"name": n, "offset": 4 * k, "datatype": 7, "count": 1} for k, n in enumerate("xyzi")]
    return {
        "header": header(0), "height": 1, "width": len(points), "fields": fields,
        "is_bigendian": order == ">", "point_step": 16, "row_step": len(rows), "data": rows,
        "is_dense": True,
    }  # fmt: skip


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_cloud_is_read_in_its_own_byte_order(order: str, tmp_path: Path) -> None:
    points = np.array([[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]])
    field = "\n" + "=" * 80 + "\nMSG: sensor_msgs/PointField\nstring name\nuint32 offset\n"
    field += "uint8 datatype\nuint32 count\n"
    definition = HEADER + "uint32 height\nuint32 width\nPointField[] fields\nbool is_bigendian\n"
    definition += "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense" + field
    path = ros(
        tmp_path / "x.mcap", "sensor_msgs/msg/PointCloud2", definition, [cloud(points, order)]
    )
    assert read_all(path, {}).marker("/x").x[0].tolist() == points.tolist()


def raw(encoding: str, pixels: np.ndarray) -> dict[str, Any]:
    height, width = pixels.shape[:2]
    return {
        "header": header(0), "height": height, "width": width, "encoding": encoding,
        "is_bigendian": 0, "step": pixels[0].size, "data": pixels.tobytes(),
    }  # fmt: skip


@pytest.mark.parametrize("encoding", ["mono8", "rgb8", "bgr8", "bgra8"])
def test_an_image_is_its_luma_and_needs_a_scale(encoding: str, tmp_path: Path) -> None:
    colour = np.random.default_rng(0).integers(0, 255, (4, 6, 3)).astype(np.uint8)
    grey = np.rint(colour @ [0.299, 0.587, 0.114]).astype(np.uint8)
    alpha = np.full((4, 6, 1), 255, np.uint8)
    stored = {"mono8": grey, "rgb8": colour, "bgr8": colour[..., ::-1].copy(),
              "bgra8": np.concatenate([colour[..., ::-1], alpha], axis=2)}[encoding]  # fmt: skip
    path = ros(
        tmp_path / "x.mcap", "sensor_msgs/msg/Image", HEADER + IMAGE, [raw(encoding, stored)]
    )
    with pytest.raises(RecordingError, match=r"--map m_per_px=0.1mm"):
        read_all(path, {})
    frames = read_all(path, {"m_per_px": "0.2mm"}).frame("/x")
    assert (frames.images[0] == grey).all()
    assert frames.m_per_px == pytest.approx((2e-4, 2e-4))


@pytest.mark.parametrize(("encoding", "big"), [("mono16", 0), ("16UC1", 1)])
def test_16_bits_become_8_by_a_level_that_is_told(encoding: str, big: int, tmp_path: Path) -> None:
    deep = np.random.default_rng(0).integers(0, 4001, (4, 6)).astype(np.uint16)
    deep[0, 0] = 4000
    stored = deep.astype(">u2" if big else "<u2").view(np.uint8)
    message = {**raw(encoding, stored), "width": 6, "is_bigendian": big}
    path = ros(tmp_path / "x.mcap", "sensor_msgs/msg/Image", HEADER + IMAGE, [message])
    for options, white, said in (({}, 4000, "the largest"), ({"white": "4095"}, 4095, "entered")):
        got = read_all(path, {"m_per_px": "1mm", **options})
        assert (got.frame("/x").images[0] == np.rint(deep * (255 / white))).all()
        told = got.metadata["provenance"]["/x"]
        assert told == f"16 bits converted to 8: 0 to {white} ({said}) became 0 to 255"


def test_a_mosaic_is_its_luma_and_pairs_are_their_brightness(tmp_path: Path) -> None:
    """Of one colour: red .299, green .587, blue .114 of it in every pixel."""
    colour = np.array([200, 100, 40])
    at = {"rggb": (0, 1, 1, 2), "bggr": (2, 1, 1, 0), "gbrg": (1, 2, 0, 1), "grbg": (1, 0, 2, 1)}
    stored = {f"bayer_{name}8": np.tile(colour[list(order)].reshape(2, 2), (4, 4)).astype(np.uint8)
              for name, order in at.items()}  # fmt: skip
    for i, (name, pixels) in enumerate(stored.items()):
        path = ros(tmp_path / f"{i}.mcap", "sensor_msgs/msg/Image", HEADER + IMAGE,
                   [raw(name, pixels)])  # fmt: skip
        got = read_all(path, {"m_per_px": "1mm"}).frame("/x").images[0].astype(int)
        assert np.abs(got - 123).max() <= 1
    grey = np.random.default_rng(0).integers(0, 255, (4, 6)).astype(np.uint8)
    for first, name in enumerate(("yuv422_yuy2", "yuv422")):
        pairs = np.full((4, 6, 2), 128, np.uint8)
        pairs[..., first] = grey
        path = ros(tmp_path / f"{name}.mcap", "sensor_msgs/msg/Image", HEADER + IMAGE,
                   [raw(name, pairs.reshape(4, 12)) | {"width": 6}])  # fmt: skip
        assert (read_all(path, {"m_per_px": "1mm"}).frame("/x").images[0] == grey).all()


def test_distances_are_no_image(tmp_path: Path) -> None:
    path = ros(tmp_path / "x.mcap", "sensor_msgs/msg/Image", HEADER + IMAGE,
               [raw("32FC1", np.zeros((4, 24), np.uint8)) | {"width": 6}])  # fmt: skip
    with pytest.raises(RecordingError, match="encoding '32FC1'; expected"):
        read_all(path, {"m_per_px": "1mm"})


def jpeg(image: np.ndarray) -> bytes:
    packed = io.BytesIO()
    Image.fromarray(image).save(packed, "JPEG", quality=95)
    return packed.getvalue()


def test_a_packed_image_is_what_another_library_unpacks(tmp_path: Path) -> None:
    image = (np.add.outer(np.arange(16), np.arange(24)) * 6).astype(np.uint8)
    message = {"header": header(0), "format": "jpeg", "data": jpeg(image)}
    path = ros(tmp_path / "x.mcap", "sensor_msgs/msg/CompressedImage",
               HEADER + "string format\nuint8[] data", [message])  # fmt: skip
    got = read_all(path, {"m_per_px": "1mm"}).frame("/x").images[0]
    theirs = cv2.imdecode(np.frombuffer(message["data"], np.uint8), cv2.IMREAD_GRAYSCALE)
    assert np.abs(got.astype(int) - theirs).max() <= 1
    deep = (image.astype(np.uint16) * 100)[..., None]
    packed = cv2.imencode(".png", deep)[1].tobytes()
    path = ros(tmp_path / "z.mcap", "sensor_msgs/msg/CompressedImage",
               HEADER + "string format\nuint8[] data", [message | {"data": packed}])  # fmt: skip
    got = read_all(path, {"m_per_px": "1mm", "white": "25500"}).frame("/x").images[0]
    assert (got == image).all()
    cut = {**message, "data": message["data"][:-40]}
    path = ros(tmp_path / "y.mcap", "sensor_msgs/msg/CompressedImage",
               HEADER + "string format\nuint8[] data", [cut])  # fmt: skip
    with pytest.raises(RecordingError, match="damaged image"):
        read_all(path, {"m_per_px": "1mm"})


def foxglove_file(path: Path, log: Callable[[], None]) -> Path:
    writer = foxglove.open_mcap(str(path))
    log()
    writer.close()
    return path


def test_what_foxglove_wrote_is_read(tmp_path: Path) -> None:
    at = fox.Timestamp(50, 250_000_000)
    turn = fox.Quaternion(x=0, y=0, z=np.sqrt(0.5), w=np.sqrt(0.5))
    pose = fox.Pose(position=fox.Vector3(x=1, y=2, z=3), orientation=turn)
    grey = np.arange(12, dtype=np.uint8).reshape(3, 4)
    number = fox.PackedElementFieldNumericType.Float32
    fields = [
        fox.PackedElementField(name=n, offset=4 * k, type=number) for k, n in enumerate("xyz")
    ]

    def log() -> None:
        PoseInFrameChannel("/tool").log(fox.PoseInFrame(timestamp=at, frame_id="lab", pose=pose))
        PosesInFrameChannel("/all").log(
            fox.PosesInFrame(timestamp=at, frame_id="lab", poses=[pose, pose])
        )
        RawImageChannel("/raw").log(
            fox.RawImage(timestamp=at, frame_id="probe", width=4, height=3, encoding="mono8",
                         step=4, data=grey.tobytes())
        )  # fmt: skip
        CompressedImageChannel("/jpg").log(
            fox.CompressedImage(timestamp=at, frame_id="probe", data=jpeg(grey), format="jpeg")
        )
        PointCloudChannel("/cloud").log(
            fox.PointCloud(timestamp=at, frame_id="lab", pose=pose, point_stride=12, fields=fields,
                           data=struct.pack("<6f", *range(6)))
        )  # fmt: skip
        moved = fox.FrameTransform(
            timestamp=at, parent_frame_id="world", child_frame_id="probe",
            translation=fox.Vector3(x=4, y=5, z=6), rotation=turn,
        )  # fmt: skip
        FrameTransformsChannel("/tf").log(fox.FrameTransforms(transforms=[moved]))

    got = read_all(foxglove_file(tmp_path / "x.mcap", log), {"m_per_px": "0.1mm"})
    assert got.t0_ns == 50_250_000_000
    assert got.signal("/tool/translation", "m").y.tolist() == [[1, 2, 3]]
    assert got.marker("/all").x.shape == (1, 2, 3)
    assert (got.frame("/raw").images[0] == grey).all()
    assert got.frame("/jpg").images[0].shape == (3, 4)
    assert got.marker("/cloud").x[0] == pytest.approx(np.array([[0, 2, 5], [-3, 5, 8]]))
    assert got.signal("/tf/probe/translation", "m").y.tolist() == [[4, 5, 6]]
    assert got.signal("/tf/probe/translation", "m").frame == "world"
    assert not got.unread


@pytest.mark.parametrize("encoding", ["json", "cbor"])
def test_a_number_of_any_message_comes_in_by_its_path(encoding: str, tmp_path: Path) -> None:
    import cbor2

    pack = {"json": lambda m: json.dumps(m).encode(), "cbor": cbor2.dumps}[encoding]
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        writer = TheirWriter(stream)
        writer.start()  # type: ignore[no-untyped-call]
        channel = writer.register_channel("/cell", encoding, 0)
        for i in range(3):
            data = pack({"cell": {"load": [0.5 * i, 9.0]}})
            writer.add_message(channel, log_time=10**9 * i, publish_time=10**9 * i, data=data)
        writer.finish()  # type: ignore[no-untyped-call]
    got = read_all(path, {"/cell.cell.load.0": "N"}).signal("/cell.cell.load.0", "N")
    assert got.y.ravel().tolist() == [0, 0.5, 1]
    assert got.t.tolist() == [0, 1, 2]
    with pytest.raises(RecordingError, match=r"--map /cell.FIELD=UNIT"):
        read_all(path, {})
    with pytest.raises(RecordingError, match=r"no field 'nothing' of 'cell.nothing'"):
        read_all(path, {"/cell.cell.nothing": "N"})
    with pytest.raises(UsageError, match=r"--map /other.x=....*topics /cell"):
        read_all(path, {"/other.x": "N"})


@pytest.mark.parametrize(
    ("name", "topics"),
    [
        ("talker", {"/rosout": 10, "/topic": 10, "/parameter_events": 0}),
        ("cdr_test_0", {"/test_topic": 3, "/array_topic": 4}),
        ("multiple_files_0", {"/chatter": 1324}),
        ("wrong_rmw_test_0", {"/test_topic": 3, "/array_topic": 4}),
    ],
)
def test_counts_of_recordings_by_rosbag2_and_no_defect_in_its_habits(
    name: str, topics: dict[str, int], shared_data: Path
) -> None:
    got = Inspection.of(shared_data / ROS2 / f"{name}.mcap")
    assert {t.name: t.count for t in got.topics} == topics
    assert not [d for d in got.defects if "no messages" in d or "rosbag2" in d]


def test_contents_of_recordings_by_rosbag2(shared_data: Path) -> None:
    said = list(messages_in(shared_data / ROS2 / "talker.mcap", "/topic", 10))
    assert [m["message"]["data"] for m in said] == [f"Hello, world! {i}" for i in range(10)]
    (first, *_) = messages_in(shared_data / ROS2 / "cdr_test_0.mcap", "/test_topic", 1)
    assert first["message"]["int32_value"] == 123
    arrays = list(messages_in(shared_data / ROS2 / "cdr_test_0.mcap", "/array_topic", 4))
    assert len(arrays) == 4
    with pytest.raises(RecordingError, match=r"/test_topic.*'ros2msg/wrong_format'"):
        list(messages_in(shared_data / ROS2 / "wrong_rmw_test_0.mcap", "/test_topic", 1))


def test_unknown_schemas_are_listed_with_why(shared_data: Path, capfd: Any) -> None:
    with pytest.raises(RecordingError, match=r"configuration_topic.*'omgidl/cdr'"):
        read_all(shared_data / "mcap/dds/configuration_type.mcap", {})
    with pytest.raises(RecordingError, match="_service_event"):
        read_all(shared_data / ROS2 / "topics_and_services.mcap", {})
    assert capfd.readouterr().out == ""  # its library prints


def test_a_topic_that_is_not_there_is_reported_with_the_others(tmp_path: Path) -> None:
    path = ros(tmp_path / "x.mcap", "x/X", "float64 a", [{"a": 1.0}])
    with pytest.raises(UsageError, match=r"x.mcap: no topic '/y'; topics: /x"):
        list(messages_in(path, "/y", 1))


def test_errors_of_a_file_name_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = ros(tmp_path / "x.mcap", "x/X", "float64 a", [{"a": 1.0}, {"a": 2.0}])
    monkeypatch.setattr(third_party_channels, "MAX_NUMBERS", 1)
    with pytest.raises(RecordingError, match=r"x.mcap.*than 1 numbers"):
        read_all(path, {"/x.a": "N"})
