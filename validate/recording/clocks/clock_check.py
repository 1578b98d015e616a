"""Check of a stream's time stamps: steps, duplicates, backward steps and gaps.

Time of a measurement: the stamp in its message, else its publish time, never its log time, which
holds the recorder's delays.
"""

import numpy as np

from validate.arrays import Ints
from validate.errors import RecordingError
from validate.recording.types import Clock

GAP_FACTOR = 3.0  # a step longer than this many median steps is a gap


def clock_of(topic: str, stamps_ns: Ints | None, publish_ns: Ints, log_ns: Ints) -> Clock:
    """Return the clock of one stream from int64 ns (n,) each, in the order of the file.

    `stamps_ns` None: the messages have no stamp and publish time counts. The median step is over
    steps forward, so repeated stamps do not hide gaps; `longest_gap` is 0 where there is no gap.
    Raises `RecordingError` without messages or when the counts differ.
    """
    times = publish_ns if stamps_ns is None else stamps_ns
    counts = (len(times), len(publish_ns), len(log_ns))
    if counts[0] == 0 or len(set(counts)) != 1:
        raise RecordingError(f"{topic!r}: {counts} stamps, publish and log times, expected equal")
    steps = np.diff(times)
    duplicates, backward = int((steps == 0).sum()), int((steps < 0).sum())
    gaps = _gaps(steps[steps > 0])
    duration = _seconds(int(times.max()) - int(times.min()))
    return Clock(
        topic=topic,
        count=len(times),
        duration=duration,
        rate_hz=(len(times) - 1) / duration if duration > 0 else None,
        gaps=len(gaps),
        longest_gap=_seconds(int(gaps.max(initial=0))),
        duplicates=duplicates,
        backward=backward,
        stamp_minus_publish=None if stamps_ns is None else _largest(stamps_ns, publish_ns),
        publish_minus_log=_largest(publish_ns, log_ns),
    )


def _gaps(forward: Ints) -> Ints:
    """The steps that are gaps; reorders `forward`, as a copy costs 8 bytes a sample."""
    if not len(forward):
        return forward
    return forward[forward > GAP_FACTOR * np.median(forward, overwrite_input=True)]


def _seconds(ns: int) -> float:
    return ns / 1e9


def _largest(a: Ints, b: Ints) -> float:
    apart = a - b
    return _seconds(int(np.abs(apart, out=apart).max()))
