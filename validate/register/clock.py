"""What an uncertain clock makes of a measurement that moves: u = sd_t |dy/dt|, in u_D.

All samples of a stream lie off together, so this is a systematic part, which averaging leaves.
"""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, RegistrationError
from validate.recording.alignment import RECORD
from validate.recording.types import Recording
from validate.register.observation import Deviation


def clock_sd(recording: Recording, topic: str) -> float:
    """Standard uncertainty s of a stream's clock, 0 where it was never moved against the others.

    Raises `RegistrationError` for a record without a number of at least 0.
    """
    record = recording.metadata.get(RECORD + topic)
    if record is None:
        return 0.0
    try:
        sd = float(record.get("sd", ""))
    except ValueError:
        sd = -1.0
    if not (np.isfinite(sd) and sd >= 0):
        raise RegistrationError(
            f"record '{RECORD}{topic}': sd '{record.get('sd')}' is not a time >= 0 s; align anew"
        )
    return sd


def with_clock(found: Deviation, sd_t: float, speed: Floats) -> Deviation:
    """The deviation with sd_t s times the rms `speed` (any, c) unit/s among what points share."""
    seen = speed[np.isfinite(speed)]
    if len(seen) == 0:
        raise ComparisonError(
            f"{found.quantity}: a clock uncertain by {sd_t:.3g} s, and too few samples to tell how "
            "fast it moves; record more of them"
        )
    moved = sd_t * float(np.sqrt(np.mean(seen**2)))
    return replace(found, systematic=float(np.hypot(found.systematic, moved)))


def slopes(t: Floats, y: Floats, at: Ints, sd_t: float) -> Floats:
    """Least-squares slopes (k, c) of y (nt, c), NaN = not seen, about the samples `at` (k,).

    Over `sd_t` s on both sides, or to the next samples if those lie further off: noise then adds
    less to u_D than the measurement's own sd. NaN where fewer than two samples were seen.
    """
    return np.array([_slope(t[near], y[near]) for near in (around(t, i, sd_t) for i in at)])


def around(t: Floats, i: int, sd_t: float) -> slice:
    """The samples within `sd_t` s of t[i], at least the next ones at another time."""
    first = np.searchsorted(t, min(t[i] - sd_t, t[np.searchsorted(t, t[i]) - 1]))
    after = min(int(np.searchsorted(t, t[i], "right")), len(t) - 1)
    last = np.searchsorted(t, max(t[i] + sd_t, t[after]), "right")
    return slice(int(first), int(last))


def _slope(t: Floats, y: Floats) -> Floats:
    seen = np.isfinite(y)
    count = np.maximum(seen.sum(axis=0), 1)
    off = np.where(seen, t[:, None] - (t[:, None] * seen).sum(axis=0) / count, 0.0)
    spread = (off**2).sum(axis=0)
    rise = (off * np.where(seen, y, 0.0)).sum(axis=0)
    return np.where(spread > 0, rise / np.where(spread > 0, spread, 1.0), np.nan)
