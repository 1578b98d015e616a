"""Clock offset between two streams, and a stream shifted by it.

It stands on the recording floor because clocks are mended before anything is registered or
compared. An offset is what must be *added* to a stream's times to bring them onto the reference's
clock. Nothing is moved without saying so: `shift` writes the record `clock_offset/<topic>`.

Method: masked normalised cross-correlation finds the lag (Padfield 2012, IEEE Trans. Image Process.
21, eqs. 10-12, in one dimension); the slope of the correlation is then brought to zero between the
samples. Its curvature there and the residual noise give the standard uncertainty.
"""

from dataclasses import dataclass, replace

import numpy as np

from validate.errors import RecordingError
from validate.recording.clocks.lag import (
    MIN_CORRELATION,
    MIN_MATCHED,
    coarse_lag,
    met,
    noise_of,
    refined_lag,
    step_of,
)
from validate.recording.types import Recording, Signal, Stream, by_kind

RECORD = "clock_offset/"  # metadata record RECORD + topic of every stream that was moved
MIN_COVERAGE = 0.5  # share of the stream's samples that must meet the reference


@dataclass(frozen=True)
class Offset:
    """Offset to add to a stream's times: `seconds` s, `sd` s (one standard uncertainty).

    `count` samples of the stream meet the reference then, a share `coverage` of them all.
    """

    seconds: float
    sd: float
    method: str
    count: int
    coverage: float


def offset_by_correlation(
    reference: Signal,
    stream: Signal,
    within: float,
    min_coverage: float = MIN_COVERAGE,
    min_correlation: float = MIN_CORRELATION,
) -> Offset:
    """Return the offset |tau| <= `within` (s) at which the stream follows the reference, up to
    scale.

    Both signals (nt, 1), of any rate, with gaps; a positive linear relation is assumed. Raises
    `RecordingError`, with the numbers, for flat and periodic signals, ramps (any lag fits them), a
    weak correlation, an offset at the edge of the search, and too small a coverage.
    """
    for signal, name in ((reference, "reference"), (stream, "stream")):
        _require_motion(signal, name)
    if not within > 0:
        raise RecordingError(f"offset within {within} s: expected a range above 0")
    step = min(step_of(reference.t), step_of(stream.t))
    coarse = coarse_lag(reference, stream, step, within, min_coverage, min_correlation)
    seconds, sd = offset_near(reference, stream, coarse)
    return matched(reference, stream, Offset(seconds, sd, "correlation", 0, 0), min_coverage)


def offset_near(reference: Signal, stream: Signal, start: float) -> tuple[float, float]:
    """Offset and its sd (s) of a stream that is known to follow the reference at about `start`.

    Raises `RecordingError` where it does not, or where too few samples meet.
    """
    fine = step_of(reference.t) <= step_of(stream.t)
    known, seen, sign = (reference, stream, 1.0) if fine else (stream, reference, -1.0)
    seconds, sd = refined_lag(known, seen, sign * start)
    return sign * seconds, sd


def declared_offset(recording: Recording, topic: str, seconds: float, sd: float) -> Offset:
    """Return an offset that the user states, s; counted are the samples that meet any other stream.

    Raises `RecordingError` for an unknown topic, a lone stream, and too small a coverage.
    """
    times = {k: s.t for k, s in recording.streams.items()}
    others = [t for k, t in times.items() if k != topic and len(np.unique(t)) > 1]
    if topic not in times or not others:
        raise RecordingError(
            f"'{topic}' has no other stream to compare with; there are {sorted(times)}"
        )
    inside = np.any([met(t, times[topic] + seconds) for t in others], axis=0)
    offset = Offset(seconds, sd, "given by --shift", int(inside.sum()), float(inside.mean()))
    _require_coverage(offset, len(inside), MIN_COVERAGE)
    return offset


def matched(
    reference: Signal, stream: Stream, offset: Offset, min_coverage: float = MIN_COVERAGE
) -> Offset:
    """Return the offset with its samples counted: those that fall within the reference, not in its
    gaps.

    Raises `RecordingError` below `min_coverage`.
    """
    inside = met(reference.t, stream.t + offset.seconds)
    found = replace(offset, count=int(inside.sum()), coverage=float(inside.mean()))
    _require_coverage(found, len(inside), min_coverage)
    return found


def _require_coverage(offset: Offset, total: int, least: float) -> None:
    if offset.coverage < least:
        raise RecordingError(
            f"at an offset of {offset.seconds:+.6g} s {offset.count} of {total} samples "
            f"({100 * offset.coverage:.0f} %) meet the reference; at least {100 * least:.0f} % are "
            "needed; record longer together or lower the required share (--coverage)"
        )


def shift(recording: Recording, topic: str, offset: Offset) -> Recording:
    """Return a recording whose stream `topic` is moved by the offset, which is kept as a record.

    Times start again at the earliest sample of all streams. Raises `RecordingError` for an unknown
    topic and for one that was moved before.
    """
    name = RECORD + topic
    if name in recording.metadata:
        raise RecordingError(
            f"'{topic}' was shifted by {recording.metadata[name].get('seconds')} s before; "
            "shift the stream of the first recording instead"
        )
    if topic not in recording.streams:
        known = sorted(recording.streams)
        raise RecordingError(f"no stream '{topic}' to shift; the recording has {known}")
    record = {
        "seconds": repr(offset.seconds),
        "sd": repr(offset.sd),
        "method": offset.method,
        "count": str(offset.count),
        "coverage": repr(offset.coverage),
    }
    metadata = {**recording.metadata, name: record}
    return rebased(replace(moved(recording, offset.seconds, topic), metadata=metadata))


def rebased(recording: Recording) -> Recording:
    """Return the recording with time 0 at its earliest sample, at the same moments of the clock.

    Where that moment would lie before the clock's own zero (an export without date), the clock
    begins at the earliest sample.
    """
    start_ns = round(1e9 * float(min(s.t[0] for s in recording.streams.values())))
    t0_ns = max(0, recording.t0_ns + start_ns)
    return replace(moved(recording, -start_ns / 1e9), t0_ns=t0_ns)


def moved(recording: Recording, seconds: float, topic: str | None = None) -> Recording:
    """`seconds` added to the times of one stream, of all where no topic is given."""
    streams = {
        k: replace(s, t=s.t + seconds) if topic in (None, k) else s
        for k, s in recording.streams.items()
    }
    return replace(recording, **by_kind(streams))


def _require_motion(signal: Signal, name: str) -> None:
    if signal.y.shape[1] != 1:
        raise RecordingError(f"{name}: {signal.y.shape[1]} columns, expected 1; choose one")
    if len(np.unique(signal.t)) < MIN_MATCHED:
        raise RecordingError(f"{name}: {len(signal.t)} samples; at least {MIN_MATCHED} are needed")
    y = signal.y[:, 0]
    noise = noise_of(y)
    spread = float(np.std(y))
    if spread <= max(1.2 * noise, 1e-12 * float(np.abs(y).max())):
        raise RecordingError(
            f"{name}: flat, its standard deviation {spread:.3g} {signal.unit} is that of its noise "
            f"({noise:.3g}); it cannot be correlated, align by another stream"
        )
