"""Reader of MCAP files: verified front to back, then read by the index of that check.

Topics with schemas of others, mirrors among them, are not read by `read_recording`, which
experiments use, nor are images without a record of their calibration (`calibration/<topic>`:
m_per_px_x, m_per_px_y). `validate import` reads what of them means something (`read_all`).
Nothing in the file is used as a path, and sizes are bounded before memory is taken
(`records.MAX_RECORD`, `integrity.MAX_MESSAGES`, `schemas.MAX_MESSAGE`,
`streams.MAX_NUMBERS`).
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from validate.errors import RecordingError
from validate.files import ANY_SIZE
from validate.recording.clocks.alignment import moved
from validate.recording.mcap.integrity import verify
from validate.recording.mcap.records import MAGIC, Verified, messages_of, opened
from validate.recording.mcap.schemas import by_name, name_of, own_records
from validate.recording.mcap.streams import Collected, fill, not_ours, ours, stream_of
from validate.recording.mcap.third_party_channels import ForeignStreams, found_streams, gatherers
from validate.recording.mcap.third_party_channels import fill as fill_foreign
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
                raise RecordingError(
                    f"topics on two channels: {twice}; the order of their samples is not known"
                )
            if verified.claimed_messages not in (None, verified.messages):
                raise RecordingError(
                    f"its statistics claim {verified.claimed_messages} messages, it has "
                    f"{verified.messages}; see `validate inspect`"
                )

            fill(collected, messages_of(stream, verified, collected.keys()))
            return _recording(path, verified, list(collected.values()))
        except RecordingError as error:
            raise RecordingError(f"{path.name}: {error}") from None


def _recording(path: Path, verified: Verified, collected: list[Collected]) -> Recording:
    records = by_name(verified.metadata)
    name = name_of(records, path)
    t0 = min(int(raw.checked().times_ns.min()) for raw in collected)
    streams = {raw.channel.topic: stream_of(raw, t0, records) for raw in collected}
    clock = {
        raw.channel.topic: clock_of(raw.channel.topic, raw.stamps_ns, raw.publish_ns, raw.log_ns)
        for raw in collected
    }
    unread = not_ours(verified)
    found = Recording(name, verified.source, t0, **by_kind(streams), clock=clock, unread=unread)
    own = own_records(found)
    return replace(found, metadata={n: r for n, r in records.items() if n not in own})


def read_all(path: Path, options: Options) -> Recording:
    """Return the recording in an MCAP file of anybody: streams of ours, and messages of others that
    mean something (`known_messages`), as one.

    Options: `m_per_px` of images without a scale, `/topic.field=UNIT` for a number in messages of
    other types, `unit` of markers and outlines that were wrongly declared in m. Raises as
    `read_recording`, `UsageError` for a wrong option, and `RecordingError` where nothing is a
    stream.
    """
    factor, _ = metres(options, "m", path.name)
    found = _read_all(path, {key: value for key, value in options.items() if key != "unit"})
    return found if factor == 1 else in_unit(found, options["unit"], factor)


def _read_all(path: Path, options: Options) -> Recording:
    with opened(path) as stream:
        verified = verify(stream, path)
        gathered, never = gatherers(verified, options)
        try:
            fill_foreign(gathered, messages_of(stream, verified, gathered.keys()))
            found = found_streams(gathered, options)
        except RecordingError as error:
            raise RecordingError(f"{path.name}: {error}") from None
    never = {**never, **found.never}
    own = read_recording(path) if ours(verified) else None
    if own is None and not found.make:
        why = "; ".join(f"{topic}: {reason}" for topic, reason in never.items())
        raise RecordingError(
            f"{path.name}: none of its messages can be read as a stream; {why or 'empty'}"
        )
    return _together(path, verified, own, found, never)


def _together(
    path: Path,
    verified: Verified,
    own: Recording | None,
    found: ForeignStreams,
    never: Mapping[str, str],
) -> Recording:
    """Own and foreign streams on one clock."""
    begins = [int(ns[0]) for ns in found.ns.values()] + ([own.t0_ns] if own else [])
    t0 = min(begins)
    streams = {topic: make(t0) for topic, make in found.make.items()}
    told = {**found.told, "library": verified.header.library, "profile": verified.header.profile}
    if own is None:
        records = {**by_name(verified.metadata), "provenance": told}
        return Recording(path.stem, verified.source, t0, **by_kind(streams), clock=found.clocks,
                         metadata=records, unread=never)  # fmt: skip
    own = moved(own, (own.t0_ns - t0) / 1e9)
    return replace(
        own, t0_ns=t0, **by_kind({**own.streams, **streams}), clock={**own.clock, **found.clocks},
        unread=never,
    )  # fmt: skip


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
