"""Writer of channels of any schema (JSON, Protobuf) as one MCAP file with CRCs and zstd.

The only writer: of recordings and of files that are made to be looked at, such as a report's
replay. `enable_data_crcs` is off by default in the `mcap` package. Equal channels, messages and
metadata give equal bytes.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from mcap.writer import CompressionType, Writer

from validate import places
from validate.errors import RecordingError
from validate.places import why_not
from validate.recording.mcap.schemas import ENCODINGS, JSON_SCHEMA, Json, to_bytes

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
    _check(path, channels)
    with replacing(path) as stream:
        _write(stream, path.name, channels, messages, metadata)


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


def _check(path: Path, channels: Sequence[WrittenChannel]) -> None:
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


def _write(
    stream: BinaryIO,
    name: str,
    channels: Sequence[WrittenChannel],
    messages: Iterable[WrittenMessage],
    metadata: Mapping[str, Mapping[str, str]],
) -> None:
    writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library=LIBRARY)
    for record, values in metadata.items():
        writer.add_metadata(record, dict(values))
    numbers = _register(writer, channels)
    counts, before = dict.fromkeys(numbers, 0), 0
    for message in messages:
        topic, ns = message.topic, message.ns
        if topic not in numbers:
            raise RecordingError(f"{name}: topic {topic!r} is not one of {sorted(numbers)}")
        if not before <= ns <= LAST_NS:
            raise RecordingError(
                f"{name}: {topic!r} at {ns} ns, expected {before} .. {LAST_NS}: put the messages "
                "in order of time"
            )
        writer.add_message(
            numbers[topic], log_time=ns, publish_time=ns, sequence=counts[topic], data=message.data
        )
        counts[topic], before = counts[topic] + 1, ns
    writer.finish()  # type: ignore[no-untyped-call]


def _register(writer: Writer, channels: Sequence[WrittenChannel]) -> dict[str, int]:
    """Channel numbers by topic; a schema shared by topics is written once."""
    schemas = {
        schema.name: writer.register_schema(schema.name, schema.encoding, schema.data)
        for schema in {c.schema.name: c.schema for c in channels}.values()
    }
    return {
        c.topic: writer.register_channel(
            c.topic, ENCODINGS[c.schema.encoding], schemas[c.schema.name], dict(c.metadata)
        )
        for c in channels
    }
