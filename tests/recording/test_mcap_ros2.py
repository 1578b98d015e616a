"""Messages of ROS 2 that rosbags wrote, in both byte orders of CDR, and Foxglove's in JSON: read
bit for bit, and what is unknown beside them listed."""

import base64
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as TheirWriter
from PIL import Image
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from validate.commands.main import main
from validate.recording.mcap.read import read_all, read_recording
from validate.recording.types import Frames, Markers, Recording

STORE = get_typestore(Stores.ROS2_HUMBLE)
RNG = np.random.default_rng(8)
X = RNG.normal(size=(3, 4, 3))  # messages, points, coordinates
PIXELS = RNG.integers(0, 256, (3, 4, 6)).astype(np.uint8)
SHIFT = np.array([1.0, 2.0, 3.0])
Q = RNG.normal(size=(3, 4))
Q /= np.linalg.norm(Q, axis=1)[:, None]


def message(kind: str, *fields: Any) -> Any:
    return STORE.types[kind.replace("/", "/msg/")](*fields)


def header(i: int) -> Any:
    stamp = message("builtin_interfaces/Time", 100 + i, 7 + i)
    return message("std_msgs/Header", stamp, "Büro")


def geometry(kind: str, *fields: Any) -> Any:
    return message(f"geometry_msgs/{kind}", *fields)


def pose(i: int, k: int) -> Any:
    return geometry("Pose", geometry("Point", *X[i, k]), geometry("Quaternion", *Q[i]))


def transform(i: int) -> Any:
    inner = geometry("Transform", geometry("Vector3", *X[i, 0]), geometry("Quaternion", *Q[i]))
    return geometry("TransformStamped", header(i), "tool", inner)


def cloud(i: int, order: str) -> Any:
    """float32 and float64 beside each other, with a gap, rows of two points."""
    packed = np.zeros(
        4, [("a", "u1"), ("x", f"{order}f8"), ("y", f"{order}f4"), ("z", f"{order}f8")]
    )
    for k, axis in enumerate("xyz"):
        packed[axis] = X[i, :, k]
    offsets = [packed.dtype.fields[n][1] for n in "xyz"]  # type: ignore[index]
    fields = [message("sensor_msgs/PointField", n, o, d, 1)
              for n, o, d in zip("xyz", offsets, (8, 7, 8), strict=True)]  # fmt: skip
    size = packed.dtype.itemsize
    data = np.frombuffer(packed.tobytes(), np.uint8)
    return message("sensor_msgs/PointCloud2", header(i), 2, 2, fields, order == ">", size,
                   2 * size, data, True)  # fmt: skip


def png(pixels: np.ndarray) -> bytes:
    packed = io.BytesIO()
    Image.fromarray(pixels).save(packed, "PNG")
    return packed.getvalue()


def image(i: int) -> Any:
    """Rows with two bytes behind them that are no pixels."""
    rows = np.pad(PIXELS[i], ((0, 0), (0, 2))).ravel()
    return message("sensor_msgs/Image", header(i), 4, 6, "mono8", 0, 8, rows)


def picture(i: int) -> Any:
    data = np.frombuffer(png(PIXELS[i]), np.uint8)
    return message("sensor_msgs/CompressedImage", header(i), "png", data)


def joints(i: int) -> Any:
    return message("sensor_msgs/JointState", header(i), ["hip", "knee"], X[i, 0, :2].copy(),
                   np.array([]), X[i, 1, :2].copy())  # fmt: skip


def wrench(i: int) -> Any:
    inner = geometry("Wrench", geometry("Vector3", *X[i, 0]), geometry("Vector3", *X[i, 1]))
    return geometry("WrenchStamped", header(i), inner)


def turned(q: np.ndarray) -> np.ndarray:
    """The matrix of a unit quaternion x y z w by its action on the axes: q v q*."""
    v, w = q[:3], q[3]
    return np.array(
        [e + 2 * w * np.cross(v, e) + 2 * np.cross(v, np.cross(v, e)) for e in np.eye(3)]
    ).T


