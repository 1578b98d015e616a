"""Messages and metadata records of this package's recordings: schemas, encoding and decoding.

    validate.Markers   {stamp, frame, names, x, y, z, sd}   m; null in a list: point not seen;
                                                           z null as a whole: points in a plane
    validate.Signal    {stamp, frame, unit, values, sd}     in `unit`
    validate.Contour   {stamp, frame, x, y, sd,             m, image plane, closed
                        own_sd, confidence}                 both of this one; may be left out
    foxglove.CompressedImage {timestamp, frame_id, data, format}
                                                           PNG, 8-bit grey, base64; read where the
                                                           file holds its calibration
    foxglove.PosesInFrame                                   mirror of markers, for viewing only

`stamp` is {sec, nsec}; a foreign writer may leave it out, then publish time counts. Numbers are
written in their shortest exact form, so they return bit for bit. Own schemas because the well-
known pose list has no names and JSON has no NaN. A replay holds the same in Protobuf
(`protobuf_messages`), where NaN is a point not seen, no z is points in a plane, and an image is
bytes.
"""

import base64
import binascii
import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError
from validate.recording.images.image import Pixels, decode_png, encode_png
from validate.recording.mcap.records import Metadata
from validate.recording.types import Contours, Frames, Record, Recording

MARKERS, SIGNAL, CONTOUR = "validate.Markers", "validate.Signal", "validate.Contour"
IMAGE = "foxglove.CompressedImage"
MIRROR = "foxglove.PosesInFrame"
MIRROR_OF = "validate.mirror_of"  # key in a mirror channel's metadata: the topic it repeats
JSON_SCHEMA, PROTOBUF = "jsonschema", "protobuf"
ENCODINGS = {JSON_SCHEMA: "json", PROTOBUF: "protobuf"}  # of messages, by that of their schema
MAX_MESSAGE = 16 * 2**20  # bytes of one JSON message: Python objects take some 10 x as much

Json = dict[str, Any]
Parse = Callable[[bytes], Json]  # of one message; raises `RecordingError`


