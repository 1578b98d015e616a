"""`validate align`: clock offset between recordings of one test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.commands.arguments import complain, pairs
from validate.commands.display import say
from validate.commands.recordings import written
from validate.errors import RecordingError, UsageError
from validate.places import try_file
from validate.recording.clocks.alignment import MIN_CORRELATION, Offset, correlation_at
from validate.recording.clocks.events import channel, offset_by_event
from validate.recording.mcap.write import write_recording
from validate.recording.merge import (
    ClockDrift,
    Moved,
    drift_of,
    require_other_topics,
    stretched_signal,
    together,
    with_drift,
)
from validate.recording.readers import read_recording
from validate.recording.types import Signal
from validate.report.charts.clock_alignment import aligned
from validate.report.charts.style import png


@dataclass(frozen=True)
class HowAligned:
    """Settings of an alignment: by an `event`, or by correlation `within` s (None: full length).

    At least `correlation` (-1..1), and the share `coverage` of samples that meet, are needed;
    `straighten` takes a drift out.
    """

    event: Literal["onset", "step"] | None
    within: float | None
    correlation: float
    coverage: float
    straighten: bool


@dataclass(frozen=True)
class _Pair:
    """One channel of the first file and one of a further file, with their names."""

    file: Path
    names: tuple[str, str]
    reference: Signal
    stream: Signal


def align(files: Sequence[Path], out: Path, by: Sequence[str], wanted: HowAligned) -> None:
    """Moves the streams of all further files onto the clock of the first and writes them all.

    Every file is tried; where one cannot be aligned, nothing is written.
    """
    # What only a correlation has is refused beside an event, which would not look at it
    given = {"--within": wanted.within is not None, "--drift": wanted.straighten,
             "--correlation": wanted.correlation != MIN_CORRELATION}  # fmt: skip
    if wanted.event and any(given.values()):
        said = ", ".join(name for name, is_given in given.items() if is_given)
        raise UsageError(f"--event {wanted.event}: {said} belongs to the correlation; leave it out")
    try_file(out)
    # What moves alike in the first file and each further one
    if len(files) < 2:
        raise UsageError(f"align: {len(files)} file; give at least 2")
    if len(by) != len(files) - 1:
        raise UsageError(
            f"--by: {len(by)} given for {len(files) - 1} further files; give one for each, in "
            "the order of the files"
        )
    for text in by:
        if not all(map(str.strip, text.partition("="))):
            raise UsageError(
                f"--by {text}: expected CHANNEL=CHANNEL, a channel of the first and one of a "
                f"further file"
            )
    named = [next(iter(pairs((text,), "--by").items())) for text in by]
    for file in files[1:]:
        if file.exists() and files[0].exists() and file.samefile(files[0]):
            raise UsageError(f"align: {file} is given twice; name another recording")
    first, *others = (read_recording(file) for file in files)
    require_other_topics([first, *others])
    found, refused = list[Moved](), list[str]()
    taken = list[_Pair]()
    for file, other, names in zip(files[1:], others, named, strict=True):
        pair = _Pair(file, names, channel(first, names[0]), channel(other, names[1]))
        try:
            pair, offset, drift = _aligned(pair, wanted, several=len(others) > 1)
        except RecordingError as error:
            refused.append(f"{file.name}: {error}" if len(others) > 1 else str(error))
            continue
        found.append(Moved(other, offset, drift))
        taken.append(pair)
    if refused:
        raise RecordingError("; ".join(refused))
    whole = together(first, found, out.stem)
    write_recording(whole, out)
    for pair, one in zip(taken, found, strict=True):
        # The picture of both channels on one clock, beside what was written
        own = f"-{pair.file.stem}" if len(others) > 1 else ""
        picture = out.with_name(f"{out.stem}{own}-aligned.png")
        drawing = aligned(pair.reference, pair.stream, pair.names, one.offset.seconds)
        picture.write_bytes(png(drawing))
        say(f"{picture}: both channels on one clock; check it", indent="  ")
    written(whole, out)


def _aligned(
    pair: _Pair, wanted: HowAligned, *, several: bool
) -> tuple[_Pair, Offset, ClockDrift | None]:
    """The pair as it is written, its offset, and the drift that is taken out; all are told."""
    offset = _offset(pair.reference, pair.stream, wanted)
    prefix = f"{pair.file.name}: " if several else ""
    drift = None
    if not wanted.event:
        try:
            drift = drift_of(pair.reference, pair.stream, offset)
            rate = f"{1e6 * drift.rate:+.4g} ppm, sd {1e6 * drift.sd:.2g} ppm"
        except RecordingError as error:
            rate = f"not known: half of the recording is not enough ({error})"
        say(f"{prefix}drift: {rate}", indent="  ")
    if drift is not None and wanted.straighten:
        pair = replace(pair, stream=stretched_signal(pair.stream, drift))
        offset = _offset(pair.reference, pair.stream, wanted)
    elif drift is not None and drift.seen:
        offset = with_drift(offset, drift)
        complain(
            f"{prefix}the clocks drift by {1e3 * drift.apart:.3g} ms over {drift.span:.4g} s; "
            "the offset's sd includes this drift. --drift corrects it"
        )
    together = correlation_at(pair.reference, pair.stream, offset.seconds)
    say(
        f"{prefix}offset: {offset.seconds:+.6g} s, sd {offset.sd:.2g} s, by {offset.method}; "
        f"{offset.count} samples ({100 * offset.coverage:.0f} %) lie within the first file's time; "
        f"correlation {together:.3f}",
        indent="  ",
    )
    return pair, offset, drift if wanted.straighten else None


def _offset(reference: Signal, stream: Signal, wanted: HowAligned) -> Offset:
    if wanted.event:
        return offset_by_event(reference, stream, wanted.event, min_coverage=wanted.coverage)
    longest = float(max(np.ptp(reference.t), np.ptp(stream.t)))
    within = wanted.within or longest
    return Offset.by_correlation(reference, stream, within, wanted.coverage, wanted.correlation)
