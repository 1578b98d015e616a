"""Protobuf messages for other viewers. The only file that imports protobuf.

    validate.Markers  {stamp, frame, names[], x[], y[], z[], sd}  m; NaN: point not seen;
                                                                 no z: points in a plane
    validate.Signal   {stamp, frame, unit, values[], sd}          in `unit`
    validate.Contour  {stamp, frame, x[], y[], sd}                m, image plane, closed

Numbers are doubles, so they return bit for bit. The fields are those of the JSON messages
(`schemas`), which make their contents; recordings themselves are written in JSON.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

from validate.recording.mcap.schemas import CONTOUR, MARKERS, PROTOBUF, SIGNAL, Json
from validate.recording.mcap.write import MessageSchema

_FILE = "validate.proto"
_TEXT, _NUMBER, _TEXTS, _NUMBERS, _STAMP = "text", "number", "texts", "numbers", "stamp"
_BEGIN = {"stamp": _STAMP, "frame": _TEXT}
_FIELDS: Mapping[str, Mapping[str, str]] = {
    MARKERS: {**_BEGIN, "names": _TEXTS, **dict.fromkeys("xyz", _NUMBERS), "sd": _NUMBER},
    SIGNAL: {**_BEGIN, "unit": _TEXT, "values": _NUMBERS, "sd": _NUMBER},
    CONTOUR: {**_BEGIN, **dict.fromkeys("xy", _NUMBERS), "sd": _NUMBER},
}


def protobuf_schema(name: str) -> MessageSchema:
    """Return the schema of one of our messages, with all that it stands on."""
    files = descriptor_pb2.FileDescriptorSet(file=[_timestamp(), _file()])
    return MessageSchema(name, PROTOBUF, files.SerializeToString(deterministic=True))


def protobuf_message(name: str, content: Json) -> bytes:
    """Return the message whose JSON form is `content`; null in a list becomes NaN, else is left
    out."""
    made = _classes()[name]()
    for field, value in content.items():
        if field == "stamp":
            made.stamp.seconds, made.stamp.nanos = value["sec"], value["nsec"]
        elif isinstance(value, list):
            getattr(made, field).extend(float("nan") if v is None else v for v in value)
        elif value is not None:
            setattr(made, field, value)
    data: bytes = made.SerializeToString(deterministic=True)
    return data


@cache
def _classes() -> Mapping[str, Any]:
    pool = descriptor_pool.DescriptorPool()
    pool.Add(_timestamp())
    pool.Add(_file())
    return {n: message_factory.GetMessageClass(pool.FindMessageTypeByName(n)) for n in _FIELDS}


def _timestamp() -> Any:
    found = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(found)
    return found


def _file() -> Any:
    made = descriptor_pb2.FileDescriptorProto(
        name=_FILE, package="validate", syntax="proto3", dependency=[timestamp_pb2.DESCRIPTOR.name]
    )
    for name, fields in _FIELDS.items():
        message = made.message_type.add(name=name.removeprefix("validate."))
        for number, (field, kind) in enumerate(fields.items(), start=1):
            entry = message.field.add(name=field, number=number)
            many = kind in (_TEXTS, _NUMBERS)
            entry.label = entry.LABEL_REPEATED if many else entry.LABEL_OPTIONAL
            if kind == _STAMP:
                entry.type = entry.TYPE_MESSAGE
                entry.type_name = f".{timestamp_pb2.Timestamp.DESCRIPTOR.full_name}"
            else:
                entry.type = entry.TYPE_STRING if kind in (_TEXT, _TEXTS) else entry.TYPE_DOUBLE
    return made
