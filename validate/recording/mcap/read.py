"""An MCAP file as a recording: verified front to back, then read by the index of that check.

Topics with schemas of others, mirrors among them, are not read; `validate inspect` lists them.
So are images without a record of their calibration (`calibration/<topic>`: m_per_px_x, m_per_px_y).
Nothing in the file is used as a path, and sizes are bounded before memory is taken
(`records.MAX_RECORD`, `integrity.MAX_MESSAGES`, `schemas.MAX_MESSAGE`,
`streams.MAX_NUMBERS`).
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError
from validate.recording.clocks import clock_of
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.schemas import IMAGE, MARKERS, SIGNAL
from validate.recording.mcap.streams import (
    CALIBRATION,
    Collected,
    contours,
    fill,
    frames,
    markers,
    ours,
    signal,
)
from validate.recording.mcap.verified import Verified, messages_of, opened
from validate.recording.mcap.write import CALIBRATION_KEYS, FORMAT, POSE, POSE_KEY, RECORD
from validate.recording.types import Clock, Contours, Frames, Markers, Record, Recording, Signal


def read_recording(path: Path) -> Recording:
    """The recording in an MCAP file; t = 0 is the earliest sample of all its streams.

    A measurement's time is the stamp in its message, else its publish time, never log time.
    Raises `RecordingError` for a file that is damaged (with the byte), contradicts itself, holds
    no topic of ours, or whose samples are out of order or change their unit, frame or names.
    """
    with opened(path) as stream:
        verified = verify(stream, path)
        try:
            collected = _topics(verified)
            fill(collected, messages_of(stream, verified, collected.keys()))
            return _recording(path, verified, list(collected.values()))
        except RecordingError as error:
            raise RecordingError(f"{path.name}: {error}") from None


def _topics(verified: Verified) -> dict[int, Collected]:
    """The channels of ours, one a topic; a wrong count of messages is refused."""
    collected = ours(verified)
    if not collected:
        schemas = sorted({s.name for s in verified.schemas.values()})
        raise RecordingError(
            "no topic with markers, signals or contours, nor calibrated images; "
            f"schemas found: {schemas}; see `validate inspect`"
        )
    topics = Counter(c.channel.topic for c in collected.values())
    twice = sorted(topic for topic, n in topics.items() if n > 1)
    if twice:
        raise RecordingError(f"topics on two channels: {twice}; their samples have no one order")
    if verified.claimed_messages not in (None, verified.messages):
        raise RecordingError(
            f"its statistics claim {verified.claimed_messages} messages, it holds "
            f"{verified.messages}; see `validate inspect`"
        )
    return collected


def _recording(path: Path, verified: Verified, collected: list[Collected]) -> Recording:
    records = metadata_records(verified)
    name = _name(records, path)
    t0 = min(int(raw.checked().times_ns.min()) for raw in collected)
    streams = {raw.channel.topic: stream_of(raw, t0, records) for raw in collected}
    outlines = {topic: s for topic, s in streams.items() if isinstance(s, Contours)}
    images = {topic: s for topic, s in streams.items() if isinstance(s, Frames)}
    read_already = {RECORD, *(POSE + topic for topic in [*outlines, *images])}
    read_already |= {CALIBRATION + topic for topic in images}
    return Recording(
        name=name,
        source=verified.source,
        t0_ns=t0,
        markers={topic: s for topic, s in streams.items() if isinstance(s, Markers)},
        signals={topic: s for topic, s in streams.items() if isinstance(s, Signal)},
        contours=outlines,
        frames=images,
        clock={raw.channel.topic: _clock(raw) for raw in collected},
        metadata={n: r for n, r in records.items() if n not in read_already},
    )


def _clock(raw: Collected) -> Clock:
    return clock_of(raw.channel.topic, raw.stamps_ns, raw.publish_ns, raw.log_ns)


def stream_of(
    raw: Collected, t0_ns: int, records: Mapping[str, Record]
) -> Markers | Signal | Contours | Frames:
    """The stream of one channel of ours, times from `t0_ns`; `records` hold poses and scales."""
    if raw.schema == MARKERS:
        return markers(raw, t0_ns)
    if raw.schema == SIGNAL:
        return signal(raw, t0_ns)
    pose = _numbers(records, POSE + raw.channel.topic, (POSE_KEY,), 16).reshape(4, 4)
    if raw.schema == IMAGE:
        scale = _numbers(records, CALIBRATION + raw.channel.topic, CALIBRATION_KEYS, 2)
        return frames(raw, t0_ns, scale, pose)
    return contours(raw, t0_ns, pose)


def metadata_records(verified: Verified) -> dict[str, Record]:
    """Metadata records by name; the second of one name is called `name#2`, and so on."""
    records: dict[str, Record] = {}
    counts: Counter[str] = Counter()
    for record in verified.metadata:
        counts[record.name] += 1
        again = counts[record.name] > 1
        name = f"{record.name}#{counts[record.name]}" if again else record.name
        if name in records:
            raise RecordingError(f"metadata {name!r} occurs twice; rename one")
        records[name] = record.values
    return records


def _name(records: Mapping[str, Record], path: Path) -> str:
    record = records.get(RECORD)
    if record is None:
        return path.stem
    if record.get("format") != FORMAT or "name" not in record:
        raise RecordingError(
            f"record '{RECORD}' is {dict(record)}, expected format {FORMAT} and a name; "
            "read it with the version that wrote it"
        )
    return record["name"]


def _numbers(records: Mapping[str, Record], name: str, keys: tuple[str, ...], count: int) -> Floats:
    """The `count` numbers under `keys` of a topic's metadata record."""
    record = records.get(name, {})
    missing = [key for key in keys if key not in record]
    if missing:
        raise RecordingError(f"no record {name!r} with {', '.join(missing)}, {count} numbers")
    try:
        numbers = np.array([float(word) for key in keys for word in record[key].split()])
    except ValueError as error:
        raise RecordingError(f"record {name!r}: {error}") from None
    return checked(numbers, f"record {name!r}: {', '.join(keys)}", (count,), error=RecordingError)
