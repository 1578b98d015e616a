"""Integrity check of an MCAP file, front to back, before every use.

One pass reads each byte once: magic at both ends, every record's length, chunk, attachment,
data-section and summary CRCs (the `mcap` package never checks the last), ids that are used before
they are declared, and nothing after the closing magic. The same pass makes the index by which the
file is then read, so a summary that is absent, partial or wrong cannot hide a message. A data CRC
of 0 means "none": the file is read, and its integrity is called not provable. A taker gets the
messages it wants on the way, so that a file is inspected in the same pass.
"""

import hashlib
import os
import zlib
from array import array
from collections import Counter, deque
from collections.abc import Set
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Protocol

import numpy as np

from validate.arrays import Ints
from validate.errors import RecordingError
from validate.recording.mcap.records import (
    HEAD,
    MAGIC,
    MAX_RECORD,
    MESSAGE_HEAD,
    Attachment,
    Channel,
    Chunk,
    Cut,
    Footer,
    Header,
    Metadata,
    Op,
    Schema,
    Span,
    Verified,
    chunk_index_place,
    records_in,
    statistics_messages,
)
from validate.recording.types import Source

# --- SHA-256 and CRC-32 of bytes that come one after another, taken by a thread beside the
# reading.
#
# Both cost more than half of what a bare reader takes, and let other threads run. A few blocks
# wait at most, so memory stays bounded; a file below one block is summed at once, without a
# thread.

_HASHED_AT_ONCE, _AHEAD = 2**20, 4  # bytes handed over at once, and how many blocks may wait


class Sums:
    """The SHA-256 of all bytes, and the CRC-32 of those since the last `restart`."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self._crc = 0
        self._waiting: list[bytes] = []
        self._size = 0
        self._thread: ThreadPoolExecutor | None = None
        self._handed: deque[Future[None]] = deque()

    def update(self, data: bytes) -> None:
        """Add bytes behind the others."""
        self._waiting.append(data)
        self._size += len(data)
        if self._size >= _HASHED_AT_ONCE:
            if len(self._handed) >= _AHEAD:
                self._handed.popleft().result()
            if self._thread is None:
                self._thread = ThreadPoolExecutor(1, "sums")
            self._handed.append(self._thread.submit(self._take, self._waiting))
            self._waiting, self._size = [], 0

    def crc(self) -> int:
        """Of all bytes since the last restart."""
        self._settle()
        return self._crc

    def restart(self) -> None:
        """The CRC counts from here on."""
        self._settle()
        self._crc = 0

    def hexdigest(self) -> str:
        """Return the SHA-256 of all bytes; nothing can be added afterwards."""
        self._settle()
        if self._thread is not None:
            self._thread.shutdown()
        return self._sha.hexdigest()

    def _settle(self) -> None:
        while self._handed:
            self._handed.popleft().result()
        self._take(self._waiting)
        self._waiting, self._size = [], 0

    def _take(self, parts: list[bytes]) -> None:
        for part in parts:
            self._sha.update(part)
            self._crc = zlib.crc32(part, self._crc)


# -------------------------------------------------------------------------------------------------

MAX_MESSAGES = 10_000_000
_BLOCK = 2**20  # bytes hashed at once
NOT_PROVABLE = "integrity not provable: no data CRC"
_MESSAGE = int(Op.MESSAGE)  # a plain number: compared for every message
_KNOWN = frozenset(int(op) for op in Op)
_IN_DATA = {Op.HEADER, Op.MESSAGE, Op.CHUNK, Op.ATTACHMENT, Op.METADATA}


class MessageTaker(Protocol):
    """Receiver of messages while the file is checked."""

    def wants(self, channel: Channel, schema: Schema | None, records: Set[str]) -> bool:
        """Asked at a channel's first message, with the names of the metadata before it."""

    def take(self, channel: int, messages: list[bytes]) -> None:
        """JSON or whatever else of a channel's messages, in order of the file."""


class _ShortError(RecordingError):
    """The bytes end before the record does."""


def verify(
    stream: BinaryIO, path: Path, taker: MessageTaker | None = None, *, cut: bool = False
) -> Verified:
    """Check the complete open file; `RecordingError` names the byte and counts what precedes it.

    `cut` takes a file that only stops short as far as it is whole, and says so in `Verified.cut`.
    """
    walk = _Walk(stream, taker)
    try:
        walk.run()
    except RecordingError as error:
        stopped = isinstance(error, _ShortError) and walk.stops_short()
        if not (cut and stopped):
            what = f"; or `validate import {path.name} --recover -o X.mcap`" if stopped else ""
            raise RecordingError(
                f"{path.name}: at byte {walk.record_at} of {walk.size}: {error}; readable before "
                f"it: {walk.chunks} chunks, {walk.messages} messages; copy the file again from its "
                f"source{what}"
            ) from None
    try:
        return walk.found(path)
    except RecordingError as error:
        raise RecordingError(f"{path.name}: {error}") from None


