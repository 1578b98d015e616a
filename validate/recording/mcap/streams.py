"""Streams from verified messages: decoding, common clock, constant names and units.

A stream is what one channel of ours holds. Everything that would have to be guessed is refused:
samples out of order, a unit, frame, spread or set of names that changes on the way, stamps in some
messages only. Markers whose names are the same in another order are put in the first message's.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.recording.mcap.decoders import decoder_of
from validate.recording.mcap.records import Channel, Message, Schema, Verified
from validate.recording.mcap.schemas import (
    CALIBRATION,
    CONTOUR,
    FOUND_IN,
    IMAGE,
    JSON_SCHEMA,
    MARKERS,
    MIRROR_OF,
    POSE,
    PROTOBUF,
    SIGNAL,
    Parse,
    Sample,
    decode,
    parse_json,
    pose_of,
    scale_of,
)
from validate.recording.types import Contours, Frames, Markers, Record, Signal, Stream

OURS = (MARKERS, SIGNAL, CONTOUR)
MAX_NUMBERS = 50_000_000  # decoded numbers of one file: 400 MB


@dataclass
class Collected:
    """The samples of one channel while they are read; `error` is the first that was wrong."""

    channel: Channel
    schema: str
    publish_ns: Ints
    log_ns: Ints
    samples: list[Sample] = field(default_factory=list)
    error: str = ""
    parse: Parse = parse_json

    def add(self, message: Message) -> int:
        """Decode and keep one message; returns how many numbers it held."""
        if self.error:
            return 0
        try:
            self.samples.append(decode(self.schema, message.data, self.parse))
        except RecordingError as error:
            self.error = f"{self.channel.topic!r} message {len(self.samples)}: {error}"
            return 0
        return self.samples[-1].size

    def checked(self) -> "Collected":
        """Itself; raises `RecordingError` when a message was wrong or there is none."""
        if self.error:
            raise RecordingError(self.error)
        if not self.samples:
            raise RecordingError(f"{self.channel.topic!r}: zero messages")
        return self

    @property
    def stamps_ns(self) -> Ints | None:
        """int64 ns (n,), None when no message has a stamp; mixtures raise `RecordingError`."""
        stamps = [s.stamp_ns for s in self.samples if s.stamp_ns is not None]
        if not stamps:
            return None
        require_all_stamped(self.channel.topic, len(stamps), len(self.samples))
        return np.array(stamps, dtype=np.int64)

    @property
    def times_ns(self) -> Ints:
        """When the samples were measured: stamps, else publish times; int64 ns (n,)."""
        stamps = self.stamps_ns
        return self.publish_ns if stamps is None else stamps


def ours(verified: Verified) -> dict[int, Collected]:
    """Return an empty collector for every channel with a schema of ours, and of images
    calibrated."""
    found: dict[int, Collected] = {}
    for number, (channel, schema) in our_channels(verified).items():
        log, publish = verified.log_ns[number], verified.publish_ns[number]
        parse, error = parser_of(channel, schema)
        found[number] = Collected(channel, schema.name, publish, log, error=error, parse=parse)
    return found


def our_channels(verified: Verified) -> dict[int, tuple[Channel, Schema]]:
    """Return the channels that are streams of ours, by number."""
    records = {record.name for record in verified.metadata}
    all_ = {n: (c, verified.schemas.get(c.schema_id)) for n, c in verified.channels.items()}
    return {n: (c, s) for n, (c, s) in all_.items() if s is not None and is_ours(c, s, records)}


def is_ours(channel: Channel, schema: Schema | None, records: Set[str]) -> bool:
    """Return whether a channel has a schema of ours, or images whose calibration is in
    `records`."""
    if schema is None:
        return False
    calibrated = schema.name == IMAGE and CALIBRATION + channel.topic in records
    return schema.name in OURS or calibrated


def parser_of(channel: Channel, schema: Schema) -> tuple[Parse, str]:
    """What parses the messages of a channel of ours, and what is wrong with it; "" for nothing."""
    encodings = f"{schema.encoding}/{channel.encoding}"
    if encodings == f"{JSON_SCHEMA}/json":
        return parse_json, ""
    if encodings == f"{PROTOBUF}/protobuf":
        found = decoder_of(schema, channel)
        if isinstance(found, str):
            return parse_json, f"{channel.topic!r}: {found}"

        # A list of no z is what JSON writes as null: points in a plane.
        def parsed(data: bytes) -> dict[str, Any]:
            message = found(data)
            return {**message, "z": message.get("z") or None}

        return parsed, ""
    return parse_json, (
        f"{channel.topic!r}: {schema.name} in '{encodings}', expected '{JSON_SCHEMA}/json' or "
        f"'{PROTOBUF}/protobuf'"
    )


def not_ours(verified: Verified) -> dict[str, str]:
    """Return the topics that are no stream, but for mirrors of one, and why."""
    ours_by_topic = {c.channel.topic for c in ours(verified).values()}
    found: dict[str, str] = {}
    for channel in verified.channels.values():
        if channel.topic in ours_by_topic or MIRROR_OF in channel.metadata:
            continue
        schema = verified.schemas.get(channel.schema_id)
        name = schema.name if schema else "no schema"
        found[channel.topic] = (
            f"images without a record '{CALIBRATION}{channel.topic}' of their pixels' size"
            if name == IMAGE
            else f"its messages are not read ({name})"
        )
    return found


def fill(collected: dict[int, Collected], messages: Iterable[Message]) -> None:
    """Decode `messages` into their collectors; raises `RecordingError` over `MAX_NUMBERS`."""
    total = 0
    for message in messages:
        total += collected[message.channel_id].add(message)
        if total > MAX_NUMBERS:
            raise RecordingError(f"more than {MAX_NUMBERS} numbers, the limit; split the file")


def stream_of(raw: Collected, t0_ns: int, records: Mapping[str, Record]) -> Stream:
    """Return the stream of one channel of ours, times from `t0_ns`; `records` hold poses and
    scales.

    Raises `RecordingError`, with the topic, for samples that do not make one stream.
    """
    topic, first = raw.channel.topic, raw.samples[0]
    require_forward(topic, raw.times_ns, t0_ns)
    t: Floats = (raw.times_ns - t0_ns) / 1e9
    frame, sd = _constant(raw, "frame"), _constant(raw, "sd")
    if raw.schema == MARKERS:
        x = np.stack([in_order(topic, i, s, first) for i, s in enumerate(raw.samples)])
        return _named(topic, lambda: Markers(t, first.names, x, sd, frame))
    if raw.schema == SIGNAL:
        unit = _constant(raw, "unit")
        y = np.stack([like_first(topic, i, s, first) for i, s in enumerate(raw.samples)])
        return _named(topic, lambda: Signal(t, y, unit, sd, frame))
    pose = pose_of(records, topic)
    if raw.schema == CONTOUR:
        outlines = tuple(s.values for s in raw.samples)
        found_in = records[POSE + topic].get(FOUND_IN, "")
        each = own_of(topic, raw.samples)
        return _named(topic, lambda: Contours(t, outlines, sd, pose, frame, found_in, each))
    images = tuple(s.image for s in raw.samples if s.image is not None)
    scale = scale_of(records, topic)
    return _named(topic, lambda: Frames(t, images, scale, pose, frame))


def own_of(topic: str, samples: Sequence[Sample]) -> Floats | None:
    """Return the own sd and confidence (nt, 2) of outlines; None where none has them.

    Raises `RecordingError` where only some have.
    """
    told = [s.each for s in samples if s.each is not None]
    if told and len(told) != len(samples):
        raise RecordingError(
            f"{topic!r}: only some outlines have an sd and a confidence; give them for all or none"
        )
    return np.array(told) if told else None


def _named(topic: str, make: Callable[[], Stream]) -> Stream:
    try:
        return make()
    except RecordingError as error:
        raise RecordingError(f"{topic!r}: {error}") from None


def require_all_stamped(topic: str, stamped: int, messages: int) -> None:
    """Raise `RecordingError` where only some messages have a stamp."""
    if stamped != messages:
        raise RecordingError(
            f"{topic!r}: {stamped} of {messages} messages have a stamp; stamp all or none"
        )


def require_forward(topic: str, ns: Ints, t0_ns: int) -> None:
    """Raise `RecordingError` where times (n,) ns run backward; the error has s from `t0_ns`."""
    backward = np.flatnonzero(np.diff(ns) < 0)
    if len(backward):
        i = int(backward[0]) + 1
        before, after = ((int(ns[k]) - t0_ns) / 1e9 for k in (i - 1, i))
        raise RecordingError(
            f"{topic!r}: time runs backward at sample {i} "
            f"({before:.9f} s -> {after:.9f} s), {len(backward)} times in all; "
            "write the messages in order of their stamps"
        )


def _constant(raw: Collected, what: str) -> Any:
    """The value that the field `what` has in every sample."""
    for i, sample in enumerate(raw.samples):
        require_same(raw.channel.topic, what, i, sample, raw.samples[0])
    return getattr(raw.samples[0], what)


def require_same(topic: str, what: str, i: int, sample: Sample, first: Sample) -> None:
    """Raise `RecordingError` where the field `what` of sample i is not the first's."""
    want, got = getattr(first, what), getattr(sample, what)
    if got != want:
        raise RecordingError(f"{topic!r}: {what} changes at message {i}, {want!r} -> {got!r}")


def in_order(topic: str, i: int, sample: Sample, first: Sample) -> Floats:
    """Values of sample i of markers with its points in the order of the first sample's names.

    Raises `RecordingError` where a name or the number of axes changes.
    """
    same_points = sample.values.shape[0] == first.values.shape[0]  # else the names say which
    values = like_first(topic, i, sample, first) if same_points else sample.values
    names = sample.names
    if names == first.names:
        return values
    if sorted(names) != sorted(first.names):
        differ = sorted(set(names) ^ set(first.names))
        raise RecordingError(
            f"{topic!r}: names change at message {i}, not in both: {differ}; write null for a "
            f"missing point"
        )
    place = {name: k for k, name in enumerate(names)}
    return values[[place[name] for name in first.names]]


def like_first(topic: str, i: int, sample: Sample, first: Sample) -> Floats:
    """Values of sample i; raises `RecordingError` where their shape is not the first's."""
    got, want = sample.values, first.values
    if got.shape != want.shape:
        raise RecordingError(
            f"{topic!r}: message {i} holds {got.shape} numbers, the first {want.shape}"
        )
    return got