Wanted = dict[str, Any]
MADE: dict[str, tuple[Callable[[int], Any], Wanted]] = {
    "sensor_msgs/Image": (image, {"/x": PIXELS}),
    "sensor_msgs/CompressedImage": (picture, {"/x": PIXELS}),
    "sensor_msgs/JointState": (
        joints,
        {f"/x/{name}.{what}": X[:, [k], j : j + 1].reshape(3, 1)
         for k, what in enumerate(("position", "effort"))
         for j, name in enumerate(("hip", "knee"))},
    ),
    "geometry_msgs/PoseArray": (
        lambda i: geometry("PoseArray", header(i), [pose(i, k) for k in range(4)]), {"/x": X}
    ),
    "geometry_msgs/PoseStamped": (
        lambda i: geometry("PoseStamped", header(i), pose(i, 0)),
        {"/x/translation": X[:, 0], "/x/rotation": Q},
    ),
    "geometry_msgs/PointStamped": (
        lambda i: geometry("PointStamped", header(i), geometry("Point", *X[i, 0])), {"/x": X[:, :1]}
    ),
    "geometry_msgs/TransformStamped": (
        transform, {"/x/tool/translation": X[:, 0], "/x/tool/rotation": Q}
    ),
    "tf2_msgs/TFMessage": (
        lambda i: message("tf2_msgs/TFMessage", [transform(i)]),
        {"/x/tool/translation": X[:, 0], "/x/tool/rotation": Q},
    ),
    "geometry_msgs/WrenchStamped": (wrench, {"/x/force": X[:, 0], "/x/torque": X[:, 1]}),
}  # fmt: skip


def bag(folder: Path, kind: str, make: Callable[[int], Any], little: bool = True) -> Path:
    """One topic by rosbags' own writer, and one that nothing here understands beside it."""
    name, unknown = kind.replace("/", "/msg/"), "diagnostic_msgs/msg/KeyValue"
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        to = writer.add_connection("/x", name, typestore=STORE)
        beside = writer.add_connection("/unknown", unknown, typestore=STORE)
        for i in range(3):
            data = STORE.serialize_cdr(make(i), name, little_endian=little)
            writer.write(to, 200 * 10**9 + i, bytes(data))
        other = message("diagnostic_msgs/KeyValue", "a", "b")
        writer.write(beside, 201 * 10**9, bytes(STORE.serialize_cdr(other, unknown)))
    return next((folder / "bag").glob("*.mcap"))


def same(got: Recording, wanted: Wanted) -> None:
    assert set(got.streams) == set(wanted)
    for topic, values in wanted.items():
        stream = got.streams[topic]
        assert (stream.t == np.array([0, 1.000000001, 2.000000002])).all()
        assert stream.frame == "Büro"
        if isinstance(stream, Frames):
            assert [i.tolist() for i in stream.images] == values.tolist()
        elif isinstance(stream, Markers):
            assert stream.x.tolist() == values.tolist()
        elif topic.endswith("rotation"):
            R = stream.y.reshape(-1, 3, 3)
            assert pytest.approx(np.array([turned(q) for q in values]), abs=1e-15) == R
        else:
            assert stream.y.tolist() == values.tolist()


@pytest.mark.parametrize("little", [True, False])
@pytest.mark.parametrize("kind", MADE)
def test_what_rosbags_wrote_is_read_bit_for_bit(kind: str, little: bool, tmp_path: Path) -> None:
    make, wanted = MADE[kind]
    got = read_all(bag(tmp_path, kind, make, little), {"m_per_px": "0.1mm"})
    same(got, wanted)
    assert got.t0_ns == 100 * 10**9 + 7
    assert "unknown meaning (diagnostic_msgs/msg/KeyValue)" in got.unread["/unknown"]


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_cloud_of_mixed_floats_is_read_in_its_byte_order(order: str, tmp_path: Path) -> None:
    path = bag(tmp_path, "sensor_msgs/PointCloud2", lambda i: cloud(i, order), order == "<")
    wanted = X.copy()
    wanted[..., 1] = X[..., 1].astype(np.float32)
    same(read_all(path, {}), {"/x": wanted})


