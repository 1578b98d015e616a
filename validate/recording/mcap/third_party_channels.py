"""Third-party channels of an MCAP file as streams: known types, and numbers by name.

Of a type that is not known a field becomes a signal by `--map /topic.field.sub=UNIT`. Samples are
put in the order of their stamps; how many were not is told. What is no stream is listed with why.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from validate.arrays import Ints
from validate.errors import RecordingError, UsageError
from validate.recording.images.image import shallow
from validate.recording.mcap.decoders import Decoder, Plain, decoder_of
from validate.recording.mcap.known_messages import MessagePart, parts_of, stamp_ns
from validate.recording.mcap.records import Channel, Message, Verified
from validate.recording.mcap.schemas import MIRROR_OF
from validate.recording.mcap.streams import MAX_NUMBERS, ours
from validate.recording.reader import Options, length
from validate.recording.types import Clock, Frames, Markers, Signal, Stream, clock_of
from validate.units import si_of

_DATE = 10**17  # ns: three years; clocks that count from a start stay below
SCALE, WHITE = "m_per_px", "white"


Sample = tuple[MessagePart, int, int]  # and when it was published and logged, ns
_Known = Callable[[Plain], Iterable[MessagePart]]


@dataclass
class Gathered:
    """The parts of one channel while they are read; `error` is the first that was wrong."""

    channel: Channel
    parts: Callable[[bytes], Iterable[MessagePart]]
    samples: dict[str, list[Sample]] = field(default_factory=dict)
    error: str = ""

    def add(self, message: Message) -> int:
        """Decode and keep one message; returns how many float64 it takes."""
        if self.error:
            return 0
        size = 0
        try:
            for part in self.parts(message.data):
                times = (message.publish_ns, message.log_ns)
                self.samples.setdefault(part.name, []).append((part, *times))
                size += part.values.size + (0 if part.image is None else -(-part.image.nbytes // 8))
        except (RecordingError, KeyError, TypeError, ValueError, AttributeError) as error:
            why = f"no {error}" if isinstance(error, KeyError) else str(error)
            self.error = f"a message cannot be read: {' '.join(why.split())[:160]}"
        return size


def gatherers(verified: Verified, options: Options) -> tuple[dict[int, Gathered], dict[str, str]]:
    """Return a gatherer for every foreign channel that means something, and why others do not.

    Raises `UsageError` for a field asked for of a topic that the file does not have.
    """
    fields = {key: unit for key, unit in options.items() if key not in (SCALE, WHITE)}
    own = ours(verified)
    topics = sorted(c.topic for c in verified.channels.values())
    for name in fields:
        if not any(name.startswith(f"{topic}.") for topic in topics):
            listed = ", ".join(topics) or "none"
            raise UsageError(f"--map {name}=...: no such key; known: {SCALE}, {WHITE}, TOPIC.FIELD "
                             f"of the topics {listed}")  # fmt: skip
    found: dict[int, Gathered] = {}
    never: dict[str, str] = {}
    for number, channel in verified.channels.items():
        if number in own or MIRROR_OF in channel.metadata or not len(verified.log_ns[number]):
            continue
        asked = {k: u for k, u in fields.items() if k.startswith(f"{channel.topic}.")}
        schema = verified.schemas.get(channel.schema_id)
        decode = decoder_of(schema, channel)
        known: _Known | None = parts_of(schema.name if schema else "")
        if asked:
            known = _fields(channel.topic, asked)
        if isinstance(decode, str):
            never[channel.topic] = decode
        elif known is not None:
            found[number] = Gathered(channel, partial(_parts, decode, known))
        else:
            kind = schema.name if schema else "no schema"
            never[channel.topic] = (
                f"messages of unknown meaning ({kind}); import a number with "
                f"--map {channel.topic}.FIELD=UNIT"
            )
    return found, never


def _parts(decode: Decoder, known: _Known, data: bytes) -> Iterable[MessagePart]:
    return known(decode(data))


def _fields(topic: str, asked: Mapping[str, str]) -> _Known:
    """Parts of the named fields, stamped by a header where there is one."""

    def parts(message: Plain) -> Iterable[MessagePart]:
        stamp = message.get("header", {}).get("stamp", message.get("timestamp"))
        ns = None if stamp is None else stamp_ns(stamp)
        frame = str(message.get("header", {}).get("frame_id", message.get("frame_id", "")))
        for key, unit in asked.items():
            path = key.removeprefix(topic)
            factor, si = si_of(unit)
            found = _at(message, path[1:])
            if isinstance(found, dict):
                below = ", ".join(f"{key}.{name}" for name in sorted(found))
                raise RecordingError(f"'{key}' holds fields; name one: {below}")
            try:
                values = np.atleast_1d(np.asarray(found, dtype=np.float64)).ravel()
            except (TypeError, ValueError):
                raise RecordingError(f"'{key}' is {str(found)[:40]!r}, not numbers") from None
            yield MessagePart(path, ns, frame or "topic", factor * values, unit=si)

    return parts


def _at(message: Any, path: str) -> Any:
    for name in path.split("."):
        if isinstance(message, list) and name.isdigit() and int(name) < len(message):
            message = message[int(name)]
        elif isinstance(message, dict) and name in message:
            message = message[name]
        else:
            there = sorted(message) if isinstance(message, dict) else type(message).__name__
            raise RecordingError(f"no field '{name}' of '{path}'; there are {there}")
    return message


def fill(gathered: Mapping[int, Gathered], messages: Iterable[Message]) -> None:
    """Decode the messages; raises `RecordingError` over `streams.MAX_NUMBERS`."""
    total = 0
    for message in messages:
        total += gathered[message.channel_id].add(message)
        if total > MAX_NUMBERS:
            raise RecordingError(f"more than {MAX_NUMBERS} numbers, the limit; split the file")


@dataclass(frozen=True)
class ForeignStreams:
    """Streams with absolute times int64 ns (n,), their clocks, what was told, what is no stream."""

    make: Mapping[str, Callable[[int], Stream]]
    ns: Mapping[str, Ints]
    clocks: Mapping[str, Clock]
    told: Mapping[str, str]
    never: Mapping[str, str]


def found_streams(gathered: Mapping[int, Gathered], options: Options) -> ForeignStreams:
    """Return the streams of all gatherers; one whose samples do not make a stream is told, not
    raised.

    Raises `UsageError` for a wrong `m_per_px`.
    """
    make: dict[str, Callable[[int], Stream]] = {}
    ns: dict[str, Ints] = {}
    clocks, told, never = {}, {}, {}
    side = length(options, SCALE, "0.1mm") if SCALE in options else None
    for one in gathered.values():
        if one.error:
            never[one.channel.topic] = one.error
            continue
        for name, whole in _by_size(one.samples):
            topic = f"{one.channel.topic}{name}"
            # Without samples that hold NaN, as where a tool was lost; all where none is left.
            kept = [s for s in whole if s[0].names or not np.isnan(s[0].values).any()]
            lost = len(whole) - len(kept)
            samples, gone = (
                (kept, f"{lost} samples without numbers left out") if kept and lost else (whole, "")
            )
            why = _why_none([part for part, _, _ in samples], side)
            if why or topic in make:
                never[topic] = why or "two channels have this topic"
                continue
            # When the samples were measured, ns: by their stamps; where those were never set, which
            # makes them 0, by when they were published.
            stamps = np.array(
                [p if part.ns is None else part.ns for part, p, _ in samples], np.int64
            )
            zero = stamps == 0
            if not zero.any() or 0 < stamps.max() < _DATE:
                times, unset = stamps, ""
            else:
                published = np.array([p for _, p, _ in samples], np.int64)
                times = np.where(zero, published, stamps)
                unset = f"{int(zero.sum())} stamps of 0: replaced by the publish time"
            order = np.argsort(times, kind="stable")
            moved = int((order != np.arange(len(order))).sum())
            # Images deeper than 8 bits become so.
            parts, levels = [samples[i][0] for i in order], ""
            deep = [part.image for part in parts if part.image is not None]
            if any(image.dtype != np.uint8 for image in deep):
                try:
                    images, levels = shallow(deep, options)
                except RecordingError as error:
                    never[topic] = str(error)
                    continue
                parts = [replace(p, image=i) for p, i in zip(parts, images, strict=True)]
            late = f"{moved} of {len(order)} samples were not in the order of their stamps"
            if notes := [*filter(None, (levels, late if moved else "", gone, unset))]:
                told[topic] = "; ".join(notes)
            ns[topic] = times[order]
            make[topic] = partial(_stream, parts, ns[topic], side)
            clocks[topic] = clock_of(
                topic, ns[topic], *(np.array([s[k] for s in samples], np.int64)[order]
                                    for k in (1, 2)),
            )  # fmt: skip
    return ForeignStreams(make, ns, clocks, told, never)


def _by_size(
    samples: Mapping[str, list[Sample]],
) -> Iterator[tuple[str, list[Sample]]]:
    """Samples by name; images of several sizes are streams of their own, as `/640x480`."""
    for name, whole in samples.items():
        sizes = dict.fromkeys(_size(sample) for sample in whole)
        if len(sizes) < 2:
            yield name, whole
            continue
        for size in sizes:
            yield f"{name}/{size}", [sample for sample in whole if _size(sample) == size]


def _size(sample: Sample) -> str:
    image = sample[0].image
    return "" if image is None else f"{image.shape[1]}x{image.shape[0]}"


def _why_none(parts: list[MessagePart], side: float | None) -> str:
    """Why samples are no one stream; empty where they are."""
    first = parts[0]
    if first.image is not None:
        return "" if side else "images without a scale; give --map m_per_px=0.1mm"
    if len({p.frame for p in parts}) > 1:
        return f"frames change: {sorted({p.frame for p in parts})[:4]}"
    counts = {p.values.shape for p in parts}
    if len(counts) > 1 or not first.values.size:
        return f"its number of values changes: {sorted(counts)[:4]}"
    if not first.names and not all(np.isfinite(p.values).all() for p in parts):
        return "numbers that are not finite"
    return ""


def _stream(parts: list[MessagePart], ns: Ints, side: float | None, t0: int) -> Stream:
    """The stream of samples at `ns`, on a clock that begins at `t0` ns."""
    t, first = (ns - t0) / 1e9, parts[0]
    frame = first.frame or "not stated"
    if first.image is not None and side is not None:
        images = tuple(p.image for p in parts if p.image is not None)
        return Frames(t, images, (side, side), np.eye(4), frame)
    values = np.stack([p.values for p in parts])
    if first.names:
        return Markers(t, first.names, np.where(np.isfinite(values), values, np.nan), 0.0, frame)
    return Signal(t, values, first.unit, 0.0, frame)
