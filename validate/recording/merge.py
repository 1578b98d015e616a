"""Merge of recordings of one test onto the clock of the first, and scatter of repeated tests.

The streams of a further file share one clock, so one offset moves all of them. Whether that clock
also runs fast or slow is told by the offsets of its halves: drift = (tau_2 - tau_1) / (t_2 -
t_1), over the distance of the halves' middles.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from validate.errors import RecordingError
from validate.recording.clocks.alignment import Offset, moved, offset_near
from validate.recording.types import Record, Recording, Signal, Source, by_kind

REPEATS = "repeats"  # a record: logs, specimens, share
SHARE = "share"  # its key: sd of the mean over the mean, one relative standard uncertainty


def repeats_share(recording: Recording) -> float:
    """Return the relative standard uncertainty of a mean of repeats; 0 for a recording of one log.

    Raises `RecordingError` for a record whose share is not a number of at least 0.
    """
    said = recording.metadata.get(REPEATS, {}).get(SHARE)
    if said is None:
        return 0.0
    try:
        share = float(said)
    except ValueError:
        share = math.nan
    if not (math.isfinite(share) and share >= 0):
        raise RecordingError(
            f"{recording.name}: record '{REPEATS}': {SHARE} '{said}' is not a number"
        )
    return share


# --- Streams of several recordings in one.

PROVENANCE = "provenance"


def merge(recordings: Sequence[Recording], name: str) -> Recording:
    """All streams of all recordings, each at its own moments of the clock; t = 0 is the earliest.

    Records that differ under one name are kept as `<name>/<recording>`. Raises `RecordingError` for
    fewer than two recordings and for topics that occur twice. Clocks are taken as they are: move a
    stream with `alignment.shift`.
    """
    if len(recordings) < 2:
        raise RecordingError(f"{len(recordings)} recordings to merge; give at least 2")
    counts = Counter(topic for r in recordings for topic in r.streams)
    twice = sorted(topic for topic, n in counts.items() if n > 1)
    if twice:
        raise RecordingError(f"topics {twice} occur in several recordings; rename them first")
    start = min(r.t0_ns for r in recordings)
    parts = [moved(r, (r.t0_ns - start) / 1e9) for r in recordings]
    origins = {
        f"{i + 1}": f"{r.name}: {', '.join(r.streams)}; {r.source.path} sha256 {r.source.sha256}"
        for i, r in enumerate(recordings)
    }
    values: dict[str, list[tuple[str, Record]]] = {}
    for recording in recordings:
        for key, record in recording.metadata.items():
            values.setdefault(key, []).append((recording.name, record))
    records: dict[str, Record] = {}
    for key, given in values.items():
        alike = all(dict(record) == dict(given[0][1]) for _, record in given)
        single = alike and key != PROVENANCE
        for i, (origin, record) in enumerate(given):
            full = key if single else f"{key}/{origin}"
            records[full if full not in records or single else f"{full}#{i + 1}"] = record
    return Recording(
        name=name,
        source=Source(" + ".join(r.source.path for r in recordings), "", 0, "merged"),
        t0_ns=start,
        **by_kind({k: s for r in parts for k, s in r.streams.items()}),
        clock={k: c for r in parts for k, c in r.clock.items()},
        unread={k: why for r in parts for k, why in r.unread.items()},
        metadata={**records, "merged": origins},
    )


# -------------------------------------------------------------------------------------------------

_TURNS = 12
_SETTLED = 0.05  # standard deviations of the drift
DOUBTFUL = 3.0  # standard deviations beyond which a drift is taken for one


@dataclass(frozen=True)
class ClockDrift:
    """By how much the second clock must be stretched: `rate` and `sd` in s/s, about `middle` s of
    its own; `span` s is how long it ran."""

    rate: float
    sd: float
    middle: float
    span: float

    @property
    def seen(self) -> bool:
        return abs(self.rate) > DOUBTFUL * self.sd

    @property
    def apart(self) -> float:
        """Seconds by which the clocks run apart over the recording."""
        return abs(self.rate) * self.span


def drift_of(reference: Signal, stream: Signal, offset: Offset) -> ClockDrift:
    """Turned to and fro until a stretched stream has none left, as a half's offset counts most
    where its signal is steep. Raises `RecordingError` where a half does not follow the reference
    alone, and where the turns do not settle."""
    middle, span = float(stream.t[0] + stream.t[-1]) / 2, float(np.ptp(stream.t))
    found = ClockDrift(0.0, 0.0, middle, span)
    for _ in range(_TURNS):
        more, sd = _left(reference, stretched_signal(stream, found), offset.seconds, middle)
        found = ClockDrift(found.rate + more, sd, middle, span)
        if abs(more) < _SETTLED * sd:
            return found
    raise RecordingError(f"the drift does not converge within {_TURNS} iterations")


def _left(reference: Signal, stream: Signal, start: float, middle: float) -> tuple[float, float]:
    """Rate and sd (s/s) by which the halves' offsets still run apart."""
    halves = [stream.t < middle, stream.t >= middle]
    parts = [replace(stream, t=stream.t[half], y=stream.y[half]) for half in halves]
    found = [offset_near(reference, part, start) for part in parts]
    between = float(parts[1].t.mean() - parts[0].t.mean())
    return (found[1][0] - found[0][0]) / between, float(
        np.hypot(found[0][1], found[1][1])
    ) / between


def with_drift(offset: Offset, drift: ClockDrift | None) -> Offset:
    """Return the offset with what an uncorrected drift makes of it: a ramp of that height, root
    12."""
    if drift is None or not drift.seen:
        return offset
    return replace(offset, sd=float(np.hypot(offset.sd, drift.apart / np.sqrt(12))))


def stretched_signal(signal: Signal, drift: ClockDrift) -> Signal:
    return replace(signal, t=signal.t + drift.rate * (signal.t - drift.middle))


def stretched(recording: Recording, drift: ClockDrift) -> Recording:
    """Return the recording with its times t + rate (t - middle)."""
    streams = {
        topic: replace(s, t=s.t + drift.rate * (s.t - drift.middle))
        for topic, s in recording.streams.items()
    }
    return replace(recording, **by_kind(streams))


@dataclass(frozen=True)
class Moved:
    """A further recording: its offset from the first, both counted from their own zeros, and the
    drift of its clock that is taken out, None for none."""

    recording: Recording
    offset: Offset
    drift: ClockDrift | None


def together(reference: Recording, others: Sequence[Moved], name: str) -> Recording:
    """One recording; every stream of the others keeps its offset as a record.

    Raises `RecordingError` for topics that two of them have, and for a stream moved before.
    """
    straight = [m.recording if m.drift is None else stretched(m.recording, m.drift) for m in others]
    found = merge([reference, *(replace(r, t0_ns=reference.t0_ns) for r in straight)], name)
    for one in others:
        for topic in one.recording.streams:
            found = one.offset.shift(found, topic)
    drifts = {
        f"clock_drift/{one.recording.name}": {
            "rate": repr(d.rate), "sd": repr(d.sd), "about_s": repr(d.middle),
        }
        for one in others if (d := one.drift)
    }  # fmt: skip
    return replace(found, metadata={**found.metadata, **drifts})


def require_other_topics(recordings: Sequence[Recording]) -> None:
    """Raise `RecordingError` for topics that two of the recordings have."""
    counts = Counter(topic for r in recordings for topic in r.streams)
    both = sorted(topic for topic, n in counts.items() if n > 1)
    if both:
        raise RecordingError(
            f"more than one file has {both}: import one of them again under another topic (--topic)"
        )
