"""Pre-flight check of a file of any format: its content and its faults.

An MCAP file is inspected as it is; one of another format by what its reader makes of it.

Encodings of others are listed, not decoded. Every defect is one line in `Inspection.defects`, and
so is a file that stops short, as if its writer was ended; only other damage is a `RecordingError`.
"""

from collections import Counter
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Ints
from validate.errors import RecordingError, UsageError
from validate.recording.clocks.alignment import RECORD as CLOCK_OFFSET
from validate.recording.mcap.channel_state import AllSeen, ChannelSeen
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.read import MCAP, read_recording
from validate.recording.mcap.records import Channel, Verified, messages_of, opened
from validate.recording.mcap.schemas import (
    CALIBRATION,
    CONTOUR,
    IMAGE,
    MARKERS,
    MIRROR,
    MIRROR_OF,
    SIGNAL,
    by_name,
)
from validate.recording.mcap.streams import our_channels
from validate.recording.motion_capture.poses import ROTATION, chain_faults
from validate.recording.motion_capture.text_rows import ASSUMED, cut_lines
from validate.recording.reader import Options, require_known, source_of
from validate.recording.readers import named, no_mcap, recognised
from validate.recording.scales import odd_stream
from validate.recording.types import GAP_FACTOR, Clock, Frames, Recording, Signal, Source, clock_of

# What rosbag2 always writes is no defect: this record for every split, channels without messages.
_ROS2, _OFTEN = "ros2", "rosbag2"
DISAGREEMENT = 0.010  # s; larger differences between stamp, publish and log time are defects
_KINDS = {MARKERS: "markers", SIGNAL: "signal", CONTOUR: "contours", IMAGE: "frames"}


@dataclass(frozen=True)
class Topic:
    """One channel: kind is markers, signal, contours, frames, mirror or foreign.

    first_ns and last_ns are the earliest and latest time of measurement, None: empty; `unit` is
    empty where the schema says none. `clock` holds rate, gaps and duplicates.
    """

    name: str
    kind: str
    schema: str
    schema_encoding: str
    message_encoding: str
    count: int
    first_ns: int | None
    last_ns: int | None
    unit: str
    frame: str
    clock: Clock | None


@dataclass(frozen=True)
class Inspection:
    """Inspection of a file: counts, topics in order of their channels, defects in one line each."""

    source: Source
    profile: str
    library: str
    compressions: tuple[str, ...]
    chunks: int
    messages: int
    attachments: int
    metadata: tuple[str, ...]
    topics: tuple[Topic, ...]
    defects: tuple[str, ...]
    clock_offsets: tuple[str, ...] = ()  # streams that were moved, one line each
    read_as: str = "mcap"
    facts: tuple[str, ...] = ()  # what its reader assumed, noted and still needs, a line each

    def to_dict(self) -> dict[str, Any]:
        """Plain dicts, lists, texts and finite numbers for JSON; None where nothing is known."""
        plain = asdict(self)
        for name in ("compressions", "metadata", "topics", "defects", "clock_offsets", "facts"):
            plain[name] = list(plain[name])
        return plain

    @classmethod
    def of(cls, path: Path | str) -> "Inspection":
        """Inspect any MCAP file; raises `RecordingError` for one that is damaged or no MCAP.

        A file that stops short is inspected as far as it is whole.

        The error counts the chunks and messages that can be read before the damage.
        """
        path = Path(path)
        seen = AllSeen()
        with opened(path) as stream:
            try:
                verified = verify(stream, path, seen, cut=True)
            except RecordingError as error:
                raise no_mcap(path, error) from None
            # Channels without messages, and images whose calibration came after them.
            late = {n: c for n, c in our_channels(verified).items() if n not in seen.channels}
            seen.channels.update(
                {n: ChannelSeen(channel, schema) for n, (channel, schema) in late.items()}
            )
            for message in messages_of(stream, verified, late.keys()):
                seen.take(message.channel_id, [message.data])
        found: list[str] = []
        if (cut := verified.cut) is not None:
            what = "the file, behind its data," if cut.ended else "the data section"
            found.append(
                f"no end of {what}: complete up to byte {cut.at} of {verified.source.bytes}, "
                f"{verified.messages} messages; the writer was stopped; save them with `validate "
                f"import {verified.source.path} --recover -o X.mcap`"
            )
        if verified.claimed_messages not in (None, verified.messages):
            found.append(
                f"statistics claim {verified.claimed_messages} messages, {verified.messages} found"
            )
        if verified.misindexed:
            found.append(f"{verified.misindexed} chunks are indexed wrongly or not at all")
        if verified.unknown_records:
            found.append(f"{verified.unknown_records} records of unknown kind")
        often = Counter(c.topic for c in verified.channels.values())
        found += [f"{topic!r} is on {n} channels" for topic, n in often.items() if n > 1]
        for number, channel in verified.channels.items():
            schema = verified.schemas.get(channel.schema_id)
            if schema is not None and schema.name == IMAGE and number not in our_channels(verified):
                found.append(
                    f"{channel.topic!r}: images without record '{CALIBRATION}{channel.topic}'"
                )
        names = Counter(m.name for m in verified.metadata if m.name != _OFTEN)
        found += [f"metadata {name!r} occurs {n} times" for name, n in names.items() if n > 1]
        if seen.limit:
            found.append(seen.limit)
        topics = [
            _topic(verified, n, c, seen.channels.get(n)) for n, c in verified.channels.items()
        ]
        # What contradicts of the poses, which are read once more for it.
        if any(c.topic.endswith(f"/{ROTATION}") for c in verified.channels.values()):
            with suppress(RecordingError):  # reported where the stream was inspected
                found += list(chain_faults(read_recording(path)))
        return _inspection(verified, topics, found)


