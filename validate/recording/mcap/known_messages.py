"""Known messages of ROS 2 and Foxglove: points, poses, numbers with units, images.

Each known type is one function from its plain fields to parts; a part is a sample of the stream
`<topic><part>`. Coordinates of both are metres, forces newtons, angles radians.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.images.packed import RawImage, decode_picture, grey
from validate.recording.mcap.decoders import Plain, binary
from validate.recording.motion_capture.poses import ROTATION, TRANSLATION, rotations

NOT_STATED = "not stated"
MAX_POINTS = 100_000  # of one cloud
_FLOATS = {7: "f4", 8: "f8"}  # sensor_msgs/PointField, foxglove.PackedElementField alike


@dataclass(frozen=True)
class MessagePart:
    """A sample of the stream `<topic><name>`, measured at `ns` (none: when it was published).

    Points (k, 3) m of `names`, or numbers (c,) in `unit`, or a grey `image` (h, w) of any depth.
    """

    name: str
    ns: int | None
    frame: str
    values: Floats = field(default_factory=lambda: np.empty(0))
    names: tuple[str, ...] = ()
    unit: str = ""
    image: NDArray[Any] | None = None


Parts = Callable[[Plain], Sequence[MessagePart]]


def parts_of(schema: str) -> Parts | None:
    """What reads messages of a type; none for one that means nothing here."""
    return _KNOWN.get(schema)


def stamp_ns(stamp: Any) -> int:
    """Of {sec, nsec} or {sec, nanosec}, or of text as JSON of Protobuf has it (UTC)."""
    if isinstance(stamp, str):
        return _moment_ns(stamp)
    if not isinstance(stamp, Mapping):
        raise RecordingError(f"{type(stamp).__name__} is not a time")
    sec, nsec = stamp["sec"], stamp.get("nanosec", stamp.get("nsec"))
    try:
        return int(sec) * 10**9 + int(nsec)
    except OverflowError:
        raise RecordingError(f"{sec} s is not a time") from None


def _moment_ns(text: str) -> int:
    """Of 2023-11-14T22:13:20.5Z; raises `RecordingError` for other text."""
    whole, _, fraction = text.removesuffix("Z").partition(".")
    try:
        at = datetime.fromisoformat(whole).replace(tzinfo=UTC)
        return int(at.timestamp()) * 10**9 + int(fraction.ljust(9, "0")[:9])
    except ValueError:
        raise RecordingError(f"'{text[:40]}' is not a time, as 2023-11-14T22:13:20.5Z") from None


def _header(message: Plain) -> tuple[int, str]:
    return stamp_ns(message["header"]["stamp"]), str(message["header"]["frame_id"])


def _own(message: Plain) -> tuple[int, str]:
    """Stamp and frame of Foxglove's messages."""
    return stamp_ns(message["timestamp"]), str(message["frame_id"])


def _xyz(value: Mapping[str, Any]) -> list[float]:
    return [float(value[axis]) for axis in "xyz"]


def _pose(name: str, ns: int, frame: str, place: Any, turn: Any) -> list[MessagePart]:
    """Both parts; NaN where the tool was lost: a number that is none, or four zeros."""
    q = np.array([[*_xyz(turn), float(turn["w"])]])
    x = np.array(_xyz(place))
    lost = np.isnan(q).any() or np.isnan(x).any() or not q.any()
    R = np.full(9, np.nan) if lost else rotations(q, name or "pose").reshape(9)
    x = np.full(3, np.nan) if lost else x
    return [
        MessagePart(f"{name}/{ROTATION}", ns, frame, R, unit="1"),
        MessagePart(f"{name}/{TRANSLATION}", ns, frame, x, unit="m"),
    ]


def _points(ns: int, frame: str, x: Floats) -> list[MessagePart]:
    if len(x) > MAX_POINTS:
        raise RecordingError(f"{len(x)} points, the limit is {MAX_POINTS}")
    return [MessagePart("", ns, frame, x, tuple(str(i + 1) for i in range(len(x))))]


