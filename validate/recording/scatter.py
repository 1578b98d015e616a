"""Scatter of repeated tests as uncertainty of their mean recording."""

import math

from validate.errors import RecordingError
from validate.recording.types import Recording

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