class _Walk:
    """The state of one pass over a file; `found` freezes it."""

    def __init__(self, stream: BinaryIO, taker: MessageTaker | None) -> None:
        self.size = os.fstat(stream.fileno()).st_size
        self.record_at = self.chunks = self.messages = 0
        self._stream = stream
        self._taker = taker
        self._kept: dict[int, list[bytes] | None] = {}  # None: nobody wants them
        self._at = 0
        self._attachments: list[Attachment] = []
        self._sums = Sums()
        self._header: Header | None = None
        self._data_crc: int | None = None  # None: still in the data section
        self._data = (0, 0)  # bytes and CRC of the data section, once it has ended
        self._cut: Cut | None = None
        self._summary_at = 0
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._log: dict[int, array[int]] = {}
        self._publish: dict[int, array[int]] = {}
        self._metadata: list[Metadata] = []
        self._compressions: Counter[str] = Counter()
        self._claimed: int | None = None
        self._misindexed = self._unknown = 0
        self._chunk_places: set[tuple[int, int]] = set()
        self._indexed_places: list[tuple[int, int]] = []
        self._spans: list[Span] = []

    def run(self) -> None:
        if self.size == 0:
            raise RecordingError("the file is empty")
        self._magic("first")
        opcode = None
        while opcode != Op.FOOTER:
            self.record_at = self._at
            head = self._read(HEAD.size)
            opcode, length = HEAD.unpack(head)
            if length > self.size - self._at:
                left = self.size - self._at
                short = _ShortError if length <= MAX_RECORD else RecordingError
                raise short(f"a record declares {length} bytes where the file has {left} left")
            if length > MAX_RECORD:
                raise RecordingError(f"a record of {length} bytes, the limit is {MAX_RECORD}")
            content = self._read(length)
            self._take(opcode, head, content)
            self._sums.update(head)
            self._sums.update(content)
            if opcode == Op.DATA_END:
                self._sums.restart()
        self.record_at = self._at
        self._magic("last")
        if self._at != self.size:
            raise RecordingError(f"{self.size - self._at} bytes after the closing magic")

    def _read(self, count: int) -> bytes:
        got = self._stream.read(min(count, self.size - self._at))
        if len(got) < count:
            raise _ShortError(f"the file ends {count - len(got)} bytes too early")
        self._at += count
        return got

    def stops_short(self) -> bool:
        """Whether what was read is a file whose writer was ended: no other damage, no end."""
        self._stream.seek(max(0, self.size - len(MAGIC)))
        if self._header is None or self._stream.read() == MAGIC:
            return False
        ended = self._data_crc is not None
        data, crc = self._data if ended else (self.record_at, self._sums.crc())
        self._cut = Cut(self.record_at, data, crc, ended)
        self._stream.seek(0)
        self._sums = Sums()
        while block := self._stream.read(_BLOCK):
            self._sums.update(block)
        return True

    def _magic(self, which: str) -> None:
        got = self._read(min(len(MAGIC), self.size - self._at))
        if got != MAGIC:
            kind = _ShortError if which == "last" and MAGIC.startswith(got) else RecordingError
            raise kind(f"the {which} 8 bytes are not the MCAP magic ({got.hex()})")
        self._sums.update(got)

    def _take(self, opcode: int, head: bytes, content: bytes) -> None:
        if (opcode == Op.HEADER) != (self._header is None):
            raise RecordingError("the first record, and only the first, must be the header")
        if opcode == Op.DATA_END:
            if self._data_crc is not None:
                raise RecordingError("a second end of the data section")
            declared, actual = int.from_bytes(content[:4], "little"), self._sums.crc()
            if len(content) < 4 or declared not in (0, actual):
                raise RecordingError(f"data section CRC {actual:#010x}, declared {declared:#010x}")
            self._data_crc = declared
            self._data = (self.record_at, actual)
            self._summary_at = self._at
        elif opcode == Op.FOOTER:
            footer = Footer.read(content)
            if self._data_crc is None:
                raise RecordingError("a footer without an end of the data section before it")
            actual = zlib.crc32(content[:16], zlib.crc32(head, self._sums.crc()))
            if footer.summary_crc not in (0, actual):
                raise RecordingError(
                    f"summary CRC {actual:#010x}, declared {footer.summary_crc:#010x}"
                )
            empty = self._summary_at == self.record_at
            if footer.summary_start not in ((0,) if empty else (self._summary_at,)):
                raise RecordingError(
                    f"footer: summary at byte {footer.summary_start}, found at {self._summary_at}"
                )
            if self._indexed_places:
                self._misindexed = len(set(self._indexed_places) ^ self._chunk_places)
        else:
            self._dispatch(opcode, content)

    def _dispatch(self, opcode: int, content: bytes) -> None:
        if opcode in _IN_DATA and self._data_crc is not None:
            raise RecordingError(f"a {Op(opcode).name} record after the end of the data")
        match opcode:
            case Op.HEADER:
                self._header = Header.read(content)
            case Op.SCHEMA:
                self._take_schema(content)
            case Op.CHANNEL:
                self._take_channel(content)
            case Op.MESSAGE:
                channel = self._count(content, 0, len(content))
                at = self._at - len(content)
                self._spans.append(Span(at, len(content), False, frozenset([channel])))
                self._hand_on()
            case Op.CHUNK:
                chunk = Chunk.read(content)
                channels: set[int] = set()
                for inner, at, end in records_in(chunk.data):
                    if inner == _MESSAGE:
                        channels.add(self._count(chunk.data, at, end))
                    elif inner == Op.SCHEMA:
                        self._take_schema(chunk.data[at:end])
                    elif inner == Op.CHANNEL:
                        self._take_channel(chunk.data[at:end])
                    elif inner in _KNOWN:
                        raise RecordingError(f"a {Op(inner).name} record inside a chunk")
                self._hand_on()
                self.chunks += 1
                self._compressions[chunk.compression or "none"] += 1
                self._chunk_places.add((self.record_at, HEAD.size + len(content)))
                at = self._at - len(content)
                self._spans.append(Span(at, len(content), True, frozenset(channels)))
            case Op.ATTACHMENT:
                found = Attachment.read(content)
                begin = self._at - len(content)
                self._attachments.append(replace(found, at=begin + found.at))
            case Op.METADATA:
                self._metadata.append(Metadata.read(content))
            case Op.STATISTICS:
                self._claimed = statistics_messages(content)
            case Op.CHUNK_INDEX:
                self._indexed_places.append(chunk_index_place(content))
            case _ if opcode not in _KNOWN:
                self._unknown += 1

    def _take_schema(self, content: bytes) -> None:
        schema = Schema.read(content)
        if self._schemas.setdefault(schema.id, schema) != schema:
            raise RecordingError(f"schema {schema.id} declared twice, differently")

    def _take_channel(self, content: bytes) -> None:
        channel = Channel.read(content)
        if channel.schema_id and channel.schema_id not in self._schemas:
            raise RecordingError(f"{channel.topic!r} uses schema {channel.schema_id}, undeclared")
        if self._channels.setdefault(channel.id, channel) != channel:
            raise RecordingError(f"channel {channel.id} declared twice, differently")

    def _count(self, data: bytes, at: int, end: int) -> int:
        """The channel of the message that stands there in a chunk, or in a record of its own."""
        if end - at < MESSAGE_HEAD.size:
            raise RecordingError(f"a message record of {end - at} bytes, at least 22 needed")
        channel, _, log, publish = MESSAGE_HEAD.unpack_from(data, at)
        if channel not in self._kept:
            if channel not in self._channels:
                raise RecordingError(f"a message of channel {channel}, undeclared")
            declared = self._channels[channel]
            schema, names = self._schemas.get(declared.schema_id), {m.name for m in self._metadata}
            wanted = self._taker is not None and self._taker.wants(declared, schema, names)
            self._log[channel], self._publish[channel] = array("Q"), array("Q")
            self._kept[channel] = [] if wanted else None
        if self.messages >= MAX_MESSAGES:
            raise RecordingError(f"more than {MAX_MESSAGES} messages, the limit; split the file")
        self._log[channel].append(log)
        self._publish[channel].append(publish)
        self.messages += 1
        kept = self._kept[channel]
        if kept is not None:
            kept.append(data[at + MESSAGE_HEAD.size : end])
        return int(channel)

    def _hand_on(self) -> None:
        """What was kept of a chunk that is whole."""
        for channel, messages in self._kept.items():
            if messages and self._taker is not None:
                self._taker.take(channel, messages)
                self._kept[channel] = []

    def found(self, path: Path) -> Verified:
        assert self._header is not None  # any other first record was refused
        integrity = "verified" if self._data_crc else NOT_PROVABLE
        if self._cut is not None:
            integrity = f"whole up to byte {self._cut.at} of {self.size}"
        return Verified(
            source=Source(path.name, self._sums.hexdigest(), self.size, integrity),
            header=self._header,
            schemas=MappingProxyType(self._schemas),
            channels=MappingProxyType(self._channels),
            log_ns={i: _int64(self._log.get(i), "log") for i in self._channels},
            publish_ns={i: _int64(self._publish.get(i), "publish") for i in self._channels},
            metadata=tuple(self._metadata),
            attachments=tuple(self._attachments),
            chunks=self.chunks,
            messages=self.messages,
            compressions=tuple(sorted(self._compressions)),
            claimed_messages=self._claimed,
            misindexed=self._misindexed,
            unknown_records=self._unknown,
            spans=tuple(self._spans),
            cut=self._cut,
        )


def _int64(times: "array[int] | None", which: str) -> Ints:
    unsigned = np.frombuffer(times, dtype=np.uint64) if times else np.empty(0, np.uint64)
    if unsigned.size and unsigned.max() > np.iinfo(np.int64).max:
        raise RecordingError(f"{which} time {unsigned.max()} ns is beyond int64; re-record it")
    signed = unsigned.view(np.int64)
    signed.setflags(write=False)
    return signed
