"""A recording as an MCAP file: same bytes for the same recording, whole or not at all.

Both CRCs are on (`enable_data_crcs` is off by default in the `mcap` package), chunks are zstd.
Messages are in order of time; log time = publish time = stamp. Stamps are whole nanoseconds, so
times on that grid return exactly up to 26 days (2^51 ns); zero of time on return is the earliest
sample. `clock` and `source` are not written: reading makes them anew.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.writer import CompressionType, Writer

from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.recording.mcap import schemas
from validate.recording.mcap.schemas import CONTOUR, IMAGE, MARKERS, MIRROR, MIRROR_OF, SIGNAL, Json
from validate.recording.mcap.streams import CALIBRATION
from validate.recording.types import Contours, Frames, Markers, Recording, Signal

RECORD = "validate.recording"  # metadata record with the recording's name and format
FORMAT = "1"
POSE = "pose/"  # metadata record POSE + topic of every stream of contours or frames
POSE_KEY = "T_frame_from_image"
CALIBRATION_KEYS = ("m_per_px_x", "m_per_px_y")
LIBRARY = "validate"  # without a version: two versions write the same bytes


@dataclass(frozen=True)
class _Stream:
    topic: str
    schema: str
    stamps: Ints
    message: Callable[[int], Json]  # of sample i
    metadata: dict[str, str]


def write_recording(recording: Recording, path: Path) -> None:
    """Write `recording` to `path`, replacing what is there only when all is written.

    Raises `RecordingError`: no streams, a topic or metadata name used twice, times that are no
    int64 nanoseconds, images over 4096 px a side, or a path that cannot be written.
    """
    streams = _streams(recording)
    metadata = _metadata(recording)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("xb") as stream:
            _write(stream, streams, metadata)
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(path)
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be written ({error.strerror})") from error
    except UnicodeEncodeError as error:
        raise RecordingError(f"{recording.name}: text that is no UTF-8 ({error.reason})") from error
    finally:
        with suppress(OSError):  # no folder, no leftover
            part.unlink(missing_ok=True)


def _write(stream: BinaryIO, streams: list[_Stream], metadata: dict[str, dict[str, str]]) -> None:
    writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library=LIBRARY)
    for name, values in metadata.items():
        writer.add_metadata(name, values)
    channels = _register(writer, streams)
    for ns, which, i in _in_time(streams):
        data = schemas.to_bytes(streams[which].message(i))
        writer.add_message(channels[which], log_time=ns, publish_time=ns, sequence=i, data=data)
    writer.finish()  # type: ignore[no-untyped-call]


def _register(writer: Writer, streams: list[_Stream]) -> list[int]:
    ids = {
        name: writer.register_schema(
            name, schemas.SCHEMA_ENCODING, schemas.to_bytes(schemas.SCHEMAS[name])
        )
        for name in dict.fromkeys(s.schema for s in streams)
    }
    encoding = schemas.MESSAGE_ENCODING
    return [writer.register_channel(s.topic, encoding, ids[s.schema], s.metadata) for s in streams]


def _in_time(streams: list[_Stream]) -> Iterator[tuple[int, int, int]]:
    """(ns, stream, sample) of all samples in order of time, streams in their order when equal."""
    ns = np.concatenate([s.stamps for s in streams])
    which = np.repeat(np.arange(len(streams)), [len(s.stamps) for s in streams])
    sample = np.concatenate([np.arange(len(s.stamps)) for s in streams])
    for k in np.argsort(ns, kind="stable"):
        yield int(ns[k]), int(which[k]), int(sample[k])


def _streams(recording: Recording) -> list[_Stream]:
    streams: list[_Stream] = []
    for topic, markers in recording.markers.items():
        streams += _markers(topic, markers, recording)
    for topic, signal in recording.signals.items():
        streams.append(_signal(topic, signal, recording))
    for topic, contours in recording.contours.items():
        streams.append(_contours(topic, contours, recording))
    for topic, frames in recording.frames.items():
        streams.append(_frames(topic, frames, recording))
    if not streams:
        raise RecordingError(f"{recording.name}: no streams to write")
    topics = [s.topic for s in streams]
    twice = sorted({t for t in topics if topics.count(t) > 1})
    if twice:
        raise RecordingError(
            f"{recording.name}: topics used twice: {twice}; rename one "
            "('<markers>/foxglove' is taken by the mirror)"
        )
    return streams


def _markers(topic: str, m: Markers, recording: Recording) -> list[_Stream]:
    ns = stamps_ns(recording.t0_ns, m.t, topic)

    def own(i: int) -> Json:
        return schemas.markers_message(int(ns[i]), m.frame, m.names, m.x[i], m.sd)

    def mirror(i: int) -> Json:
        return schemas.mirror_message(int(ns[i]), m.frame, m.x[i])

    return [
        _Stream(topic, MARKERS, ns, own, {}),
        _Stream(f"{topic}/foxglove", MIRROR, ns, mirror, {MIRROR_OF: topic}),
    ]


def _signal(topic: str, s: Signal, recording: Recording) -> _Stream:
    ns = stamps_ns(recording.t0_ns, s.t, topic)

    def own(i: int) -> Json:
        return schemas.signal_message(int(ns[i]), s.frame, s.unit, s.y[i], s.sd)

    return _Stream(topic, SIGNAL, ns, own, {})


def _contours(topic: str, c: Contours, recording: Recording) -> _Stream:
    ns = stamps_ns(recording.t0_ns, c.t, topic)

    def own(i: int) -> Json:
        return schemas.contour_message(int(ns[i]), c.frame, c.outlines[i], c.sd)

    return _Stream(topic, CONTOUR, ns, own, {})


def _frames(topic: str, f: Frames, recording: Recording) -> _Stream:
    ns = stamps_ns(recording.t0_ns, f.t, topic)

    def own(i: int) -> Json:
        return schemas.image_message(int(ns[i]), f.frame, f.images[i])

    return _Stream(topic, IMAGE, ns, own, {})


def stamps_ns(t0_ns: int, t: Floats, topic: str) -> Ints:
    """t0_ns + round(t 1e9) in int64 ns; raises `RecordingError` outside 0 .. 2^63 - 1."""
    largest = int(np.iinfo(np.int64).max)
    ends = (np.clip(t[[0, -1]], -1e10, 1e10) * 1e9).tolist()  # clipped beyond int64, no infinity
    first, last = t0_ns + round(ends[0]), t0_ns + round(ends[1])
    if min(t0_ns, first) < 0 or max(t0_ns, last) > largest:
        raise RecordingError(f"{topic!r}: times {first} .. {last} ns are outside 0 .. {largest}")
    return np.int64(t0_ns) + np.rint(t * 1e9).astype(np.int64)


def _metadata(recording: Recording) -> dict[str, dict[str, str]]:
    own = {RECORD: {"format": FORMAT, "name": recording.name}}
    posed: list[tuple[str, Contours | Frames]] = [*recording.contours.items()]
    for topic, stream in [*posed, *recording.frames.items()]:
        numbers = " ".join(repr(v) for v in stream.pose.ravel().tolist())
        own[POSE + topic] = {POSE_KEY: numbers}
    for topic, frames in recording.frames.items():
        scales = zip(CALIBRATION_KEYS, frames.m_per_px, strict=True)
        own[CALIBRATION + topic] = {key: repr(scale) for key, scale in scales}
    taken = sorted(own.keys() & recording.metadata.keys())
    if taken:
        raise RecordingError(f"{recording.name}: metadata names {taken} are reserved; rename them")
    for name, values in recording.metadata.items():
        if not all(isinstance(text, str) for pair in values.items() for text in pair):
            raise RecordingError(f"{recording.name}: metadata {name!r} holds more than texts")
    return own | {name: dict(values) for name, values in recording.metadata.items()}
