"""Known messages of ROS 2 and Foxglove: points, poses, numbers with units, images.

Each known type is one function from its plain fields to parts; a part is a sample of the stream
`<topic><part>`. Coordinates of both are metres, forces newtons, angles radians.

Compressed images of cameras (PNG, JPEG, TIFF, BMP) as grey images, by Pillow.

For images of others: ours are PNG, grey, and checked chunk by chunk in `image`.
"""

import io
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.images.image import MAX_SIDE, demosaiced, luma
from validate.recording.mcap.decoders import Plain, binary
from validate.recording.motion_capture.poses import ROTATION, TRANSLATION, rotations

# --- Images as cameras send them, unpacked bytes with the name of their encoding, made grey.
#
# Names as ROS 2 (`sensor_msgs/image_encodings`) and Foxglove (`RawImage`) write them. Numbers
# that are no brightness (32FC1: distances) are no image here.

_CHANNELS = {"mono8": 1, "8UC1": 1, "rgb8": 3, "bgr8": 3, "8UC3": 3, "rgba8": 4, "bgra8": 4}
_DEEP_ENCODINGS = {"mono16": 1, "16UC1": 1, "rgb16": 3, "bgr16": 3, "rgba16": 4, "bgra16": 4}
_BRIGHTNESS = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}  # its byte of every pair
_BAYER = {f"bayer_{order}{bits}": (order.upper(), bits // 8)
          for order in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)}  # fmt: skip


@dataclass(frozen=True)
class RawImage:
    """Rows of `step` bytes; numbers of two bytes end with the lower one where `big`."""

    encoding: str
    height: int
    width: int
    step: int
    data: bytes
    big: bool


def grey(image: RawImage) -> NDArray[Any]:
    """Return the image (h, w), uint8 or uint16; colour by its luma.

    Raises `RecordingError` for an encoding of other kinds, and too few bytes.
    """
    if image.encoding in _BRIGHTNESS:
        return _numbers(image, 2, 1)[..., _BRIGHTNESS[image.encoding]].copy()
    if image.encoding in _BAYER:
        order, size = _BAYER[image.encoding]
        return demosaiced(np.ascontiguousarray(_numbers(image, 1, size)[..., 0]), order)
    if image.encoding in _CHANNELS:
        return _luma(_numbers(image, _CHANNELS[image.encoding], 1), image.encoding)
    if image.encoding in _DEEP_ENCODINGS:
        return _luma(_numbers(image, _DEEP_ENCODINGS[image.encoding], 2), image.encoding)
    raise RecordingError(
        f"encoding '{image.encoding}'; expected grey, colour or bayer of 8 or 16 bits, or yuv422"
    )


def _numbers(image: RawImage, channels: int, size: int) -> NDArray[Any]:
    """Numbers (h, w, channels) of `size` bytes, without what fills the rows."""
    wide, height, step = image.width * channels * size, image.height, image.step
    if step < wide or len(image.data) < height * step or min(height, image.width) < 1:
        raise RecordingError(
            f"{len(image.data)} bytes for {image.width} x {height} px of {channels}; truncated"
        )
    rows = np.frombuffer(image.data, np.uint8, height * step).reshape(height, step)
    numbers = np.ascontiguousarray(rows[:, :wide]).view(f"{'>' if image.big else '<'}u{size}")
    return numbers.reshape(height, image.width, channels).astype(f"u{size}")


def _luma(pixels: NDArray[Any], encoding: str) -> NDArray[Any]:
    if pixels.shape[-1] == 1:
        return np.ascontiguousarray(pixels[..., 0])
    colour = pixels[..., 2::-1] if encoding.startswith("b") else pixels[..., :3]
    return luma(colour)


# -------------------------------------------------------------------------------------------------

FORMATS = ("PNG", "JPEG", "TIFF", "BMP")
# Whatever Pillow raises on damage; a bomb is none of its other errors.
_DAMAGE = (OSError, ValueError, SyntaxError, Warning, EOFError, MemoryError,
           Image.DecompressionBombError)  # fmt: skip
_DEEP = "I;16"  # Pillow's mode, in either order of bytes


def decode_picture(data: bytes) -> NDArray[Any]:
    """Return the image (h, w) uint8, colour by ITU-R BT.601's luma; uint16 of grey so deep.

    Raises `RecordingError` for a picture of another format, over `MAX_SIDE`, deeper, cut or
    damaged.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of bombs and of broken tags
            with Image.open(io.BytesIO(data), formats=FORMATS) as opened:
                width, height = opened.size
                if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
                    raise RecordingError(
                        f"image of {width} x {height} px, allowed 1..{MAX_SIDE} per side"
                    )
                if opened.mode in ("I", "F"):
                    raise RecordingError(
                        f"an image of mode {opened.mode}: over 16 bits; save 16-bit grey"
                    )
                if opened.mode.startswith(_DEEP):
                    return np.asarray(opened).astype(np.uint16)
                return np.asarray(opened.convert("L"), dtype=np.uint8).copy()
    except UnidentifiedImageError:
        raise RecordingError(
            f"{len(data)} bytes are not an image; expected {', '.join(FORMATS)}"
        ) from None
    except RecordingError:
        raise
    except _DAMAGE as error:
        raise RecordingError(f"damaged image ({' '.join(str(error).split())[:120]})") from None


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
        # Of 2023-11-14T22:13:20.5Z; raises `RecordingError` for other text.
        whole, _, fraction = stamp.removesuffix("Z").partition(".")
        try:
            at = datetime.fromisoformat(whole).replace(tzinfo=UTC)
            return int(at.timestamp()) * 10**9 + int(fraction.ljust(9, "0")[:9])
        except ValueError:
            raise RecordingError(
                f"'{stamp[:40]}' is not a time, as 2023-11-14T22:13:20.5Z"
            ) from None
    if not isinstance(stamp, Mapping):
        raise RecordingError(f"{type(stamp).__name__} is not a time")
    sec, nsec = stamp["sec"], stamp.get("nanosec", stamp.get("nsec"))
    try:
        return int(sec) * 10**9 + int(nsec)
    except OverflowError:
        raise RecordingError(f"{sec} s is not a time") from None


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
    if pose := m.get("pose"):  # the cloud's own origin in its frame; none is no motion
        q = np.array([[*_xyz(pose["orientation"]), float(pose["orientation"]["w"])]])
        turned = x @ rotations(q, "pose")[0].T if q.any() else x  # Protobuf's zeros: not said
        x = np.asarray(turned + np.array(_xyz(pose["position"])))
    return _points(*_own(m), x)


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