def inspect_file(path: Path, kind: str | None, options: Options) -> Inspection:
    """Inspect a file of any format, of the `kind` that it shows where none is said.

    `options` is what the file does not say itself. Raises as its reader does.
    """
    reader = named(kind) if kind else recognised(path)
    if reader is MCAP:
        require_known(options, ())
        return Inspection.of(path)
    try:
        recording = reader.read(path, options)
    except UsageError as asks:
        if options or reader.holds is None:
            raise
        # The contents of a file that cannot be read before the user says more of it.
        held = reader.holds(path)
        return Inspection(
            source=source_of(path, "not checked"),
            profile="",
            library="",
            compressions=(),
            chunks=0,
            messages=0,
            attachments=0,
            metadata=(),
            topics=tuple(_unread_topic(name, what) for name, what in held.items()),
            defects=(),
            facts=(f"still needed: {asks!s}",),
            read_as=f"{reader.name} ({reader.doc}), because {reader.sign}",
        )
    topics = [_stream_topic(name, recording) for name in recording.streams]
    never = [_unread_topic(name, why) for name, why in recording.unread.items()]
    facts = [f"{k}: {v}" for r in recording.metadata.values() for k, v in r.items() if v]
    return Inspection(
        source=recording.source,
        profile="", library="", compressions=(), chunks=0,
        messages=sum(topic.count for topic, _ in topics),
        attachments=0,
        metadata=tuple(recording.metadata),
        topics=(*(topic for topic, _ in topics), *never),
        defects=(
            *cut_lines(recording.metadata.values()),
            *(line for _, found in topics for line in found),
            *chain_faults(recording),
        ),
        read_as=f"{reader.name} ({reader.doc}), because {reader.sign}",
        facts=tuple(facts),
    )  # fmt: skip


def _stream_topic(name: str, recording: Recording) -> tuple[Topic, list[str]]:
    stream = recording.streams[name]
    ns = np.rint(1e9 * stream.t).astype(np.int64) + recording.t0_ns
    # A reader may leave its streams' clocks out: then their times are all that is known.
    clock = recording.clock.get(name) or clock_of(name, None, ns, ns)
    unit = stream.unit if isinstance(stream, Signal) else "m"
    topic = Topic(
        name, type(stream).__name__.lower(), "", "", "", len(stream.t), int(ns[0]), int(ns[-1]),
        "grey level" if isinstance(stream, Frames) else unit, stream.frame, clock,
    )  # fmt: skip
    odd = odd_stream(stream)
    found = [f"{name!r}: {odd}"] if odd else []
    return topic, [*found, *_clock_defects(name, clock, ns)]


