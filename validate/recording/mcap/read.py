"""Reader of MCAP files, verified front to back before their index is used; recovery of cut files.

Topics with schemas of others, mirrors among them, are not read by `read_recording`, which
experiments use, nor are images without a record of their calibration (`calibration/<topic>`:
m_per_px_x, m_per_px_y). `validate import` reads what of them means something (`read_all`).
Nothing in the file is used as a path, and sizes are bounded before memory is taken
(`records.MAX_RECORD`, `integrity.MAX_MESSAGES`, `schemas.MAX_MESSAGE`,
`streams.MAX_NUMBERS`).

A recovered file is the complete part of a truncated one, byte for byte, with a new end. Its record
`validate.recovered` tells what was saved and what is missing. There is no summary, so readers that
need an index find none.
"""

import zlib
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from validate.errors import RecordingError, UsageError
from validate.files import ANY_SIZE
from validate.recording.clocks.alignment import moved
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.records import HEAD, MAGIC, Cut, Op, messages_of, opened
from validate.recording.mcap.schemas import by_name, name_of, own_records
from validate.recording.mcap.streams import fill, not_ours, ours, stream_of
from validate.recording.mcap.third_party_channels import fill as fill_foreign
from validate.recording.mcap.third_party_channels import found_streams, gatherers
from validate.recording.mcap.write import replacing
from validate.recording.reader import (
    M_PER_PX,
    UNIT,
    WHITE,
    MapOption,
    Options,
    Reader,
    head,
    metres,
)
from validate.recording.scales import in_unit
from validate.recording.types import Recording, by_kind, clock_of


def read_recording(path: Path) -> Recording:
    """Return the recording in an MCAP file; t = 0 is the earliest sample of all its streams.

    A measurement's time is the stamp in its message, else its publish time, never log time.
    Raises `RecordingError` for a file that is damaged (with the byte), contradicts itself, holds
    no topic of ours, or whose samples are out of order or change their unit, frame or names.
    """
    with opened(path) as stream:
        verified = verify(stream, path)
        try:
            # The channels of ours, one a topic; a wrong count of messages is refused.
            by_id = ours(verified)
            if not by_id:
                schemas = sorted({s.name for s in verified.schemas.values()})
                raise RecordingError(
                    "no topic with markers, signals or contours, nor calibrated images; "
                    f"schemas found: {schemas}; see `validate inspect`"
                )
            topics = Counter(c.channel.topic for c in by_id.values())
            twice = sorted(topic for topic, n in topics.items() if n > 1)
            if twice:
                raise RecordingError(
                    f"topics on two channels: {twice}; the order of their samples is not known"
                )
            if verified.claimed_messages not in (None, verified.messages):
                raise RecordingError(
                    f"its statistics claim {verified.claimed_messages} messages, it has "
                    f"{verified.messages}; see `validate inspect`"
                )

            fill(by_id, messages_of(stream, verified, by_id.keys()))
            collected = list(by_id.values())
            records = by_name(verified.metadata)
            name = name_of(records, path)
            t0 = min(int(raw.checked().times_ns.min()) for raw in collected)
            streams = {raw.channel.topic: stream_of(raw, t0, records) for raw in collected}
            clock = {
                raw.channel.topic: clock_of(
                    raw.channel.topic, raw.stamps_ns, raw.publish_ns, raw.log_ns
                )
                for raw in collected
            }
            unread = not_ours(verified)
            found = Recording(
                name, verified.source, t0, **by_kind(streams), clock=clock, unread=unread
            )
            own = own_records(found)
            return replace(found, metadata={n: r for n, r in records.items() if n not in own})
        except RecordingError as error:
            raise RecordingError(f"{path.name}: {error}") from None


def read_all(path: Path, options: Options) -> Recording:
    """Return the recording in an MCAP file of anybody: streams of ours, and messages of others that
    mean something (`known_messages`), as one.

    Options: `m_per_px` of images without a scale, `/topic.field=UNIT` for a number in messages of
    other types, `unit` of markers and outlines that were wrongly declared in m. Raises as
    `read_recording`, `UsageError` for a wrong option, and `RecordingError` where nothing is a
    stream.
    """
    factor, _ = metres(options, "m", path.name)
    others = {key: value for key, value in options.items() if key != "unit"}
    with opened(path) as stream:
        verified = verify(stream, path)
        gathered, never = gatherers(verified, others)
        try:
            fill_foreign(gathered, messages_of(stream, verified, gathered.keys()))
            found = found_streams(gathered, others)
        except RecordingError as error:
            raise RecordingError(f"{path.name}: {error}") from None
    never = {**never, **found.never}
    own = read_recording(path) if ours(verified) else None
    if own is None and not found.make:
        why = "; ".join(f"{topic}: {reason}" for topic, reason in never.items())
        raise RecordingError(
            f"{path.name}: none of its messages can be read as a stream; {why or 'empty'}"
        )
    # Own and foreign streams on one clock.
    begins = [int(ns[0]) for ns in found.ns.values()] + ([own.t0_ns] if own else [])
    t0 = min(begins)
    streams = {topic: make(t0) for topic, make in found.make.items()}
    if own is None:
        header = verified.header
        told = {**found.told, "library": header.library, "profile": header.profile}
        records = {**by_name(verified.metadata), "provenance": told}
        whole = Recording(path.stem, verified.source, t0, **by_kind(streams), clock=found.clocks,
                          metadata=records, unread=never)  # fmt: skip
    else:
        own = moved(own, (own.t0_ns - t0) / 1e9)
        whole = replace(
            own, t0_ns=t0, **by_kind({**own.streams, **streams}),
            clock={**own.clock, **found.clocks}, unread=never,
        )  # fmt: skip
    return whole if factor == 1 else in_unit(whole, options["unit"], factor)


