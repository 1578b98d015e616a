"""`validate align`: two files of one test, whose clocks know nothing of each other."""

from pathlib import Path
from typing import Literal

import numpy as np

from validate.cli.arguments import complain, pairs
from validate.cli.display import say
from validate.cli.recordings import written
from validate.errors import RecordingError, UsageError
from validate.places import try_file
from validate.recording.alignment import Offset, offset_by_correlation
from validate.recording.channels import channel
from validate.recording.events import offset_by_event
from validate.recording.mcap.write import write_recording
from validate.recording.readers import read_recording
from validate.recording.together import (
    ClockDrift,
    drift_of,
    require_other_topics,
    stretched_signal,
    together,
    with_drift,
)
from validate.recording.types import Signal
from validate.report.aligned import aligned
from validate.report.encode import png

Event = Literal["onset", "step"]


def align(
    files: tuple[Path, Path],
    out: Path,
    by: str,
    event: Event | None,
    within: float | None,
    *,
    straighten: bool,
) -> None:
    """Moves the streams of the second file onto the clock of the first and writes both."""
    try_file(out)
    one, other = (read_recording(file) for file in files)
    require_other_topics(one, other)
    ((known, moved),) = _single(by)
    reference, stream = channel(one, known), channel(other, moved)
    offset = _offset(reference, stream, event, within)
    drift = None if event else _drift(reference, stream, offset)
    _told(offset, drift, straighten=straighten)
    if straighten and drift is not None:
        offset = _offset(reference, stretched_signal(stream, drift), event, within)
    else:
        offset, drift = with_drift(offset, drift), None
    found = together(one, other, offset, drift, out.stem)
    write_recording(found, out)
    picture = out.with_name(f"{out.stem}-aligned.png")
    picture.write_bytes(png(aligned(reference, stream, (known, moved), offset.seconds)))
    say(f"{picture}: both channels on one clock: look at it", indent="  ")
    written(found, out)


def _single(by: str) -> list[tuple[str, str]]:
    found = list(pairs((by,), "--by").items())
    if not found[0][1]:
        raise UsageError(f"--by {by}: expected CHANNEL=CHANNEL, of the first and the second file")
    return found


def _offset(reference: Signal, stream: Signal, event: Event | None, within: float | None) -> Offset:
    if event:
        return offset_by_event(reference, stream, event)
    longest = float(max(np.ptp(reference.t), np.ptp(stream.t)))
    return offset_by_correlation(reference, stream, within or longest)


def _drift(reference: Signal, stream: Signal, offset: Offset) -> ClockDrift | None:
    try:
        return drift_of(reference, stream, offset)
    except RecordingError as error:
        say(f"drift: not known, half of the recording does not tell it ({error})", indent="  ")
        return None


def _told(offset: Offset, drift: ClockDrift | None, *, straighten: bool) -> None:
    say(
        f"offset: {offset.seconds:+.6g} s, sd {offset.sd:.2g} s, by {offset.method}; "
        f"{offset.count} samples meet the first file, {100 * offset.coverage:.0f} % of them",
        indent="  ",
    )
    if drift is None:
        return
    say(f"drift: {1e6 * drift.rate:+.4g} ppm, sd {1e6 * drift.sd:.2g} ppm", indent="  ")
    if drift.seen and not straighten:
        complain(
            f"the clocks run apart by {1e3 * drift.apart:.3g} ms over {drift.span:.4g} s, which "
            "stands in the offset's sd; --drift takes it out"
        )
