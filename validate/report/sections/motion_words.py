"""Recorded motion in words: largest motion, distance, speed, and intervals at rest."""

from validate.errors import ComparisonError
from validate.identify.recorded_motion import RecordedMotion, motion_in
from validate.numbers import with_unit
from validate.recording.types import Recording

_LINES = 6

_STEADY = 0.9  # of the whole change: from first to last sample


def rests(shown: RecordedMotion) -> str:
    """Return when it is at rest."""
    first = "in motion from the first sample on"
    if shown.rests_until is not None:
        first = f"at rest until {shown.rests_until:.3g} s"
    if shown.rests_from is None:
        return f"{first}, not at rest at the end"
    return f"{first}, at rest from {shown.rests_from:.3g} s to the end"


def motion_words(shown: RecordedMotion) -> str:
    """Return the facts in one sentence."""
    along = ", ".join(f"{x:+.2f}" for x in shown.direction)
    way = f" along ({along})" if len(shown.direction) > 1 else ""
    # The main frequency, or why there is none: a steady change has noise alone beside
    if not shown.resolution:
        rhythm = "too few samples for a spectrum"
    elif abs(shown.drift) > _STEADY * shown.size:
        rhythm = "changing steadily"
    elif shown.frequency < shown.resolution:
        rhythm = f"slower than {shown.resolution:.2g} Hz"
    else:
        rhythm = f"mostly at {shown.frequency:.3g} Hz (resolved to {shown.resolution:.2g} Hz)"
    return (
        f"'{shown.marker}' {'moves' if shown.unit == 'm' else 'changes'} most, "
        f"{with_unit(shown.size, shown.unit)} peak to peak{way}, "
        f"{rhythm}; {rests(shown)}; "
        f"{with_unit(shown.drift, shown.unit, 2)} from first to last sample; "
        f"{shown.rate:.4g} samples a second, {shown.gaps} gaps (longest {shown.gap:.3g} s), "
        f"{100 * shown.missing:.2g} % missing"
    )


def motion_lines(recording: Recording) -> tuple[str, ...]:
    """Return a line for each stream that moves, markers first: at most six."""
    ordered = {**recording.markers, **recording.contours, **recording.signals}
    lines = []
    for topic, stream in ordered.items():
        try:
            found = motion_in(topic, stream)
        except ComparisonError:  # it stands still
            continue
        lines.append(f"motion of {topic}: {motion_words(found)}")
    more = len(lines) - _LINES
    return (*lines[:_LINES], *([f"and {more} more streams that move"] if more > 0 else []))
