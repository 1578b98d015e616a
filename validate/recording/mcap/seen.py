"""What the messages of a channel of ours hold, kept while they pass: a state, not the samples.

Whole batches that are like the first message are taken at once (`batches`), others one by one; so
a recording of any length is inspected in the memory of its time stamps, and what is wrong with it
is told in the words that reading it whole would use.
"""

from array import array
from collections.abc import Callable, Mapping, Sequence, Set

import numpy as np

from validate.arrays import Ints
from validate.errors import RecordingError
from validate.recording.mcap import streams
from validate.recording.mcap.batches import Alike, batch
from validate.recording.mcap.metadata import pose_of, scale_of
from validate.recording.mcap.pictures import pictures
from validate.recording.mcap.records import Channel, Schema
from validate.recording.mcap.schemas import CONTOUR, IMAGE, MARKERS, SIGNAL, Sample, decode
from validate.recording.mcap.streams import (
    Collected,
    in_order,
    is_ours,
    like_first,
    own_of,
    parser_of,
    require_all_stamped,
    require_forward,
    require_same,
    stream_of,
)
from validate.recording.types import Record, Stream

_TOGETHER = 256  # messages parsed at once: more leave the processor's cache
_PICTURES = 16  # images looked at at once


class ChannelSeen:
    """One channel: its first sample, the stamps of all, and what is first found to differ."""

    def __init__(self, channel: Channel, schema: Schema) -> None:
        self.channel, self.schema = channel, schema.name
        # What reads a message, and the first that cannot be read.
        self.parse, self.error = parser_of(channel, schema)
        self.first: Sample | None = None
        self.count = self.numbers = 0
        self._stamps: array[int] = array("q")
        self._changes: dict[str, str] = {}
        self._shapes: set[tuple[int, ...]] = set()
        self._short: int | None = None  # the first outline without an inside
        self._largest: Sample | None = None

    def take(self, messages: Sequence[bytes]) -> None:
        """Look at messages that follow those before; nothing more once one was wrong."""
        if self.first is None:
            self._one_by_one(messages[:1])
            messages = messages[1:]
        if self.schema == IMAGE:
            self._take_pictures(messages)
            return
        for start in range(0, len(messages), _TOGETHER):
            part = messages[start : start + _TOGETHER]
            found = batch(self.schema, part) if self.first and not self.error else None
            if found is not None and self._like_first(found):
                self._stamps.frombytes(found.stamps_ns.tobytes())
                self.count += len(part)
                self.numbers += found.values.size
            else:
                self._one_by_one(part)

    def _take_pictures(self, messages: Sequence[bytes]) -> None:
        """Pictures like the first one are not unpacked; a run does that."""
        for start in range(0, len(messages), _PICTURES):
            part = messages[start : start + _PICTURES]
            found = pictures(part) if self.first and not self.error else None
            first = self.first.image if self.first else None
            if found and self.first and first is not None and (found.frame, found.shape) == (
                self.first.frame, first.shape
            ):  # fmt: skip
                self._stamps.frombytes(found.stamps_ns.tobytes())
                self.count += len(part)
                self.numbers += len(part) * self.first.size
            else:
                self._one_by_one(part)

    def _like_first(self, found: Alike) -> bool:
        first = self.first
        return (
            first is not None
            and (found.frame, found.sd, found.names, found.unit)
            == (first.frame, first.sd, first.names, first.unit)
            and found.values.shape[1:] == first.values.shape
        )

    def _one_by_one(self, messages: Sequence[bytes]) -> None:
        for data in messages:
            if self.error:
                return
            try:
                self._add(decode(self.schema, data, self.parse))
            except RecordingError as error:
                self.error = f"{self.channel.topic!r} message {self.count}: {error}"

    def _add(self, sample: Sample) -> None:
        first = self.first = self.first or sample
        topic, i = self.channel.topic, self.count
        for what in ("frame", "sd", "unit"):
            self._differs(what, lambda what=what: require_same(topic, what, i, sample, first))  # type: ignore[misc]
        if self.schema in (MARKERS, SIGNAL):
            like = in_order if self.schema == MARKERS else like_first
            self._differs("values", lambda: like(topic, i, sample, first))
        elif sample.image is not None:
            self._shapes.add(sample.image.shape)
        else:
            self._outline(sample)
        if sample.stamp_ns is not None:
            self._stamps.append(sample.stamp_ns)
        self.count += 1
        self.numbers += sample.size

    def _differs(self, what: str, check: Callable[[], object]) -> None:
        if what not in self._changes:
            try:
                check()
            except RecordingError as error:
                self._changes[what] = str(error)

    def _outline(self, sample: Sample) -> None:
        first = self.first or sample
        self._differs("each", lambda: own_of(self.channel.topic, [first, sample]))
        if len(sample.values) < 3 and self._short is None:
            self._short = self.count
        if self._largest is None or _extent(sample) > _extent(self._largest):
            self._largest = sample

    def stamps_ns(self) -> Ints | None:
        """int64 ns (n,), None when no message has a stamp.

        Raises `RecordingError` for a message that cannot be read, and for stamps in some only.
        """
        if self.error:
            raise RecordingError(self.error)
        if not self._stamps:
            return None
        require_all_stamped(self.channel.topic, len(self._stamps), self.count)
        return np.frombuffer(self._stamps, dtype=np.int64)

    def stream(self, times_ns: Ints, records: Mapping[str, Record]) -> Stream:
        """One sample of the stream that all would make, of outlines the largest.

        Raises `RecordingError` where they make none, as `streams.stream_of` does.
        """
        topic, t0 = self.channel.topic, int(times_ns.min())
        require_forward(topic, times_ns, t0)
        for what in ("frame", "sd", "unit", "values", "each"):
            if what in self._changes:
                raise RecordingError(self._changes[what])
        if self.schema in (CONTOUR, IMAGE):
            self._require_alike(records)
        sample = self._largest or self.first
        assert sample is not None  # a channel without messages is not asked
        at = times_ns[:1]
        return stream_of(Collected(self.channel, self.schema, at, at, [sample]), t0, records)

    def _require_alike(self, records: Mapping[str, Record]) -> None:
        topic = self.channel.topic
        pose_of(records, topic)
        if self._short is not None:
            raise RecordingError(
                f"{topic!r}: contours: outline {self._short} has fewer than 3 points"
            )
        if self.schema == IMAGE:
            scale_of(records, topic)
        if len(self._shapes) > 1:
            raise RecordingError(
                f"{topic!r}: frames: images of different sizes {sorted(self._shapes)}"
            )


class AllSeen:
    """The channels of ours of one file while it is checked; `limit` says where looking ended."""

    def __init__(self) -> None:
        self.channels: dict[int, ChannelSeen] = {}
        self.limit = ""

    def wants(self, channel: Channel, schema: Schema | None, records: Set[str]) -> bool:
        """Channels of ours; images only where their calibration precedes them."""
        if schema is None or not is_ours(channel, schema, records):
            return False
        self.channels[channel.id] = ChannelSeen(channel, schema)
        return True

    def take(self, channel: int, messages: list[bytes]) -> None:
        """Look at the messages of a channel, unless the numbers of all are too many."""
        if self.limit:
            return
        self.channels[channel].take(messages)
        if sum(seen.numbers for seen in self.channels.values()) > streams.MAX_NUMBERS:
            self.limit = f"more than {streams.MAX_NUMBERS} numbers, the limit; split the file"


def _extent(sample: Sample) -> float:
    return float(np.ptp(sample.values, axis=0).max(initial=0.0)) if len(sample.values) else 0.0
