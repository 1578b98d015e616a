"""Foxglove's well-known JSON schemas that a replay uses, in the structure Foxglove publishes.

Source: npm package `@foxglove/schemas` (MIT), whose definitions a test compares with these, less
their descriptions. Viewers know a message by the schema's name; the definition makes the file
readable by those that do not.
"""

from collections.abc import Mapping

from validate.recording.mcap.schemas import Json

SCENE, TRANSFORMS, IMAGE = (
    "foxglove.SceneUpdate",
    "foxglove.FrameTransforms",
    "foxglove.CompressedImage",
)


def _object(title: str, **properties: Json) -> Json:
    """An object all of whose properties are required."""
    return {
        "title": f"foxglove.{title}",
        "type": "object",
        "properties": properties,
        "required": list(properties),
    }


def _list(items: Json) -> Json:
    return {"type": "array", "items": items}


def _choice(title: str, *names: str) -> Json:
    options = [{"title": name, "const": value} for value, name in enumerate(names)]
    return {"title": f"foxglove.{title}", "oneOf": options}


_NUMBER: Json = {"type": "number"}
_TEXT: Json = {"type": "string"}
_FLAG: Json = {"type": "boolean"}
_INDEX: Json = {"type": "integer", "minimum": 0}
_BYTES: Json = {"type": "string", "contentEncoding": "base64"}
_NSEC: Json = _INDEX | {"maximum": 999_999_999}


def _clock(title: str, sec: Json) -> Json:
    return {"type": "object", "title": title, "properties": {"sec": sec, "nsec": _NSEC}}


_TIME, _DURATION = _clock("time", _INDEX), _clock("duration", {"type": "integer"})
_XYZ = {"x": _NUMBER, "y": _NUMBER, "z": _NUMBER}
_VECTOR, _POINT = _object("Vector3", **_XYZ), _object("Point3", **_XYZ)
_TURN = _object("Quaternion", **_XYZ, w=_NUMBER)
_POSE = _object("Pose", position=_VECTOR, orientation=_TURN)
_COLOUR = _object("Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_COLOURED = {"color": _COLOUR, "colors": _list(_COLOUR), "indices": _list(_INDEX)}

_ARROW = _object(
    "ArrowPrimitive",
    pose=_POSE,
    shaft_length=_NUMBER,
    shaft_diameter=_NUMBER,
    head_length=_NUMBER,
    head_diameter=_NUMBER,
    color=_COLOUR,
)
_CYLINDER = _object(
    "CylinderPrimitive",
    pose=_POSE,
    size=_VECTOR,
    bottom_scale=_NUMBER,
    top_scale=_NUMBER,
    color=_COLOUR,
)
_LINE = _object(
    "LinePrimitive",
    type=_choice("LineType", "LINE_STRIP", "LINE_LOOP", "LINE_LIST"),
    pose=_POSE,
    thickness=_NUMBER,
    scale_invariant=_FLAG,
    points=_list(_POINT),
    **_COLOURED,
)
_TEXTS = _object(
    "TextPrimitive",
    pose=_POSE,
    billboard=_FLAG,
    font_size=_NUMBER,
    scale_invariant=_FLAG,
    color=_COLOUR,
    text=_TEXT,
)
_MODEL = _object(
    "ModelPrimitive",
    pose=_POSE,
    scale=_VECTOR,
    color=_COLOUR,
    override_color=_FLAG,
    url=_TEXT,
    media_type=_TEXT,
    data=_BYTES,
)
_ENTITY = _object(
    "SceneEntity",
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_DURATION,
    frame_locked=_FLAG,
    metadata=_list(_object("KeyValuePair", key=_TEXT, value=_TEXT)),
    arrows=_list(_ARROW),
    cubes=_list(_object("CubePrimitive", pose=_POSE, size=_VECTOR, color=_COLOUR)),
    spheres=_list(_object("SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOUR)),
    cylinders=_list(_CYLINDER),
    lines=_list(_LINE),
    triangles=_list(
        _object("TriangleListPrimitive", pose=_POSE, points=_list(_POINT), **_COLOURED)
    ),
    texts=_list(_TEXTS),
    models=_list(_MODEL),
)
_DELETION = _object(
    "SceneEntityDeletion",
    timestamp=_TIME,
    type=_choice("SceneEntityDeletionType", "MATCHING_ID", "ALL"),
    id=_TEXT,
)
_TRANSFORM = _object(
    "FrameTransform",
    timestamp=_TIME,
    parent_frame_id=_TEXT,
    child_frame_id=_TEXT,
    translation=_VECTOR,
    rotation=_TURN,
)

DEFINITIONS: Mapping[str, Json] = {
    SCENE: _object("SceneUpdate", deletions=_list(_DELETION), entities=_list(_ENTITY)),
    TRANSFORMS: _object("FrameTransforms", transforms=_list(_TRANSFORM)),
    IMAGE: _object("CompressedImage", timestamp=_TIME, frame_id=_TEXT, data=_BYTES, format=_TEXT),
}