OPTIONS = (
    M_PER_PX,
    WHITE,
    replace(UNIT, doc="unit of markers and outlines that are wrongly declared in m", default="m"),
    MapOption("TOPIC.FIELD", "unit of a number in messages of any type: makes it a stream"),
)

MCAP = Reader(
    "mcap",
    "an MCAP file",
    lambda path: head(path, len(MAGIC)) == MAGIC,
    read_all,
    "its first 8 bytes are MCAP's",
    largest=ANY_SIZE,  # read piece by piece
    options=OPTIONS,
    extensions=(".mcap",),
)


RECORD = "validate.recovered"
_BLOCK = 2**20  # bytes copied at once


@dataclass(frozen=True)
class Recovered:
    """What was saved, by topic how many messages, and the lines that say so and what is missing."""

    counts: dict[str, int]
    lines: tuple[str, ...]


def recover(path: Path, out: Path) -> Recovered:
    """Write what of the MCAP file `path` is whole to `out`; `path` is left as it is.

    Raises `UsageError` for a file that is whole or for `out` being the file itself, and
    `RecordingError` for one that is damaged otherwise, holds no whole message, or cannot be
    written.
    """
    if out.resolve() == path.resolve():
        raise UsageError(f"{out}: this is the file to recover; name another output")
    with opened(path) as stream:
        verified = verify(stream, path, cut=True)
        if verified.cut is None:
            raise UsageError(f"{path.name}: the file is complete; import it without --recover")
        if not verified.messages:
            raise RecordingError(f"{path.name}: no complete message before byte {verified.cut.at}")
        log = [ns for ns in verified.log_ns.values() if len(ns)]
        first, last = min(int(ns.min()) for ns in log), max(int(ns.max()) for ns in log)
        source = verified.source
        # What the bytes after the whole part still tell.
        cut, size = verified.cut, source.bytes
        after = "how many messages followed is not known"
        if cut.ended:
            missing = f"no message: only the summary is truncated, at byte {cut.at}"
        elif cut.at == size:
            missing = f"the end of the data after byte {cut.at}; {after}"
        else:
            stream.seek(cut.at)
            head = stream.read(HEAD.size + 16)
            missing = f"{size - cut.at} bytes of a cut record at byte {cut.at}"
            if len(head) == HEAD.size + 16 and head[0] == Op.CHUNK:
                declared = HEAD.unpack_from(head)[1]
                start, end = (int.from_bytes(head[k : k + 8], "little") for k in (9, 17))
                missing += (
                    f", a chunk of {declared} bytes with log times {start} ns to {end} ns, up to "
                    f"{(end - last) / 1e9:.6f} s after the last saved message"
                )
            missing = f"{missing}; {after}"
        told = {
            "from": f"{source.path}, sha256 {source.sha256}",
            "saved": f"{verified.messages} messages, {(last - first) / 1e9:.6f} s from {first} ns "
            f"to {last} ns, the first {cut.data} of {size} bytes",
            "missing": missing,
        }
        with replacing(out) as target:
            pairs = b"".join(_text(text) for pair in told.items() for text in pair)
            content = _text(RECORD) + len(pairs).to_bytes(4, "little") + pairs
            _copy(stream, target, cut, HEAD.pack(Op.METADATA, len(content)) + content)
    counts = {c.topic: len(verified.log_ns[n]) for n, c in verified.channels.items()}
    return Recovered(counts, tuple(f"{key}: {value}" for key, value in told.items()))


def _text(text: str) -> bytes:
    raw = text.encode()
    return len(raw).to_bytes(4, "little") + raw


def _copy(stream: BinaryIO, target: BinaryIO, cut: Cut, record: bytes) -> None:
    stream.seek(0)
    left = cut.data
    while left:
        block = stream.read(min(left, _BLOCK))
        if not block:
            raise RecordingError(f"the file became shorter while it was read, by {left} bytes")
        target.write(block)
        left -= len(block)
    crc = zlib.crc32(record, cut.crc)
    target.write(record + HEAD.pack(Op.DATA_END, 4) + crc.to_bytes(4, "little"))
    footer = HEAD.pack(Op.FOOTER, 20) + bytes(16)
    target.write(footer + zlib.crc32(footer).to_bytes(4, "little") + MAGIC)