def _pose_stamped(m: Plain) -> Sequence[MessagePart]:
    return _pose("", *_header(m), m["pose"]["position"], m["pose"]["orientation"])


def _pose_with_covariance(m: Plain) -> Sequence[MessagePart]:
    inner = m["pose"]["pose"]
    return _pose("", *_header(m), inner["position"], inner["orientation"])


def _odometry(m: Plain) -> Sequence[MessagePart]:
    inner = m["pose"]["pose"]
    return _pose(f"/{m['child_frame_id']}", *_header(m), inner["position"], inner["orientation"])


def _foxglove_odometry(m: Plain) -> Sequence[MessagePart]:
    name, inner = str(m.get("body_frame_id", "")), m["pose"]
    where = inner["position"], inner["orientation"]
    return _pose(f"/{name}" if name else "", *_own(m), *where)


def _transform_stamped(m: Plain) -> Sequence[MessagePart]:
    inner = m["transform"]
    name = f"/{m['child_frame_id']}"
    return _pose(name, *_header(m), inner["translation"], inner["rotation"])


def _tf(m: Plain) -> Sequence[MessagePart]:
    return [part for one in m["transforms"] for part in _transform_stamped(one)]


def _pose_array(m: Plain) -> Sequence[MessagePart]:
    x = np.array([_xyz(p["position"]) for p in m["poses"]]).reshape(-1, 3)
    return _points(*_header(m), x)


def _point_stamped(m: Plain) -> Sequence[MessagePart]:
    return _points(*_header(m), np.array([_xyz(m["point"])]))


def _wrench(m: Plain) -> Sequence[MessagePart]:
    ns, frame = _header(m)
    inner = m["wrench"]
    return [
        MessagePart("/force", ns, frame, np.array(_xyz(inner["force"])), unit="N"),
        MessagePart("/torque", ns, frame, np.array(_xyz(inner["torque"])), unit="N m"),
    ]


def _pressure(m: Plain) -> Sequence[MessagePart]:
    return [MessagePart("", *_header(m), np.array([float(m["fluid_pressure"])]), unit="Pa")]


def _joints(m: Plain) -> Sequence[MessagePart]:
    """Revolute and prismatic joints look alike: their units are not stated."""
    ns, frame = _header(m)
    return [
        MessagePart(f"/{name}.{what}", ns, frame or "joints", np.array([float(values[i])]),
             unit=NOT_STATED)
        for what in ("position", "velocity", "effort")
        for values in (m[what],)
        for i, name in enumerate(m["name"])
        if i < len(values)
    ]  # fmt: skip


def _ros_cloud(m: Plain) -> Sequence[MessagePart]:
    order = ">" if m["is_bigendian"] else "<"
    offsets = {f["name"]: (f["offset"], f["datatype"]) for f in m["fields"]}
    count = int(m["width"]) * int(m["height"])
    return _points(*_header(m), _packed(binary(m["data"]), offsets, m["point_step"], order, count))


