"""Time-stamp uncertainty of a moving measurement, u = sd_t |dy/dt|, and interpolation in time.

All samples of a stream lie off together by an uncertain clock, so this is a systematic part, which
averaging leaves.
"""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, RegistrationError
from validate.recording.clocks.alignment import RECORD
from validate.recording.types import Recording
from validate.register.observation import Deviation

SAME = 1e-9  # s: times that are one


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
            f"record '{RECORD}{topic}': sd '{record.get('sd')}' is not a time >= 0 s; run "
            f"`validate align` again"
        )
    return sd


def with_clock(found: Deviation, sd_t: float, speed: Floats) -> Deviation:
    """Return the deviation with sd_t s times the rms `speed` (any, c) unit/s among what points
    share."""
    seen = speed[np.isfinite(speed)]
    if len(seen) == 0:
        raise ComparisonError(
            f"{found.quantity}: the clock is uncertain by {sd_t:.3g} s, and too few samples show "
            f"how fast the value changes; record more samples"
        )
    moved = sd_t * float(np.sqrt(np.mean(seen**2)))
    return replace(found, systematic=float(np.hypot(found.systematic, moved)))


def interpolated(t: Floats, z: Floats, s: Floats) -> tuple[Floats, Floats]:
    """Samples z (nt, m) at t (nt,) s, NaN = not seen, at times s (n,) s; and the squares (m,) of
    the error that this makes, in z's unit.

    Linear between two samples, whose error is f''/2 (s - a)(b - s), with f'' by divided
    differences, noise included. Before the first and after the last sample there is none (NaN).
    """
    if len(t) < 3:  # no second difference to judge a straight line by
        apart = np.abs(np.subtract.outer(s, t))
        near = apart.min(axis=1)[:, None] <= SAME
        return np.where(near, z[apart.argmin(axis=1)], np.nan), np.zeros(z.shape[1])
    b = np.clip(np.searchsorted(t, s), 1, len(t) - 1)
    before, after = s - t[b - 1], t[b] - s
    w = (before / (t[b] - t[b - 1]))[:, None]
    w = np.where(np.abs(before)[:, None] <= SAME, 0.0, w)
    w = np.where(np.abs(after)[:, None] <= SAME, 1.0, w)
    slope = np.diff(z, axis=0) / np.diff(t)[:, None]
    bend = 2 * np.diff(slope, axis=0) / (t[2:] - t[:-2])[:, None]
    error = bend[np.clip(b - 1, 0, len(bend) - 1)] / 2 * (before * after)[:, None]
    error = np.where((w > 0) & (w < 1), error, 0.0)
    squared = np.nansum(error**2, axis=0) / np.maximum(np.isfinite(error).sum(axis=0), 1)
    shown = np.where(w == 0, z[b - 1], np.where(w == 1, z[b], (1 - w) * z[b - 1] + w * z[b]))
    return np.where((w < 0) | (w > 1), np.nan, shown), squared


def slopes(t: Floats, y: Floats, at: Ints, sd_t: float) -> Floats:
    """Least-squares slopes (k, c) of y (nt, c), NaN = not seen, about the samples `at` (k,).

    Over `sd_t` s on both sides, or to the next samples if those lie further off: noise then adds
    less to u_D than the measurement's own sd. NaN where fewer than two samples were seen.
    """
    return np.array([_slope(t[near], y[near]) for near in (around(t, i, sd_t) for i in at)])


def around(t: Floats, i: int, sd_t: float) -> slice:
    """Return the samples within `sd_t` s of t[i], at least the next ones at another time."""
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
