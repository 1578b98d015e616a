"""Strict parser of MCAP records, and the content of a verified file with its messages by index.

Layout after the MCAP specification (mcap.dev/spec): opcode u8, length u64, content; all integers
little-endian, strings and maps with a u32 byte length before them. Unlike the `mcap` package's
own reader a string cut short by the end of its record is an error here, and sizes are checked
before memory is taken. Errors are `RecordingError` without a place; the caller knows the byte.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from validate.arrays import Ints
from validate.errors import RecordingError
from validate.files import ANY_SIZE, open_file, unreadable
from validate.recording.types import Source

MAGIC = bytes.fromhex("894d434150300d0a")
HEAD = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
MAX_RECORD = 512 * 2**20  # bytes of one record, or of one chunk unpacked
_PLENTY, _TIMES = 64 * 2**20, 256  # bytes of a chunk, else times its packed size, that are believed


class Op(IntEnum):
    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


class Cursor:
    """Reads the fields of one record in order; raises `RecordingError` at the record's end."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self.at = 0

    def take(self, count: int) -> bytes:
        self._require(count)
        self.at += count
        return self._content[self.at - count : self.at]

    def view(self, count: int) -> memoryview:
        """As `take`, without a copy."""
        self._require(count)
        self.at += count
        return memoryview(self._content)[self.at - count : self.at]

    def _require(self, count: int) -> None:
        left = len(self._content) - self.at
        if count > left:
            raise RecordingError(f"a field of {count} bytes where its record has {left} left")

    def integer(self, width: int) -> int:
        return int.from_bytes(self.take(width), "little")

    def text(self) -> str:
        raw = self.take(self.integer(4))
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise RecordingError(f"a text field is not UTF-8 ({error.reason})") from None

    def texts(self) -> Mapping[str, str]:
        inner = Cursor(self.take(self.integer(4)))
        found: dict[str, str] = {}
        while inner.at < len(inner._content):
            key = inner.text()
            if key in found:
                raise RecordingError(f"key {key!r} twice in one map")
            found[key] = inner.text()
        return MappingProxyType(found)


@dataclass(frozen=True)
class Header:
    profile: str
    library: str

    @staticmethod
    def read(content: bytes) -> "Header":
        fields = Cursor(content)
        return Header(fields.text(), fields.text())


@dataclass(frozen=True)
class Schema:
    id: int
    name: str
    encoding: str
    data: bytes

    @staticmethod
    def read(content: bytes) -> "Schema":
        fields = Cursor(content)
        number, name, encoding = fields.integer(2), fields.text(), fields.text()
        if number == 0:
            raise RecordingError("a schema with id 0, which means 'no schema'")
        return Schema(number, name, encoding, fields.take(fields.integer(4)))


@dataclass(frozen=True)
class Channel:
    id: int
    schema_id: int  # 0: no schema
    topic: str
    encoding: str
    metadata: Mapping[str, str]

    @staticmethod
    def read(content: bytes) -> "Channel":
        fields = Cursor(content)
        number, schema_id = fields.integer(2), fields.integer(2)
        return Channel(number, schema_id, fields.text(), fields.text(), fields.texts())


@dataclass(frozen=True)
class Message:
    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes

    @staticmethod
    def read(data: bytes, at: int, end: int) -> "Message":
        """Return the message that stands there in a chunk, or in a record of its own."""
        if end - at < MESSAGE_HEAD.size:
            raise RecordingError(f"a message record of {end - at} bytes, at least 22 needed")
        channel, sequence, log, publish = MESSAGE_HEAD.unpack_from(data, at)
        return Message(channel, sequence, log, publish, data[at + MESSAGE_HEAD.size : end])


@dataclass(frozen=True)
class Metadata:
    name: str
    values: Mapping[str, str]

    @staticmethod
    def read(content: bytes) -> "Metadata":
        fields = Cursor(content)
        return Metadata(fields.text(), fields.texts())


@dataclass(frozen=True)
class Footer:
    summary_start: int
    summary_crc: int

    @staticmethod
    def read(content: bytes) -> "Footer":
        fields = Cursor(content)
        start, _ = fields.integer(8), fields.integer(8)
        return Footer(start, fields.integer(4))


