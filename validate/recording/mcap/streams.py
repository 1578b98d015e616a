"""From verified messages to streams: decoding, one clock, names and units that stay.

A stream is what one channel of ours holds. Everything that would have to be guessed is refused:
samples out of order, a unit, frame, spread or set of names that changes on the way, stamps in some
messages only. Markers whose names are the same in another order are put in the first message's.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.recording.mcap.metadata import CALIBRATION, FOUND_IN, POSE, pose_of, scale_of
from validate.recording.mcap.records import Channel, Message
from validate.recording.mcap.schemas import (
    CONTOUR,
    IMAGE,
    MARKERS,
    MESSAGE_ENCODING,
    MIRROR_OF,
    SCHEMA_ENCODING,
    SIGNAL,
    Sample,
    decode,
)
from validate.recording.mcap.verified import Verified
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

    def add(self, message: Message) -> int:
        """Decode and keep one message; returns how many numbers it held."""
        if self.error:
            return 0
        try:
            self.samples.append(decode(self.schema, message.data))
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
        if len(stamps) != len(self.samples):
            raise RecordingError(
                f"{self.channel.topic!r}: {len(stamps)} of {len(self.samples)} messages are "
                "stamped; stamp all or none"
            )
        return np.array(stamps, dtype=np.int64)

    @property
    def times_ns(self) -> Ints:
        """When the samples were measured: stamps, else publish times; int64 ns (n,)."""
        stamps = self.stamps_ns
        return self.publish_ns if stamps is None else stamps


def ours(verified: Verified) -> dict[int, Collected]:
    """An empty collector for every channel with a schema of ours, and of images calibrated."""
    found: dict[int, Collected] = {}
    records = {record.name for record in verified.metadata}
    for number, channel in verified.channels.items():
        schema = verified.schemas.get(channel.schema_id)
        if schema is None:
            continue
        calibrated = schema.name == IMAGE and CALIBRATION + channel.topic in records
        if schema.name in OURS or calibrated:
            log, publish = verified.log_ns[number], verified.publish_ns[number]
            found[number] = Collected(channel, schema.name, publish, log)
            if (schema.encoding, channel.encoding) != (SCHEMA_ENCODING, MESSAGE_ENCODING):
                encodings = f"{schema.encoding}/{channel.encoding}"
                found[number].error = (
                    f"{channel.topic!r}: {schema.name} in {encodings!r}, "
                    f"expected '{SCHEMA_ENCODING}/{MESSAGE_ENCODING}'"
                )
    return found


def not_ours(verified: Verified) -> dict[str, str]:
    """The topics that are no stream, but for mirrors of one, and why."""
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
    """The stream of one channel of ours, times from `t0_ns`; `records` hold poses and scales.

    Raises `RecordingError`, with the topic, for samples that do not make one stream.
    """
    topic, first = raw.channel.topic, raw.samples[0]
    t, frame, sd = _times(raw, t0_ns), _constant(raw, "frame"), _constant(raw, "sd")
    if raw.schema == MARKERS:
        x = np.stack([_in_order(raw, i, first) for i in range(len(raw.samples))])
        return _named(topic, lambda: Markers(t, first.names, x, sd, frame))
    if raw.schema == SIGNAL:
        unit = _constant(raw, "unit")
        y = np.stack([_like_first(raw, i) for i in range(len(raw.samples))])
        return _named(topic, lambda: Signal(t, y, unit, sd, frame))
    pose = pose_of(records, topic)
    if raw.schema == CONTOUR:
        outlines = tuple(s.values for s in raw.samples)
        found_in = records[POSE + topic].get(FOUND_IN, "")
        return _named(topic, lambda: Contours(t, outlines, sd, pose, frame, found_in))
    images = tuple(s.image for s in raw.samples if s.image is not None)
    scale = scale_of(records, topic)
    return _named(topic, lambda: Frames(t, images, scale, pose, frame))


def _named(topic: str, make: Callable[[], Stream]) -> Stream:
    try:
        return make()
    except RecordingError as error:
        raise RecordingError(f"{topic!r}: {error}") from None


def _times(raw: Collected, t0_ns: int) -> Floats:
    ns = raw.times_ns
    t: Floats = (ns - t0_ns) / 1e9
    backward = np.flatnonzero(np.diff(ns) < 0)
    if len(backward):
        i = int(backward[0]) + 1
        raise RecordingError(
            f"{raw.channel.topic!r}: time runs backward at sample {i} "
            f"({t[i - 1]:.9f} s -> {t[i]:.9f} s), {len(backward)} times in all; "
            "write the messages in order of their stamps"
        )
    return t


def _constant(raw: Collected, what: str) -> Any:
    """The value that the field `what` has in every sample."""
    values = [getattr(sample, what) for sample in raw.samples]
    for i, value in enumerate(values):
        if value != values[0]:
            raise RecordingError(
                f"{raw.channel.topic!r}: {what} changes at message {i}, {values[0]!r} -> {value!r}"
            )
    return values[0]


def _in_order(raw: Collected, i: int, first: Sample) -> Floats:
    """Sample i with its points in the order of the first sample's names."""
    values, names = _like_first(raw, i), raw.samples[i].names
    if names == first.names:
        return values
    if sorted(names) != sorted(first.names):
        differ = sorted(set(names) ^ set(first.names))
        raise RecordingError(
            f"{raw.channel.topic!r}: names change at message {i}, not in both: {differ}; "
            "write null for a point that is not seen"
        )
    place = {name: k for k, name in enumerate(names)}
    return values[[place[name] for name in first.names]]


def _like_first(raw: Collected, i: int) -> Floats:
    got, want = raw.samples[i].values, raw.samples[0].values
    if raw.schema == MARKERS and got.shape[0] != want.shape[0]:
        return got  # the names say which point came or went
    if got.shape != want.shape:
        raise RecordingError(
            f"{raw.channel.topic!r}: message {i} holds {got.shape} numbers, the first {want.shape}"
        )
    return got
