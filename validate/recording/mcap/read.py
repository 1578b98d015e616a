"""An MCAP file as a recording: verified front to back, then read by the index of that check.

Topics with schemas of others, mirrors among them, are not read; `validate inspect` lists them.
So are images without a record of their calibration (`calibration/<topic>`: m_per_px_x, m_per_px_y).
Nothing in the file is used as a path, and sizes are bounded before memory is taken
(`records.MAX_RECORD`, `integrity.MAX_MESSAGES`, `schemas.MAX_MESSAGE`,
`streams.MAX_NUMBERS`).
"""

from collections import Counter
from dataclasses import replace
from pathlib import Path

from validate.errors import RecordingError
from validate.recording.clocks import clock_of
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.metadata import by_name, name_of, own_records
from validate.recording.mcap.records import MAGIC
from validate.recording.mcap.streams import Collected, fill, not_ours, ours, stream_of
from validate.recording.mcap.verified import Verified, messages_of, opened
from validate.recording.reader import Options, Reader, head, require_known
from validate.recording.types import Clock, Recording, by_kind


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
    records = by_name(verified.metadata)
    name = name_of(records, path)
    t0 = min(int(raw.checked().times_ns.min()) for raw in collected)
    streams = {raw.channel.topic: stream_of(raw, t0, records) for raw in collected}
    clock = {raw.channel.topic: _clock(raw) for raw in collected}
    unread = not_ours(verified)
    found = Recording(name, verified.source, t0, **by_kind(streams), clock=clock, unread=unread)
    own = own_records(found)
    return replace(found, metadata={n: r for n, r in records.items() if n not in own})


def _clock(raw: Collected) -> Clock:
    return clock_of(raw.channel.topic, raw.stamps_ns, raw.publish_ns, raw.log_ns)


def _read(path: Path, options: Options) -> Recording:
    require_known(options, ())
    return read_recording(path)


MCAP = Reader(
    "mcap",
    "an MCAP file",
    lambda path: head(path, len(MAGIC)) == MAGIC,
    _read,
    "its first 8 bytes are MCAP's",
)