@dataclass(frozen=True)
class Chunk:
    """A chunk unpacked: its compression's name and its records' bytes, length and CRC checked."""

    compression: str
    data: bytes

    @staticmethod
    def read(content: bytes) -> "Chunk":
        fields = Cursor(content)
        fields.take(16)  # first and last log time: repeated in the messages
        size, crc, compression = fields.integer(8), fields.integer(4), fields.text()
        data = unpack(compression, fields.view(fields.integer(8)), size)
        if crc and zlib.crc32(data) != crc:
            raise RecordingError(f"chunk CRC {zlib.crc32(data):#010x}, declared {crc:#010x}")
        return Chunk(compression, data)


@dataclass(frozen=True)
class Attachment:
    """Times ns, name and media type (never used as a path), where in its record the data lie."""

    log_ns: int
    created_ns: int
    name: str
    media_type: str
    at: int
    size: int

    @staticmethod
    def read(content: bytes) -> "Attachment":
        """Raise `RecordingError` unless the fields fit and the CRC (0: none) is right."""
        fields = Cursor(content)
        times = fields.integer(8), fields.integer(8)
        words = fields.text(), fields.text()
        size = fields.integer(8)
        at = fields.at
        fields.take(size)
        actual = zlib.crc32(content[: fields.at])
        declared = fields.integer(4)
        if declared and declared != actual:
            raise RecordingError(f"attachment CRC {actual:#010x}, declared {declared:#010x}")
        return Attachment(*times, *words, at, size)


def statistics_messages(content: bytes) -> int:
    """Return the message count a statistics record claims."""
    return Cursor(content).integer(8)


def chunk_index_place(content: bytes) -> tuple[int, int]:
    """Where a chunk index says its chunk lies: first byte and length in bytes."""
    fields = Cursor(content)
    fields.take(16)
    return fields.integer(8), fields.integer(8)


def unpack(compression: str, data: memoryview, size: int) -> bytes:
    """Return the `size` bytes packed in `data`; refuses sizes over `MAX_RECORD` before
    allocating."""
    if size > MAX_RECORD:
        raise RecordingError(f"a chunk of {size} bytes unpacked, the limit is {MAX_RECORD}")
    if size > max(_PLENTY, _TIMES * len(data)):
        raise RecordingError(
            f"a chunk of {size} bytes unpacked from {len(data)}, over {_TIMES} times as much; "
            "damaged, or made to fill memory"
        )
    unpackers = {"": _stored, "zstd": _zstd, "lz4": _lz4}
    if compression not in unpackers:
        raise RecordingError(f"chunk compression {compression!r}, readable: none, zstd, lz4")
    plain = unpackers[compression](data, size)
    if len(plain) != size:
        raise RecordingError(f"a chunk of {len(plain)} bytes unpacked, declared {size}")
    return plain


def _stored(data: memoryview, size: int) -> bytes:
    return bytes(data)


def _zstd(data: memoryview, size: int) -> bytes:
    try:
        # A frame that names its own size is unpacked to that size, whatever limit is given.
        framed = zstandard.frame_content_size(data)
        if framed not in (-1, size):
            raise RecordingError(f"a zstd frame of {framed} bytes unpacked, declared {size}")
        if size == 0:
            return b""
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise RecordingError(f"chunk is not valid zstd ({error})") from None


def _lz4(data: memoryview, size: int) -> bytes:
    unpacker = lz4.frame.LZ4FrameDecompressor()
    try:
        plain: bytes = unpacker.decompress(data, max_length=size + 1)
    except (RuntimeError, EOFError) as error:
        raise RecordingError(f"chunk is not valid lz4 ({error})") from None
    return plain


def records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, first byte and end of the content of every record inside an unpacked chunk."""
    at, size = 0, len(data)
    while at < size:
        if at + HEAD.size > size:
            raise RecordingError(f"{size - at} stray bytes at the end of a chunk")
        opcode, length = HEAD.unpack_from(data, at)
        at += HEAD.size
        if length > size - at:
            raise RecordingError(f"a record of {length} bytes where its chunk has {size - at}")
        yield opcode, at, at + length
        at += length


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
