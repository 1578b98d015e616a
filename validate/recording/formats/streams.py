"""Streams of a third-party file as a recording with their clocks."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from validate.errors import RecordingError
from validate.recording.types import Record, Recording, Source, Stream, by_kind, clock_of

_LONGEST = 9e9  # s


def recorded(
    name: str,
    source: Source,
    streams: Mapping[str, Stream],
    told: Record,
    unread: Mapping[str, str] | None = None,
) -> Recording:
    """Return the recording of streams whose times count from its first sample; `told` is its
    provenance.

    Such formats have one time a sample: it is stamp, publish and log time alike. Raises
    `RecordingError` for times that no nanoseconds of int64 hold: no clock counts so far.
    """
    for topic, s in streams.items():
        if float(s.t[-1]) > _LONGEST:
            raise RecordingError(f"{topic}: a time of {s.t[-1]:.3g} s; damaged")
    ns = {topic: np.rint(1e9 * s.t).astype(np.int64) for topic, s in streams.items()}
    return Recording(
        name=name,
        source=source,
        t0_ns=0,
        clock={topic: clock_of(topic, None, times, times) for topic, times in ns.items()},
        metadata={"provenance": told},
        unread=unread or {},
        **by_kind(streams),
    )


def begun(streams: Mapping[str, Stream]) -> dict[str, Stream]:
    """Return the streams with times from the first sample of all, to the nanosecond."""
    begin = min(float(s.t[0]) for s in streams.values())
    return {topic: replace(s, t=np.rint(1e9 * (s.t - begin)) / 1e9) for topic, s in streams.items()}


def distinct(labels: Sequence[str], count: int) -> tuple[str, ...]:
    """Return a name for each of `count`: the file's, numbered where one stands twice or is
    missing."""
    told = [str(s) for s in labels[:count]]
    told += [""] * (count - len(told))
    named = [s or f"unnamed {i + 1}" for i, s in enumerate(told)]
    often, seen = Counter(named), Counter[str]()
    out = []
    for name in named:
        seen[name] += 1
        out.append(f"{name} ({seen[name]})" if often[name] > 1 else name)
    return tuple(out)
