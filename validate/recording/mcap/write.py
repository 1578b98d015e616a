"""Writer of MCAP: channels of any schema, and recordings; complete or not at all.

Messages are in order of time; log time = publish time = stamp. Stamps are whole nanoseconds, so
times on that grid return exactly up to 26 days (2^51 ns); zero of time on return is the earliest
sample. `clock` and `source` are not written: reading makes them anew.

The only writer: of recordings and of files that are made to be looked at, such as a report's
replay. `enable_data_crcs` is off by default in the `mcap` package. Equal channels, messages and
metadata give equal bytes.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.writer import CompressionType, Writer

from validate import places
from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.places import why_not
from validate.recording.mcap import schemas
from validate.recording.mcap.schemas import (
    CONTOUR,
    ENCODINGS,
    IMAGE,
    JSON_SCHEMA,
    MARKERS,
    MIRROR,
    MIRROR_OF,
    SCHEMAS,
    SIGNAL,
    Json,
    all_records,
    to_bytes,
)
from validate.recording.types import Contours, Frames, Markers, Recording, Signal, Stream

LIBRARY = "validate"  # without a version: two versions write the same bytes
LAST_NS = 2**63 - 1


@dataclass(frozen=True)
class MessageSchema:
    """How messages are laid out: a JSON schema or a Protobuf set of files, known by its name."""

    name: str
    encoding: str
    data: bytes


def json_schema(name: str, definition: Json) -> MessageSchema:
    """Return the schema of messages that `schemas.to_bytes` writes."""
    return MessageSchema(name, JSON_SCHEMA, to_bytes(definition))


@dataclass(frozen=True)
class WrittenChannel:
    """A topic whose messages follow `schema`."""

    topic: str
    schema: MessageSchema
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class WrittenMessage:
    """One encoded message of a topic; log time = publish time = `ns`, int64 nanoseconds."""

    topic: str
    ns: int
    data: bytes


def write_channels(
    path: Path,
    channels: Sequence[WrittenChannel],
    messages: Iterable[WrittenMessage],
    metadata: Mapping[str, Mapping[str, str]],
) -> None:
    """Write `messages`, already in order of time, replacing `path` only when all is written.

    Raises `RecordingError`: a topic declared twice, a schema name with two definitions, a message
    of an undeclared topic, a time that runs backward or is no int64 nanoseconds, or a path that
    cannot be written.
    """
    topics = [c.topic for c in channels]
    twice = sorted({t for t in topics if topics.count(t) > 1})
    if twice:
        raise RecordingError(f"{path.name}: topics used twice: {twice}; rename one")
    known: dict[str, MessageSchema] = {}
    for channel in channels:
        if known.setdefault(channel.schema.name, channel.schema) != channel.schema:
            raise RecordingError(
                f"{path.name}: schema '{channel.schema.name}' of {channel.topic!r} differs from "
                "that of another topic; rename one schema"
            )
    with replacing(path) as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile="", library=LIBRARY)
        for record, values in metadata.items():
            writer.add_metadata(record, dict(values))
        # Channel numbers by topic; a schema shared by topics is written once.
        numbered = {
            schema.name: writer.register_schema(schema.name, schema.encoding, schema.data)
            for schema in {c.schema.name: c.schema for c in channels}.values()
        }
        numbers = {
            c.topic: writer.register_channel(
                c.topic, ENCODINGS[c.schema.encoding], numbered[c.schema.name], dict(c.metadata)
            )
            for c in channels
        }
        counts, before = dict.fromkeys(numbers, 0), 0
        for message in messages:
            topic, ns = message.topic, message.ns
            if topic not in numbers:
                raise RecordingError(
                    f"{path.name}: topic {topic!r} is not one of {sorted(numbers)}"
                )
            if not before <= ns <= LAST_NS:
                raise RecordingError(
                    f"{path.name}: {topic!r} at {ns} ns, expected {before} .. {LAST_NS}: put the "
                    "messages in order of time"
                )
            writer.add_message(
                numbers[topic],
                log_time=ns,
                publish_time=ns,
                sequence=counts[topic],
                data=message.data,
            )
            counts[topic], before = counts[topic] + 1, ns
        writer.finish()  # type: ignore[no-untyped-call]


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """As `places.replacing`; raises `RecordingError` for a path that cannot be written, or text
    that is no UTF-8."""
    written = 0
    try:
        with places.replacing(path) as stream:
            try:
                yield stream
            finally:
                written = os.fstat(stream.fileno()).st_size
    except OSError as error:
        why = why_not(error, path, written)
        raise RecordingError(f"{path.name}: cannot be written ({why})") from error
    except UnicodeEncodeError as error:
        raise RecordingError(f"{path.name}: text that is not UTF-8 ({error.reason})") from error


_SCHEMA_OF = {Markers: MARKERS, Signal: SIGNAL, Contours: CONTOUR, Frames: IMAGE}


@dataclass(frozen=True)
class _Written:
    """One channel with its stamps (n,) ns and the message of sample i at a stamp."""

    channel: WrittenChannel
    stamps: Ints
    message: Callable[[int, int], Json]


def write_recording(recording: Recording, path: Path | str) -> None:
    """Write `recording` to `path`, replacing what is there only when all is written.

    Raises `RecordingError`: no streams, a topic or metadata name used twice, times that are no
    int64 nanoseconds, images over 4096 px a side, or a path that cannot be written.
    """
    if not recording.streams:
        raise RecordingError(f"{recording.name}: no streams to write")
    parts = [w for topic, s in recording.streams.items() for w in _parts(topic, s, recording.t0_ns)]
    write_channels(Path(path), [p.channel for p in parts], _messages(parts), all_records(recording))


def _parts(topic: str, stream: Stream, t0_ns: int) -> list[_Written]:
    """The channel of a stream, and the mirror of markers that viewers know."""
    ns = stamps_ns(t0_ns, stream.t, topic)
    own = WrittenChannel(topic, _schema(_SCHEMA_OF[type(stream)]))
    parts = [_Written(own, ns, lambda i, at: _message(stream, i, at))]
    if isinstance(stream, Markers):
        frame, x = stream.frame, stream.x
        seen = WrittenChannel(f"{topic}/foxglove", _schema(MIRROR), {MIRROR_OF: topic})
        parts.append(_Written(seen, ns, lambda i, at: schemas.mirror_message(at, frame, x[i])))
    return parts


def _schema(name: str) -> MessageSchema:
    return json_schema(name, SCHEMAS[name])


def _message(stream: Stream, i: int, ns: int) -> Json:
    if isinstance(stream, Markers):
        return schemas.markers_message(ns, stream.frame, stream.names, stream.x[i], stream.sd)
    if isinstance(stream, Signal):
        return schemas.signal_message(ns, stream.frame, stream.unit, stream.y[i], stream.sd)
    if isinstance(stream, Contours):
        return schemas.contour_message(
            ns,
            stream.frame,
            stream.outlines[i],
            stream.sd,
            None if stream.each is None else stream.each[i],
        )
    return schemas.image_message(ns, stream.frame, stream.images[i])


def _messages(parts: list[_Written]) -> Iterator[WrittenMessage]:
    """All samples in order of time, channels in their order when equal."""
    ns = np.concatenate([p.stamps for p in parts])
    which = np.repeat(np.arange(len(parts)), [len(p.stamps) for p in parts])
    sample = np.concatenate([np.arange(len(p.stamps)) for p in parts])
    for k in np.argsort(ns, kind="stable"):
        part, at = parts[which[k]], int(ns[k])
        data = to_bytes(part.message(int(sample[k]), at))
        yield WrittenMessage(part.channel.topic, at, data)


def stamps_ns(t0_ns: int, t: Floats, topic: str) -> Ints:
    """t0_ns + round(t 1e9) in int64 ns; raises `RecordingError` outside 0 .. 2^63 - 1."""
    largest = int(np.iinfo(np.int64).max)
    ends = (np.clip(t[[0, -1]], -1e10, 1e10) * 1e9).tolist()  # clipped beyond int64, no infinity
    first, last = t0_ns + round(ends[0]), t0_ns + round(ends[1])
    if min(t0_ns, first) < 0 or max(t0_ns, last) > largest:
        raise RecordingError(f"{topic!r}: times {first} .. {last} ns are outside 0 .. {largest}")
    return np.int64(t0_ns) + np.rint(t * 1e9).astype(np.int64)
