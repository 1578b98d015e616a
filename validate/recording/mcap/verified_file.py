"""Verified MCAP file: its content, and its messages by index."""

from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from validate.arrays import Ints
from validate.files import ANY_SIZE, open_file, unreadable
from validate.recording.mcap.records import (
    Attachment,
    Channel,
    Chunk,
    Header,
    Message,
    Metadata,
    Op,
    Schema,
    records_in,
)
from validate.recording.types import Source


@dataclass(frozen=True)
class Span:
    """A chunk or a lone message: first byte and length of its content, channels it speaks of."""

    at: int
    length: int
    chunked: bool
    channels: frozenset[int]


@dataclass(frozen=True)
class Cut:
    """Where a file stops short: its data are whole up to byte `data`, with the CRC-32 `crc`.

    `ended` says whether the end of the data was written, so that only the summary is cut.
    """

    at: int
    data: int
    crc: int
    ended: bool


@dataclass(frozen=True)
class Verified:
    """Result of the check of a file; times are int64 ns, in file order, by channel id."""

    source: Source
    header: Header
    schemas: Mapping[int, Schema]
    channels: Mapping[int, Channel]
    log_ns: Mapping[int, Ints]
    publish_ns: Mapping[int, Ints]
    metadata: tuple[Metadata, ...]
    attachments: tuple[Attachment, ...]  # their data begin at byte `at` of the file
    chunks: int
    messages: int
    compressions: tuple[str, ...]
    claimed_messages: int | None  # by the file's statistics record, None: it has none
    misindexed: int  # chunks that the file's own index misses, or places where none is
    unknown_records: int  # kinds outside the specification, skipped
    spans: tuple[Span, ...]
    cut: Cut | None = None  # None: the file is whole


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """The file for reading; every failure of the disk is a `RecordingError`."""
    try:
        with open_file(path, ANY_SIZE) as stream:
            yield stream
    except OSError as error:
        raise unreadable(path, error) from error


def messages_of(stream: BinaryIO, verified: Verified, wanted: Set[int]) -> Iterator[Message]:
    """The messages of the channels in `wanted`, in file order, read by the verified index."""
    for span in verified.spans:
        if not span.channels.isdisjoint(wanted):
            stream.seek(span.at)
            content = stream.read(span.length)
            for message in _messages(content, span.chunked):
                if message.channel_id in wanted:
                    yield message


def _messages(content: bytes, chunked: bool) -> Iterator[Message]:
    if not chunked:
        yield Message.read(content, 0, len(content))
        return
    data = Chunk.read(content).data
    for opcode, at, end in records_in(data):
        if opcode == Op.MESSAGE:
            yield Message.read(data, at, end)