def _unread_topic(name: str, why: str) -> Topic:
    return Topic(name, f"not read: {why}", "", "", "", 0, None, None, "", "", None)


def _inspection(
    verified: Verified, topics: list[tuple[Topic, list[str]]], defects: list[str]
) -> Inspection:
    return Inspection(
        source=verified.source,
        profile=verified.header.profile,
        library=verified.header.library,
        compressions=verified.compressions,
        chunks=verified.chunks,
        messages=verified.messages,
        attachments=len(verified.attachments),
        metadata=tuple(record.name for record in verified.metadata),
        topics=tuple(topic for topic, _ in topics),
        defects=(*defects, *(line for _, found in topics for line in found)),
        clock_offsets=tuple(  # nothing is moved without being shown
            f"{record.name}: {', '.join(f'{key} {value}' for key, value in record.values.items())}"
            for record in verified.metadata
            if record.name.startswith(CLOCK_OFFSET)
        ),
        facts=(
            *(  # what was assumed in reading the file that a recording was made of
                f"{key}: {text}"
                for record in verified.metadata
                if record.name.split("/")[0] == ASSUMED
                for key, text in record.values.items()
            ),
            *(
                f"attachment {a.name}: {a.media_type or 'no media type'}, {a.size} bytes"
                for a in verified.attachments
            ),
        ),
    )


def _topic(
    verified: Verified, number: int, channel: Channel, seen: ChannelSeen | None
) -> tuple[Topic, list[str]]:
    schema = verified.schemas.get(channel.schema_id)
    log, publish = verified.log_ns[number], verified.publish_ns[number]
    # Stamps of a channel of ours where all its messages can be read, and what is wrong in them.
    stamps: Ints | None = None
    defects = []
    if seen is not None and len(publish):
        try:
            read_ns = seen.stamps_ns()
            # One that stopped at a limit has none: the file's defects name the limit.
            if seen.count == len(publish):
                stamps = read_ns
                stream = seen.stream(
                    publish if stamps is None else stamps, by_name(verified.metadata)
                )
                if odd := odd_stream(stream):
                    defects = [f"{channel.topic!r}: {odd}"]
        except RecordingError as error:
            defects = [str(error)]
    times = publish if stamps is None else stamps
    clock = clock_of(channel.topic, stamps, publish, log) if len(publish) else None
    first = seen.first if seen else None
    name = schema.name if schema else ""
    kind = "foreign" if seen is None else _KINDS.get(name, "foreign")
    if name == MIRROR and MIRROR_OF in channel.metadata:
        kind = "mirror"
    topic = Topic(
        name=channel.topic,
        kind=kind,
        schema=name,
        schema_encoding=schema.encoding if schema else "",
        message_encoding=channel.encoding,
        count=len(publish),
        first_ns=int(times.min()) if len(times) else None,
        last_ns=int(times.max()) if len(times) else None,
        unit={SIGNAL: first.unit, IMAGE: "grey level"}.get(name, "m") if schema and first else "",
        frame=first.frame if first else "",
        clock=clock,
    )
    silent = clock is None and verified.header.profile == _ROS2  # it declares what it could record
    return topic, [*defects, *([] if silent else _clock_defects(channel.topic, clock, log))]


def _clock_defects(topic: str, clock: Clock | None, log_ns: Ints) -> list[str]:
    if clock is None:
        return [f"{topic!r}: no messages"]
    log_backward = int((np.diff(log_ns) < 0).sum())
    stamp = clock.stamp_minus_publish
    lines = {
        f"{clock.gaps} gaps over {GAP_FACTOR:g} x the median step, longest "
        f"{clock.longest_gap:.6f} s": clock.gaps,
        f"{clock.duplicates} samples repeat the time before them": clock.duplicates,
        f"time runs backward {clock.backward} times": clock.backward,
        f"log time runs backward {log_backward} times": log_backward,
        f"stamp and publish time differ by up to {stamp or 0:.6f} s": (stamp or 0) > DISAGREEMENT,
        f"publish and log time differ by up to {clock.publish_minus_log:.6f} s": (
            clock.publish_minus_log > DISAGREEMENT
        ),
    }
    return [f"{topic!r}: {line}" for line, true in lines.items() if true]
