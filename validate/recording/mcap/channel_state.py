"""State of a channel of this package's schema during decoding, without its samples.

Whole batches that are like the first message are taken at once (`batches`), others one by one; so
a recording of any length is inspected in the memory of its time stamps, and what is wrong with it
is told in the words that reading it whole would use.
"""

import base64
import re
from array import array
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np
import orjson

from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.recording.images.image import png_size
from validate.recording.mcap import streams
from validate.recording.mcap.records import Channel, Schema
from validate.recording.mcap.schemas import (
    CONTOUR,
    IMAGE,
    MARKERS,
    MAX_MESSAGE,
    SIGNAL,
    Json,
    Sample,
    decode,
    pose_of,
    scale_of,
)
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

# --- Many JSON messages of one channel at once: parsed together, judged by column.
#
# A batch is taken only where every message is what this package itself writes, and all of them
# are alike; what is not is `None`, and `schemas.decode` says of each message what is wrong. The
# messages are parsed as one JSON list with a mark between each two. The mark occurs nowhere else
# in the bytes, so where it stands at every second place, each message is one value by itself.
# Without a backslash each colon belongs to a key or to a text that was kept, so their count shows
# a field that occurs twice. `orjson` refuses NaN, infinity and numbers beyond float64, and rounds
# as `json` does.

_MARK = "|between|"
_NUMBER = {int, float}
_LAST_SECOND = 2**63 // 10**9


class _OddError(Exception):
    """Not what this package writes, or not all alike."""


@dataclass(frozen=True)
class Alike:
    """Messages that agree: stamps (n,) ns; values (n, ...) as of `schemas.Sample`."""

    stamps_ns: Ints
    frame: str
    sd: float
    names: tuple[str, ...]
    unit: str
    values: Floats


def batch(schema: str, messages: Sequence[bytes]) -> Alike | None:
    """Return the messages as one batch; None where one is odd, differs, or has another schema."""
    columns = {SIGNAL: _signals, MARKERS: _markers}.get(schema)
    if columns is None:
        return None
    try:
        # The messages as objects, and how many colons their bytes have.
        mark = f'"{_MARK}"'.encode()
        whole = (b"," + mark + b",").join(messages)
        _require(max(map(len, messages)) <= MAX_MESSAGE)
        _require(whole.count(mark) == len(messages) - 1)
        _require(b"\\" not in whole)
        values = orjson.loads(b"[" + whole + b"]")
        objects, marks = values[::2], values[1::2]
        _require(len(objects) == len(messages) and set(marks) <= {_MARK})
        _require(set(map(type, objects)) == {dict})
        return columns(*(objects, whole.count(b":")))
    except (_OddError, ValueError, TypeError, KeyError, OverflowError):
        return None


def _signals(objects: list[Json], colons: int) -> Alike:
    get = itemgetter("stamp", "frame", "unit", "values", "sd")
    stamps, frames, units, values, sds = zip(*map(get, objects), strict=True)
    frame, unit = _text(frames), _text(units)
    keys = _keys(objects, 5) + _keys(stamps, 2)
    _require(colons == keys + len(objects) * (frame.count(":") + unit.count(":")))
    found = _column(values, _NUMBER)
    return Alike(_stamps(stamps), frame, _number(sds), (), unit, found)


def _markers(objects: list[Json], colons: int) -> Alike:
    get = itemgetter("stamp", "frame", "names", "x", "y", "z", "sd")
    stamps, frames, lists, x, y, z, sds = zip(*map(get, objects), strict=True)
    _require(set(map(type, lists)) == {list})
    names: tuple[str, ...] = _only(list(map(tuple, lists)))
    _require(set(map(type, names)) <= {str})
    frame = _text(frames)
    keys = _keys(objects, 7) + _keys(stamps, 2)
    _require(colons == keys + len(objects) * (frame.count(":") + "".join(names).count(":")))
    axes = [x, y] if z.count(None) == len(z) else [x, y, z]
    columns = [_column(axis, _NUMBER | {type(None)}) for axis in axes]
    _require({c.shape[1] for c in columns} == {len(names)})
    return Alike(_stamps(stamps), frame, _number(sds), names, "", np.stack(columns, axis=2))


def _require(true: bool) -> None:
    if not true:
        raise _OddError


def _only(values: Sequence[Any]) -> Any:
    """The value that all of them have."""
    (value,) = set(values)
    return value


def _text(values: Sequence[Any]) -> str:
    _require(set(map(type, values)) == {str})
    return str(_only(values))


def _number(values: Sequence[Any]) -> float:
    _require(set(map(type, values)) <= _NUMBER)
    return float(_only(values))


def _keys(objects: Sequence[Any], count: int) -> int:
    """How many keys they have in all; odd unless each has `count`."""
    _require(set(map(type, objects)) == {dict} and set(map(len, objects)) == {count})
    return count * len(objects)