@dataclass(frozen=True)
class Sample:
    """One decoded message; `names` of markers only, `unit` of signals only, `image` of frames,
    `each` (own sd m, confidence) of contours only.

    values: markers (k, 2 or 3) m with NaN = not seen, signal (c,) in `unit`, contour (k, 2) m.
    """

    stamp_ns: int | None
    frame: str
    sd: float
    names: tuple[str, ...]
    unit: str
    values: Floats
    image: Pixels | None = None
    each: tuple[float, float] | None = None

    @property
    def size(self) -> int:
        """Memory of the sample in numbers of float64."""
        return self.values.size + (0 if self.image is None else -(-self.image.size // 8))


def _object(title: str, **properties: Json) -> Json:
    """An object of these fields, all required."""
    fields = {"properties": properties, "required": list(properties)}
    return {"title": title, "type": "object", **fields}


def _with_own(contour: Json) -> Json:
    own = {"own_sd": _SPREAD, "confidence": _SPREAD | {"maximum": 1}}
    return {**contour, "properties": {**contour["properties"], **own}}


def _list(items: Json) -> Json:
    return {"type": "array", "items": items}


_NUMBER: Json = {"type": "number"}
_NUMBERS = _list(_NUMBER)
_TEXT: Json = {"type": "string"}
_SEEN: Json = _list({"type": ["number", "null"]})
_COUNT: Json = {"type": "integer", "minimum": 0}
_STAMP = _object("time", sec=_COUNT, nsec=_COUNT | {"maximum": 999_999_999})
_SPREAD: Json = {"type": "number", "minimum": 0}
_POINT = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_TURN = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("foxglove.Pose", position=_POINT, orientation=_TURN)
_OURS = {"stamp": _STAMP, "frame": _TEXT}
_FOXGLOVE = {"timestamp": _STAMP, "frame_id": _TEXT}
_MAYBE_FLAT = _SEEN | {"type": ["array", "null"]}
_OWN = ("own_sd", "confidence")
_BASE64 = _TEXT | {"contentEncoding": "base64"}

SCHEMAS: Mapping[str, Json] = {
    schema["title"]: schema
    for schema in (
        _object(MARKERS, **_OURS, names=_list(_TEXT), x=_SEEN, y=_SEEN, z=_MAYBE_FLAT, sd=_SPREAD),
        _object(SIGNAL, **_OURS, unit=_TEXT, values=_NUMBERS, sd=_SPREAD),
        _with_own(_object(CONTOUR, **_OURS, x=_NUMBERS, y=_NUMBERS, sd=_SPREAD)),
        _object(IMAGE, **_FOXGLOVE, data=_BASE64, format=_TEXT),
        _object(MIRROR, **_FOXGLOVE, poses=_list(_POSE)),
    )
}


def to_bytes(value: Json) -> bytes:
    """Compact ASCII JSON with keys in the order given; NaN and infinity are refused."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode("ascii")


def stamp(ns: int) -> Json:
    """int64 nanoseconds as {sec, nsec}."""
    return {"sec": ns // 10**9, "nsec": ns % 10**9}


def _ours(ns: int, frame: str) -> Json:
    return {"stamp": stamp(ns), "frame": frame}


def markers_message(ns: int, frame: str, names: Sequence[str], x: Floats, sd: float) -> Json:
    """Return the message of one instant; x (k, 2 or 3) m, NaN becomes null."""
    axes = [[None if v != v else v for v in column] for column in x.T.tolist()]
    places = dict(zip("xyz", [*axes, None], strict=False))
    return {**_ours(ns, frame), "names": list(names), **places, "sd": sd}


def mirror_message(ns: int, frame: str, x: Floats) -> Json:
    """Return the points seen at one instant as unturned poses; points in a plane get z = 0."""
    seen = x[~np.isnan(x).any(axis=1)]
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    poses = [
        {"position": dict(zip("xyz", [*point, 0.0][:3], strict=True)), "orientation": turn}
        for point in seen.tolist()
    ]
    return {"timestamp": stamp(ns), "frame_id": frame, "poses": poses}


def signal_message(ns: int, frame: str, unit: str, values: Floats, sd: float) -> Json:
    """Return the message of one instant; values (c,) in `unit`."""
    return {**_ours(ns, frame), "unit": unit, "values": values.tolist(), "sd": sd}


def contour_message(
    ns: int, frame: str, outline: Floats, sd: float, each: Floats | None = None
) -> Json:
    """Return the message of one instant; outline (k, 2) m in the image plane, `each` its own sd m
    and confidence."""
    x, y = outline.T.tolist()
    own = {} if each is None else dict(zip(_OWN, each.tolist(), strict=True))
    return {**_ours(ns, frame), "x": x, "y": y, "sd": sd, **own}


def image_message(ns: int, frame: str, image: Pixels) -> Json:
    """Return the message of one instant; image (h, w) uint8 as PNG."""
    data = base64.b64encode(encode_png(image)).decode("ascii")
    if len(data) > MAX_MESSAGE - 1024:
        raise RecordingError(
            f"image {image.shape}: {len(data)} bytes as a message, limit {MAX_MESSAGE}; crop it"
        )
    return {"timestamp": stamp(ns), "frame_id": frame, "data": data, "format": "png"}


def parse_json(data: bytes) -> Json:
    """Return the object in a message.

    Raises `RecordingError` for what is no JSON object, for NaN and infinity, a field twice.
    """
    if len(data) > MAX_MESSAGE:
        raise RecordingError(f"a JSON message of {len(data)} bytes, the limit is {MAX_MESSAGE}")
    try:
        message = json.loads(
            data.decode("utf-8"), parse_constant=_no_constant, object_pairs_hook=_once
        )
    except (ValueError, RecursionError) as error:  # no JSON, no UTF-8, or nested without end
        raise RecordingError(f"not readable JSON ({error})") from None
    if not isinstance(message, dict):
        raise RecordingError(f"JSON {type(message).__name__}, expected an object")
    return message


def decode(schema: str, data: bytes, parse: Parse = parse_json) -> Sample:
    """Return the sample in a message of one of our schemas.

    Raises `RecordingError` for what `parse` refuses, for a field that is missing, of a wrong type
    or of another length than its neighbours.
    """
    message = parse(data)
    if schema == IMAGE:
        if _text(message, "format") != "png":
            raise RecordingError(f"image format {message['format']!r}, readable: 'png'")
        ns, frame = _stamp_ns(message, "timestamp"), _text(message, "frame_id")
        picture = _field(message, "data")
        if not isinstance(picture, bytes):  # as those of Protobuf are
            try:
                picture = base64.b64decode(_text(message, "data"), validate=True)
            except (binascii.Error, ValueError) as error:
                raise RecordingError(f"field 'data' is not base64 ({error})") from None
        return Sample(ns, frame, 0.0, (), "", np.empty(0), decode_png(picture))
    names: tuple[str, ...] = ()
    unit = ""
    if schema == MARKERS:
        names = _field(message, "names")
        if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
            raise RecordingError("field 'names' is not a list of texts")
        columns = [_numbers(message, axis, null=True) for axis in "xy"]
        if _field(message, "z") is not None:
            columns.append(_numbers(message, "z", null=True))
        names, values = tuple(names), _columns(columns)
        if len(names) != len(values):
            raise RecordingError(f"{len(names)} names for {len(values)} points")
    elif schema == SIGNAL:
        unit, values = _text(message, "unit"), _numbers(message, "values")
    else:
        values = _columns([_numbers(message, "x"), _numbers(message, "y")])
    sd = _number(message, "sd")
    each = None
    if schema == CONTOUR and any(name in message for name in _OWN):
        each = (_number(message, _OWN[0]), _number(message, _OWN[1]))
        if each[0] < 0 or not 0 <= each[1] <= 1:
            raise RecordingError(f"own_sd {each[0]} m, confidence {each[1]}: 0 or above, to 1")
    ns, frame = _stamp_ns(message, "stamp"), _text(message, "frame")
    return Sample(ns, frame, sd, names, unit, values, each=each)


def _number(message: Json, name: str) -> float:
    return float(_array(name, [_field(message, name)], {int, float})[0])


def _no_constant(token: str) -> float:
    raise RecordingError(f"{token} is not a JSON number; write null for a missing value")


def _once(pairs: list[tuple[str, Any]]) -> Json:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise RecordingError("a field occurs twice")
    return found


def _field(message: Json, name: str) -> Any:
    if name not in message:
        raise RecordingError(f"field '{name}' is missing; found {sorted(message)}")
    return message[name]


def _text(message: Json, name: str) -> str:
    value = _field(message, name)
    if not isinstance(value, str):
        raise RecordingError(f"field '{name}' is {type(value).__name__}, expected text")
    return value


def _stamp_ns(message: Json, name: str) -> int | None:
    if name not in message:
        return None
    value = message[name]
    parts = (value.get("sec"), value.get("nsec")) if isinstance(value, dict) else (None, None)
    sec, nsec = (p if type(p) is int else -1 for p in parts)
    if not (0 <= sec < 2**63 // 10**9 and 0 <= nsec < 10**9):
        raise RecordingError(f"stamp sec {parts[0]}, nsec {parts[1]}: not int64 nanoseconds")
    return sec * 10**9 + nsec


def _numbers(message: Json, name: str, *, null: bool = False) -> Floats:
    values = _field(message, name)
    if not isinstance(values, list):
        raise RecordingError(f"field '{name}' is {type(values).__name__}, expected a list")
    array = _array(name, values, {int, float, type(None)} if null else {int, float})
    if not null and np.isnan(array).any():  # Protobuf's; JSON has none
        raise RecordingError(f"field '{name}' holds NaN, expected numbers")
    return array


def _array(name: str, values: list[Any], allowed: set[type]) -> Floats:
    wrong = {type(v) for v in values} - allowed
    if wrong:
        found = sorted(t.__name__ for t in wrong)
        raise RecordingError(f"field '{name}' holds {', '.join(found)}, expected numbers")
    try:
        array = np.array([np.nan if v is None else float(v) for v in values], dtype=np.float64)
    except OverflowError:
        raise RecordingError(f"field '{name}' holds a number beyond float64") from None
    if np.isinf(array).any():
        raise RecordingError(f"field '{name}' holds a number beyond float64")
    return array


def _columns(columns: list[Floats]) -> Floats:
    lengths = [len(c) for c in columns]
    if len(set(lengths)) != 1:
        raise RecordingError(f"lengths of x, y, z differ: {lengths}")
    return np.stack(columns, axis=1)


RECORD = "validate.recording"  # the recording's name and the format of its file
FORMAT = "1"
POSE = "pose/"  # POSE + topic of every stream of contours or frames
POSE_KEY = "T_frame_from_image"
FOUND_IN = "found_in"  # in the pose record of contours: the topic of the images they come from
CALIBRATION = "calibration/"  # CALIBRATION + topic of every stream of frames
CALIBRATION_KEYS = ("m_per_px_x", "m_per_px_y")


def own_records(recording: Recording) -> dict[str, Record]:
    """Return the records that a recording's file adds to the recording's."""
    own: dict[str, Record] = {RECORD: {"format": FORMAT, "name": recording.name}}
    posed: dict[str, Contours | Frames] = {**recording.contours, **recording.frames}
    for topic, stream in posed.items():
        own[POSE + topic] = {POSE_KEY: " ".join(map(repr, stream.pose.ravel().tolist()))}
        if isinstance(stream, Contours) and stream.images:
            own[POSE + topic] = {**own[POSE + topic], FOUND_IN: stream.images}
    for topic, frames in recording.frames.items():
        scales = zip(CALIBRATION_KEYS, frames.m_per_px, strict=True)
        own[CALIBRATION + topic] = {key: repr(scale) for key, scale in scales}
    return own


def all_records(recording: Recording) -> dict[str, Record]:
    """Return the recording's records and those that its file adds.

    Raises `RecordingError` for records that bear a name of the file's own or hold more than texts.
    """
    own = own_records(recording)
    taken = sorted(own.keys() & recording.metadata.keys())
    if taken:
        raise RecordingError(f"{recording.name}: metadata names {taken} are reserved; rename them")
    for name, values in recording.metadata.items():
        if not all(isinstance(text, str) for pair in values.items() for text in pair):
            raise RecordingError(
                f"{recording.name}: metadata {name!r} has values that are not text"
            )
    return {**own, **recording.metadata}


def by_name(found: Iterable[Metadata]) -> dict[str, Record]:
    """Metadata records by name; the second of one name is called `name#2`, and so on."""
    records: dict[str, Record] = {}
    counts: Counter[str] = Counter()
    for record in found:
        counts[record.name] += 1
        again = counts[record.name] > 1
        name = f"{record.name}#{counts[record.name]}" if again else record.name
        if name in records:
            raise RecordingError(f"metadata {name!r} occurs twice; rename one")
        records[name] = record.values
    return records


def name_of(records: Mapping[str, Record], path: Path) -> str:
    """What the recording calls itself, else its file's name; refuses formats of other versions."""
    record = records.get(RECORD)
    if record is None:
        return path.stem
    if record.get("format") != FORMAT or "name" not in record:
        raise RecordingError(
            f"record '{RECORD}' is {dict(record)}, expected format {FORMAT} and a name; "
            "read it with the version that wrote it"
        )
    return record["name"]


def pose_of(records: Mapping[str, Record], topic: str) -> Floats:
    """T_frame_from_image (4, 4) of a topic; raises `RecordingError` where there is none."""
    return _record_numbers(records, POSE + topic, (POSE_KEY,), 16).reshape(4, 4)


def scale_of(records: Mapping[str, Record], topic: str) -> tuple[float, float]:
    """Size (x, y) m of a topic's pixels; raises `RecordingError` where there is none."""
    x, y = _record_numbers(records, CALIBRATION + topic, CALIBRATION_KEYS, 2).tolist()
    return x, y


def _record_numbers(
    records: Mapping[str, Record], name: str, keys: tuple[str, ...], count: int
) -> Floats:
    """The `count` numbers under `keys` of a topic's metadata record."""
    record = records.get(name, {})
    missing = [key for key in keys if key not in record]
    if missing:
        raise RecordingError(f"no record {name!r} with {', '.join(missing)}, {count} numbers")
    try:
        numbers = np.array([float(word) for key in keys for word in record[key].split()])
    except ValueError as error:
        raise RecordingError(f"record {name!r}: {error}") from None
    return checked(numbers, f"record {name!r}: {', '.join(keys)}", (count,), error=RecordingError)