def test_import_of_a_bag_by_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make, wanted = MADE["geometry_msgs/WrenchStamped"]
    path, out = bag(tmp_path, "geometry_msgs/WrenchStamped", make), tmp_path / "y.mcap"
    for argv in (["inspect", "-v", str(path)], ["import", str(path), "-o", str(out)]):
        with pytest.raises(SystemExit, match="0"):
            main(argv)
    said = capsys.readouterr()
    assert "WrenchStamped" in said.out
    assert "not read: /unknown" in said.err
    same(read_recording(out), wanted)


def foxglove_json() -> dict[str, Callable[[int], dict[str, Any]]]:
    """As Foxglove's JSON schemas lay them out; bytes are base64."""

    def at(i: int) -> dict[str, Any]:
        return {"timestamp": {"sec": 100 + i, "nsec": 7 + i}, "frame_id": "Büro"}

    def xyz(v: np.ndarray) -> dict[str, float]:
        return dict(zip("xyzw", map(float, v), strict=False))

    def b64(data: bytes) -> str:
        return base64.b64encode(data).decode()

    def a_pose(i: int, k: int) -> dict[str, Any]:
        return {"position": xyz(X[i, k]), "orientation": xyz(Q[i])}

    fields = [{"name": n, "offset": 8 * k, "type": 8} for k, n in enumerate("xyz")]
    return {
        "PosesInFrame": lambda i: {**at(i), "poses": [a_pose(i, k) for k in range(4)]},
        "PoseInFrame": lambda i: {**at(i), "pose": a_pose(i, 0)},
        "FrameTransforms": lambda i: {"transforms": [{
            "timestamp": at(i)["timestamp"], "parent_frame_id": "Büro", "child_frame_id": "tool",
            "translation": xyz(X[i, 0]), "rotation": xyz(Q[i])}]},
        "CompressedImage": lambda i: {**at(i), "format": "png", "data": b64(png(PIXELS[i]))},
        "RawImage": lambda i: {**at(i), "width": 6, "height": 4, "encoding": "mono8", "step": 6,
                               "data": b64(PIXELS[i].tobytes())},
        "PointCloud": lambda i: {**at(i), "point_stride": 24, "fields": fields,
                                 "pose": {"position": xyz(SHIFT),
                                          "orientation": xyz(np.array([0, 0, 0, 1]))},
                                 "data": b64(X[i].astype("<f8").tobytes())},
    }  # fmt: skip


WANTED_JSON: dict[str, Wanted] = {
    "PosesInFrame": {"/x": X},
    "PoseInFrame": {"/x/translation": X[:, 0], "/x/rotation": Q},
    "FrameTransforms": {"/x/tool/translation": X[:, 0], "/x/tool/rotation": Q},
    "CompressedImage": {"/x": PIXELS},
    "RawImage": {"/x": PIXELS},
    "PointCloud": {"/x": X + SHIFT},  # its origin is a place in its frame
}


@pytest.mark.parametrize("encoding", ["json", "cbor"])
@pytest.mark.parametrize("kind", WANTED_JSON)
def test_what_foxglove_means_in_json_and_cbor_is_read(
    kind: str, encoding: str, tmp_path: Path
) -> None:
    import cbor2

    path = tmp_path / "x.mcap"
    pack = {"json": lambda m: json.dumps(m).encode(), "cbor": cbor2.dumps}[encoding]
    with path.open("wb") as stream:
        writer = TheirWriter(stream)
        writer.start()  # type: ignore[no-untyped-call]
        schema = writer.register_schema(f"foxglove.{kind}", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/x", encoding, schema)
        odd = writer.register_channel("/odd", "xml", 0)
        for i in range(3):
            data = pack(foxglove_json()[kind](i))
            writer.add_message(channel, log_time=i, publish_time=i, data=data)
        writer.add_message(odd, log_time=3, publish_time=3, data=b"<a/>")
        writer.finish()  # type: ignore[no-untyped-call]
    got = read_all(path, {"m_per_px": "0.1mm"})
    same(got, WANTED_JSON[kind])
    assert got.unread == {"/odd": "no decoder for '/xml'"}