def _foxglove_cloud(m: Plain) -> Sequence[MessagePart]:
    offsets = {f["name"]: (f["offset"], f["type"]) for f in m["fields"]}
    data, stride = binary(m["data"]), int(m["point_stride"])
    x = _packed(data, offsets, stride, "<", len(data) // max(stride, 1))
    return _points(*_own(m), _placed(x, m.get("pose")))


def _placed(x: Floats, pose: Any) -> Floats:
    """Points of a cloud in its frame: its own origin lies there by `pose`; none is no motion."""
    if not pose:
        return x
    q = np.array([[*_xyz(pose["orientation"]), float(pose["orientation"]["w"])]])
    turned = x @ rotations(q, "pose")[0].T if q.any() else x  # Protobuf's zeros: not said
    return np.asarray(turned + np.array(_xyz(pose["position"])))


def _packed(data: bytes, offsets: Mapping[str, Any], stride: int, order: str, count: int) -> Floats:
    """Coordinates (k, 3) of points that lie `stride` bytes apart."""
    if count > MAX_POINTS:
        raise RecordingError(f"{count} points, the limit is {MAX_POINTS}")
    columns = []
    for axis in "xyz":
        at, kind = offsets.get(axis, (0, None))
        if kind not in _FLOATS or not 0 <= int(at) < max(stride, 1):
            raise RecordingError(f"a cloud without '{axis}' as a float")
        dtype = np.dtype(order + _FLOATS[kind])
        if len(data) < count * stride or at + dtype.itemsize > stride:
            raise RecordingError(f"{len(data)} bytes for {count} points of {stride}; truncated")
        column = np.ndarray((count,), dtype, data, int(at), (stride,))
        columns.append(column.astype(np.float64))
    return np.stack(columns, axis=1)


def _ros_image(m: Plain) -> Sequence[MessagePart]:
    ns, frame = _header(m)
    return [MessagePart("", ns, frame, image=_raw(m))]


def _foxglove_image(m: Plain) -> Sequence[MessagePart]:
    ns, frame = _own(m)
    return [MessagePart("", ns, frame, image=_raw(m))]


def _raw(m: Plain) -> NDArray[Any]:
    height, width, step = int(m["height"]), int(m["width"]), int(m["step"])
    big = bool(m.get("is_bigendian", 0))
    return grey(RawImage(str(m["encoding"]), height, width, step, binary(m["data"]), big))


def _ros_picture(m: Plain) -> Sequence[MessagePart]:
    ns, frame = _header(m)
    return [MessagePart("", ns, frame, image=decode_picture(binary(m["data"])))]


def _foxglove_picture(m: Plain) -> Sequence[MessagePart]:
    ns, frame = _own(m)
    return [MessagePart("", ns, frame, image=decode_picture(binary(m["data"])))]


def _pose_in_frame(m: Plain) -> Sequence[MessagePart]:
    return _pose("", *_own(m), m["pose"]["position"], m["pose"]["orientation"])


def _point_in_frame(m: Plain) -> Sequence[MessagePart]:
    return _points(*_own(m), np.array([_xyz(m["point"])]))


def _poses_in_frame(m: Plain) -> Sequence[MessagePart]:
    x = np.array([_xyz(p["position"]) for p in m["poses"]]).reshape(-1, 3)
    return _points(*_own(m), x)


def _frame_transform(m: Plain) -> Sequence[MessagePart]:
    ns, frame = stamp_ns(m["timestamp"]), str(m["parent_frame_id"])
    return _pose(f"/{m['child_frame_id']}", ns, frame, m["translation"], m["rotation"])


def _frame_transforms(m: Plain) -> Sequence[MessagePart]:
    return [part for one in m["transforms"] for part in _frame_transform(one)]


_KNOWN: Mapping[str, Parts] = {
    "sensor_msgs/msg/Image": _ros_image,
    "sensor_msgs/msg/CompressedImage": _ros_picture,
    "sensor_msgs/msg/JointState": _joints,
    "sensor_msgs/msg/PointCloud2": _ros_cloud,
    "geometry_msgs/msg/PoseStamped": _pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose_with_covariance,
    "geometry_msgs/msg/PoseArray": _pose_array,
    "geometry_msgs/msg/PointStamped": _point_stamped,
    "geometry_msgs/msg/TransformStamped": _transform_stamped,
    "geometry_msgs/msg/WrenchStamped": _wrench,
    "nav_msgs/msg/Odometry": _odometry,
    "sensor_msgs/msg/FluidPressure": _pressure,
    "tf2_msgs/msg/TFMessage": _tf,
    "foxglove.RawImage": _foxglove_image,
    "foxglove.CompressedImage": _foxglove_picture,
    "foxglove.PoseInFrame": _pose_in_frame,
    "foxglove.Odometry": _foxglove_odometry,
    "foxglove.Point3InFrame": _point_in_frame,
    "foxglove.PosesInFrame": _poses_in_frame,
    "foxglove.PointCloud": _foxglove_cloud,
    "foxglove.FrameTransform": _frame_transform,
    "foxglove.FrameTransforms": _frame_transforms,
}