def _column(values: Sequence[Any], allowed: set[type]) -> Floats:
    """Lists of equal length as (n, c), null as NaN."""
    _require(set(map(type, values)) == {list})
    length = _only(list(map(len, values)))
    flat = list(chain.from_iterable(values))
    _require(set(map(type, flat)) <= allowed)
    return np.array(flat, dtype=np.float64).reshape(len(values), length)


def _stamps(stamps: Sequence[Any]) -> Ints:
    seconds, nanoseconds = zip(*map(itemgetter("sec", "nsec"), stamps), strict=True)
    _require(set(map(type, seconds)) == {int} == set(map(type, nanoseconds)))
    sec, nsec = np.array(seconds, dtype=np.int64), np.array(nanoseconds, dtype=np.int64)
    _require(sec.min() >= 0 and sec.max() < _LAST_SECOND)
    _require(nsec.min() >= 0 and nsec.max() < 10**9)
    return sec * 10**9 + nsec


# --- Messages of images as this package writes them, looked at without unpacking their pixels.
#
# An inspection reads head and end: the JSON around the picture, its size in the PNG's header, and
# that the PNG ends. What stands between is covered by the file's own checksums; a run, which
# needs the pixels, unpacks and checks them all.

_HEAD = re.compile(
    rb'\{"timestamp":\{"sec":(\d{1,10}),"nsec":(\d{1,9})\},"frame_id":"([^"\\:]{0,200})","data":"'
)
_TAIL = b'","format":"png"}'
_HEADER, _END = 44, 24  # characters: signature with IHDR; what holds the last chunk
_LAST = b"\0\0\0\0IEND\xaeB`\x82"


@dataclass(frozen=True)
class Pictures:
    """Messages that agree: stamps (n,) ns, frame, and (h, w) px of every image."""

    stamps_ns: Ints
    frame: str
    shape: tuple[int, int]


def pictures(messages: Sequence[bytes]) -> Pictures | None:
    """Return the messages as one batch; None where one is odd, or differs from the others."""
    found = [_looked(data) for data in messages]
    seen = {one[1:] for one in found if one is not None}
    if None in found or len(seen) != 1:
        return None
    frame, header = seen.pop()
    try:
        width, height = png_size(base64.b64decode(header))
        name = frame.decode("utf-8")
    except (RecordingError, ValueError):
        return None
    stamps = np.array([one[0] for one in found if one is not None], dtype=np.int64)
    return Pictures(stamps, name, (height, width))


def _looked(data: bytes) -> tuple[int, bytes, bytes] | None:
    """Stamp ns, frame and header of a picture that begins and ends as one."""
    head = _HEAD.match(data)
    if head is None or not data.endswith(_TAIL) or len(data) > MAX_MESSAGE:
        return None
    start, end = head.end(), len(data) - len(_TAIL)
    if (end - start) % 4 or end - start < _HEADER + _END:
        return None
    if data.find(b'"', start, end) >= 0 or not data.isascii() or b"\\" in data:
        return None
    try:
        last = base64.b64decode(data[end - _END : end], validate=True)
    except ValueError:
        return None
    sec, nsec = int(head[1]), int(head[2])
    if not last.endswith(_LAST) or sec >= _LAST_SECOND:
        return None
    return sec * 10**9 + nsec, head[3], data[start : start + _HEADER]


# -------------------------------------------------------------------------------------------------

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
        together = _PICTURES if self.schema == IMAGE else _TOGETHER
        for start in range(0, len(messages), together):
            part, first = messages[start : start + together], self.first
            if first is None or self.error:
                self._one_by_one(part)
                continue
            # Those like the first one are not parsed one by one; a run unpacks pictures.
            stamps_ns: Ints | None = None
            if self.schema == IMAGE:
                shown = pictures(part)
                shape = None if first.image is None else first.image.shape
                if shown and (shown.frame, shown.shape) == (first.frame, shape):
                    stamps_ns, numbers = shown.stamps_ns, len(part) * first.size
            elif (
                (found := batch(self.schema, part))
                and (found.frame, found.sd, found.names, found.unit)
                == (first.frame, first.sd, first.names, first.unit)
                and found.values.shape[1:] == first.values.shape
            ):
                stamps_ns, numbers = found.stamps_ns, found.values.size
            if stamps_ns is None:
                self._one_by_one(part)
            else:
                self._stamps.frombytes(stamps_ns.tobytes())
                self.count += len(part)
                self.numbers += numbers

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
            self._differs("each", lambda: own_of(self.channel.topic, [first, sample]))
            if len(sample.values) < 3 and self._short is None:
                self._short = self.count
            if self._largest is None or _extent(sample) > _extent(self._largest):
                self._largest = sample
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
        sample = self._largest or self.first
        assert sample is not None  # a channel without messages is not asked
        at = times_ns[:1]
        return stream_of(Collected(self.channel, self.schema, at, at, [sample]), t0, records)


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
