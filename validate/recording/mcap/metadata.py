"""Metadata records of a recording's file: its name and format, poses and sizes of pixels."""

from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError
from validate.recording.mcap.records import Metadata
from validate.recording.types import Contours, Frames, Record, Recording

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
    return _numbers(records, POSE + topic, (POSE_KEY,), 16).reshape(4, 4)


def scale_of(records: Mapping[str, Record], topic: str) -> tuple[float, float]:
    """Size (x, y) m of a topic's pixels; raises `RecordingError` where there is none."""
    x, y = _numbers(records, CALIBRATION + topic, CALIBRATION_KEYS, 2).tolist()
    return x, y


def _numbers(records: Mapping[str, Record], name: str, keys: tuple[str, ...], count: int) -> Floats:
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
