"""Writer of a recording as MCAP: deterministic bytes, complete or not at all.

Messages are in order of time; log time = publish time = stamp. Stamps are whole nanoseconds, so
times on that grid return exactly up to 26 days (2^51 ns); zero of time on return is the earliest
sample. `clock` and `source` are not written: reading makes them anew.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RecordingError
from validate.recording.mcap import schemas
from validate.recording.mcap.channels import (
    MessageSchema,
    WrittenChannel,
    WrittenMessage,
    json_schema,
    write_channels,
)
from validate.recording.mcap.metadata import all_records
from validate.recording.mcap.schemas import (
    CONTOUR,
    IMAGE,
    MARKERS,
    MIRROR,
    MIRROR_OF,
    SCHEMAS,
    SIGNAL,
    Json,
    to_bytes,
)
from validate.recording.types import Contours, Frames, Markers, Recording, Signal, Stream

_SCHEMA_OF = {Markers: MARKERS, Signal: SIGNAL, Contours: CONTOUR, Frames: IMAGE}


@dataclass(frozen=True)
class _Written:
    """One channel with its stamps (n,) ns and the message of sample i at a stamp."""

    channel: WrittenChannel
    stamps: Ints
    message: Callable[[int, int], Json]


def write_recording(recording: Recording, path: Path | str) -> None:
    """Write `recording` to `path`, replacing what is there only when all is written.

    Raises `RecordingError`: no streams, a topic or metadata name used twice, times that are no
    int64 nanoseconds, images over 4096 px a side, or a path that cannot be written.
    """
    if not recording.streams:
        raise RecordingError(f"{recording.name}: no streams to write")
    parts = [w for topic, s in recording.streams.items() for w in _parts(topic, s, recording.t0_ns)]
    write_channels(Path(path), [p.channel for p in parts], _messages(parts), all_records(recording))


def _parts(topic: str, stream: Stream, t0_ns: int) -> list[_Written]:
    """The channel of a stream, and the mirror of markers that viewers know."""
    ns = stamps_ns(t0_ns, stream.t, topic)
    own = WrittenChannel(topic, _schema(_SCHEMA_OF[type(stream)]))
    parts = [_Written(own, ns, lambda i, at: _message(stream, i, at))]
    if isinstance(stream, Markers):
        frame, x = stream.frame, stream.x
        seen = WrittenChannel(f"{topic}/foxglove", _schema(MIRROR), {MIRROR_OF: topic})
        parts.append(_Written(seen, ns, lambda i, at: schemas.mirror_message(at, frame, x[i])))
    return parts


def _schema(name: str) -> MessageSchema:
    return json_schema(name, SCHEMAS[name])


def _message(stream: Stream, i: int, ns: int) -> Json:
    if isinstance(stream, Markers):
        return schemas.markers_message(ns, stream.frame, stream.names, stream.x[i], stream.sd)
    if isinstance(stream, Signal):
        return schemas.signal_message(ns, stream.frame, stream.unit, stream.y[i], stream.sd)
    if isinstance(stream, Contours):
        return schemas.contour_message(
            ns,
            stream.frame,
            stream.outlines[i],
            stream.sd,
            None if stream.each is None else stream.each[i],
        )
    return schemas.image_message(ns, stream.frame, stream.images[i])


def _messages(parts: list[_Written]) -> Iterator[WrittenMessage]:
    """All samples in order of time, channels in their order when equal."""
    ns = np.concatenate([p.stamps for p in parts])
    which = np.repeat(np.arange(len(parts)), [len(p.stamps) for p in parts])
    sample = np.concatenate([np.arange(len(p.stamps)) for p in parts])
    for k in np.argsort(ns, kind="stable"):
        part, at = parts[which[k]], int(ns[k])
        data = to_bytes(part.message(int(sample[k]), at))
        yield WrittenMessage(part.channel.topic, at, data)


def stamps_ns(t0_ns: int, t: Floats, topic: str) -> Ints:
    """t0_ns + round(t 1e9) in int64 ns; raises `RecordingError` outside 0 .. 2^63 - 1."""
    largest = int(np.iinfo(np.int64).max)
    ends = (np.clip(t[[0, -1]], -1e10, 1e10) * 1e9).tolist()  # clipped beyond int64, no infinity
    first, last = t0_ns + round(ends[0]), t0_ns + round(ends[1])
    if min(t0_ns, first) < 0 or max(t0_ns, last) > largest:
        raise RecordingError(f"{topic!r}: times {first} .. {last} ns are outside 0 .. {largest}")
    return np.int64(t0_ns) + np.rint(t * 1e9).astype(np.int64)
