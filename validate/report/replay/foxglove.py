"""Messages in Foxglove's well-known schemas, in Protobuf, by foxglove-schemas-protobuf.

Lengths m, colours 0..1, rotations x y z w.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.KeyValuePair_pb2 import KeyValuePair
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.schema import build_file_descriptor_set
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints
from validate.recording.mcap.write import MessageSchema

Entity = SceneEntity
_UNTURNED = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
_AT_ORIGIN = Pose(position=Vector3(x=0.0, y=0.0, z=0.0), orientation=_UNTURNED)
_LINE_WIDTH = 2.5  # pixels on the screen
_CLOUD = np.dtype([(name, "<f4") for name in "xyz"]
                  + [(name, "u1") for name in ("red", "green", "blue", "alpha")])  # fmt: skip
_FIELDS = [  # of _CLOUD
    PackedElementField(name=name, offset=4 * i, type=PackedElementField.FLOAT32)
    for i, name in enumerate("xyz")
] + [
    PackedElementField(name=name, offset=12 + i, type=PackedElementField.UINT8)
    for i, name in enumerate(("red", "green", "blue", "alpha"))
]
_KINDS = (SceneUpdate, FrameTransforms, CompressedImage, PointCloud)
LAST_NS = 2**32 * 10**9 - 1  # its stamps count seconds in 32 bits
SCHEMAS = {
    kind.DESCRIPTOR.full_name: MessageSchema(
        kind.DESCRIPTOR.full_name, "protobuf", build_file_descriptor_set(kind).SerializeToString()
    )
    for kind in _KINDS
}
SCENE, TRANSFORMS, IMAGE, CLOUD = SCHEMAS  # in the order of _KINDS


@dataclass(frozen=True)
class Rgba:
    """A colour, each part 0..1; a = 0 is transparent."""

    r: float
    g: float
    b: float
    a: float = 1.0

    @property
    def message(self) -> Color:
        return _colour(self.r, self.g, self.b, self.a)


@cache
def _colour(r: float, g: float, b: float, a: float) -> Color:
    return Color(r=r, g=g, b=b, a=a)


def frame_transforms(ns: int, parent: str, children: Sequence[tuple[str, Floats]]) -> bytes:
    """`children`: frame name and T_parent_from_child (4, 4), a proper rotation and shift m."""
    transforms = []
    for child, pose in children:
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
        transforms.append(FrameTransform(
            timestamp=_time(ns), parent_frame_id=parent, child_frame_id=child,
            translation=_vector(pose[:3, 3]), rotation=Quaternion(x=x, y=y, z=z, w=w),
        ))  # fmt: skip
    return _encoded(FrameTransforms(transforms=transforms))


def picture(ns: int, frame: str, png: bytes) -> bytes:
    """Return an image as PNG."""
    return _encoded(CompressedImage(timestamp=_time(ns), frame_id=frame, data=png, format="png"))


def scene_update(*entities: Entity) -> bytes:
    """Each entity takes the place of the earlier one with its id."""
    return _encoded(SceneUpdate(entities=list(entities)))


def outline(ns: int, frame: str, name: str, points: Floats, colour: Rgba, **notes: str) -> Entity:
    """Return the closed line through points (k, 2) m in the plane z = 0 of `frame`."""
    line = LinePrimitive(
        type=LinePrimitive.LINE_LOOP,
        pose=_AT_ORIGIN,
        thickness=_LINE_WIDTH,
        scale_invariant=True,
        points=_points(points),
        color=colour.message,
    )
    return _entity(ns, frame, name, notes, lines=[line])


def spheres(
    ns: int, frame: str, name: str, centres: Floats, colour: Rgba, *, diameter: float, **notes: str
) -> Entity:
    """Equal spheres at centres (k, 2 or 3) m; those with NaN (not seen) are left out."""
    size = Vector3(x=diameter, y=diameter, z=diameter)
    drawn = [
        SpherePrimitive(
            pose=Pose(position=_vector(centre), orientation=_UNTURNED),
            size=size,
            color=colour.message,
        )
        for centre in centres[np.isfinite(centres).all(axis=1)]
    ]
    return _entity(ns, frame, name, notes, spheres=drawn)


def surface(
    ns: int, frame: str, name: str, points: Floats, triangles: Ints, colours: Floats, **notes: str
) -> Entity:
    """Triangles (t, 3) between points (v, 3) m, coloured by colours (v, 4) per point.

    Points are rounded to micrometres and colours to a thousandth: it is for the eye.
    """
    drawn = TriangleListPrimitive(
        pose=_AT_ORIGIN,
        points=_points(np.round(points, 6)),
        color=Rgba(1.0, 1.0, 1.0).message,
        colors=[_colour(*shade) for shade in np.round(colours, 3).tolist()],
        indices=triangles.ravel().tolist(),
    )
    return _entity(ns, frame, name, notes, triangles=[drawn])


def cloud(ns: int, frame: str, points: Floats, colours: Floats) -> bytes:
    """Points (k, 2 or 3) m, rounded to float32, coloured by colours (k or 1, 4) 0..1.

    Those with NaN (not seen) are left out. For viewers that draw points, but no scenes.
    """
    there = np.isfinite(points).all(axis=1)
    packed = np.zeros(len(points), _CLOUD)
    for name, column in zip("xyz", points.T, strict=False):
        packed[name] = column
    shades = np.broadcast_to(np.rint(255 * colours), (len(points), 4))
    for name, column in zip(("red", "green", "blue", "alpha"), shades.T, strict=True):
        packed[name] = column
    return _encoded(
        PointCloud(
            timestamp=_time(ns),
            frame_id=frame,
            pose=_AT_ORIGIN,
            point_stride=_CLOUD.itemsize,
            fields=_FIELDS,
            data=packed[there].tobytes(),
        )
    )


def _encoded(message: Any) -> bytes:
    encoded: bytes = message.SerializeToString()
    return encoded


def _entity(ns: int, frame: str, name: str, notes: dict[str, str], **drawn: Any) -> Entity:
    """Lines, spheres or triangles under a name, until another entity has it."""
    return Entity(
        timestamp=_time(ns), frame_id=frame, id=name, lifetime=Duration(), frame_locked=True,
        metadata=[KeyValuePair(key=key, value=value) for key, value in notes.items()], **drawn,
    )  # fmt: skip


def _time(ns: int) -> Timestamp:
    return Timestamp(seconds=ns // 10**9, nanos=ns % 10**9)


def _vector(point: Floats) -> Vector3:
    """Points in a plane get z = 0."""
    x, y, z = [*point.tolist(), 0.0][:3]
    return Vector3(x=x, y=y, z=z)


def _points(points: Floats) -> list[Point3]:
    in_space = np.hstack([points, np.zeros((len(points), 1))]).tolist()
    return [Point3(x=x, y=y, z=z) for x, y, z, *_ in in_space]
