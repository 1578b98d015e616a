"""Channels of a recording by name, events in them (onset, step), and the offset of two clocks.

An onset is where a signal leaves its rest and begins to climb or fall; a step is where it crosses
the middle between two levels.

`force` is a signal of one column, `force.1` the second column of several, `markers.tip.z` a
marker's coordinate, `images.brightness` the mean grey level of each image (a flash) and
`images.change` the rms difference of each image from the one before (a motion). A leading `-`
turns the sign.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.optimize import minimize_scalar

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.clocks.alignment import MIN_COVERAGE, Offset, matched, noise_of
from validate.recording.types import Frames, Markers, Recording, Signal

_AXES = "xyz"
_OF_IMAGES = ("brightness", "change")


def channel(recording: Recording, name: str) -> Signal:
    """Return the channel as a signal (nt, 1), samples where nothing was seen left out.

    Raises `UsageError` with the channels that there are.
    """
    plain = name.removeprefix("-")
    topics = [t for t in recording.streams if plain == t or plain.startswith(f"{t}.")]
    if not topics:
        raise _unknown(recording, name)
    topic = max(topics, key=len)
    stream, rest = recording.streams[topic], plain[len(topic) + 1 :]
    found: Signal | None = None
    match stream:
        case Signal() if not rest and stream.y.shape[1] == 1:
            found = stream
        case Signal() if rest.isdecimal() and int(rest) < stream.y.shape[1]:
            found = replace(stream, y=stream.y[:, [int(rest)]])
        case Markers():
            marker, _, axis = rest.rpartition(".")
            axes = _AXES[: stream.x.shape[2]]
            if marker in stream.names and len(axis) == 1 and axis in axes:
                x = stream.x[:, stream.names.index(marker), axes.index(axis)]
                # Missing ones leave before a signal of finite numbers is made.
                seen = np.isfinite(x)
                found = Signal(stream.t[seen], x[seen, None], "m", stream.sd, stream.frame)
        case Frames() if rest == "brightness":
            found = _grey(stream.t, [image.mean() for image in stream.images])
        case Frames() if rest == "change" and len(stream.images) > 1:
            pairs = pairwise(stream.images)
            change = [np.sqrt(((b.astype(float) - a) ** 2).mean()) for a, b in pairs]
            found = _grey((stream.t[1:] + stream.t[:-1]) / 2, change)
    if found is None:
        raise _unknown(recording, name)
    seen = np.isfinite(found.y[:, 0])
    sign = -1.0 if name.startswith("-") else 1.0
    return replace(found, t=found.t[seen], y=sign * found.y[seen])


def _grey(t: Floats, values: list[float]) -> Signal:
    return Signal(t, np.array(values)[:, None], "grey level", 0.0, "image")


def _unknown(recording: Recording, name: str) -> UsageError:
    listed = ", ".join(n for topic in recording.streams for n in _names(recording, topic))
    return UsageError(f"{recording.name}: no channel '{name}'; there are {listed}")


def _names(recording: Recording, topic: str) -> list[str]:
    match recording.streams[topic]:
        case Signal() as s if s.y.shape[1] == 1:
            return [topic]
        case Signal() as s:
            return [f"{topic}.{i}" for i in range(s.y.shape[1])]
        case Markers() as m:
            return [f"{topic}.{m.names[0]}.x", f"... ({len(m.names)} markers)"]
        case Frames():
            return [f"{topic}.{what}" for what in _OF_IMAGES]
    return []


Kind = Literal["onset", "step"]
Window = tuple[float, float]
_SIGMAS = 6.0  # an event stands out of the noise by this many standard deviations
_MIN_SAMPLES = 8


def offset_by_event(
    reference: Signal,
    stream: Signal,
    kind: Kind,
    windows: tuple[Window | None, Window | None] = (None, None),
    min_coverage: float = MIN_COVERAGE,
) -> Offset:
    """Return the offset that brings the stream's event onto the reference's.

    `windows` are the times (s) between which each signal shows the event and nothing else, None:
    everywhere. Raises `RecordingError` where no or no single event is found, or coverage is small.
    """
    there, sd_there = event_time(reference, kind, windows[0])
    here, sd_here = event_time(stream, kind, windows[1])
    found = Offset(there - here, float(np.hypot(sd_there, sd_here)), f"event: {kind}", 0, 0.0)
    return matched(reference, stream, found, min_coverage)


def event_time(signal: Signal, kind: Kind, window: Window | None = None) -> tuple[float, float]:
    """Time and its standard uncertainty (s) of the event in a signal (nt, 1).

    Raises `RecordingError` for a flat signal, several steps, and an event at the edge.
    """
    if signal.y.shape[1] != 1:
        raise RecordingError(f"an event needs 1 column, the signal has {signal.y.shape[1]}")
    low, high = window or (signal.t[0], signal.t[-1])
    inside = (signal.t >= low) & (signal.t <= high)
    if inside.sum() < _MIN_SAMPLES:
        raise RecordingError(
            f"{int(inside.sum())} samples between {low:g} and {high:g} s; {_MIN_SAMPLES} are needed"
        )
    t, y = signal.t[inside], signal.y[inside, 0]
    return _onset(t, y, signal.unit) if kind == "onset" else _step(t, y, signal.unit)


def _step(t: Floats, y: Floats, unit: str) -> tuple[float, float]:
    """Middle crossing; with samples on the flank by a line through them, else between two."""
    part = max(2, len(y) // 5)
    low, high = float(np.median(y[:part])), float(np.median(y[-part:]))
    noise = noise_of(np.concatenate([y[:part] - low, y[-part:] - high]))
    _require_height(high - low, noise, unit)
    level = (y - low) / (high - low)
    above = level > 0.5
    crossings = np.flatnonzero(np.diff(above.astype(int)))
    if len(crossings) != 1:
        raise RecordingError(
            f"{len(crossings)} crossings of the middle between {low:.4g} and {high:.4g} {unit}; "
            "give a window with a single step"
        )
    i = int(crossings[0])
    flank = np.flatnonzero((level > 0.2) & (level < 0.8))
    if len(flank) < 3 or np.ptp(flank) + 1 != len(flank):
        # Where a line from sample i to the next crosses; the step may be anywhere between them.
        gap = float(t[i + 1] - t[i])
        part = (0.5 - level[i]) / (level[i + 1] - level[i])
        return float(t[i] + part * gap), gap / float(np.sqrt(12))
    # Zero of the line through y(t), sd from the larger of the noise and what a cubic leaves.
    t = t[flank]
    y = level[flank] - 0.5
    noise = noise / abs(high - low)
    x = t - t.mean()
    slope, height = np.polyfit(x, y, 1)
    if len(t) >= _MIN_SAMPLES:
        left = y - np.polyval(np.polyfit(x, y, 3), x)
        noise = max(noise, float(np.sqrt(left @ left / (len(t) - 4))))
    zero = -height / slope
    spread = float(x @ x)
    sd = noise / abs(slope) * float(np.sqrt(1 / len(t) + zero**2 / spread))
    return float(t.mean() + zero), sd


def _onset(t: Floats, y: Floats, unit: str) -> tuple[float, float]:
    """Corner of rest and climb: y = a + b max(0, t - t0) by least squares near where it leaves."""
    noise = noise_of(y[: max(4, len(y) // 10)])
    base = float(np.median(y[: max(4, len(y) // 10)]))
    _require_height(float(np.abs(y - base).max()), noise, unit)
    out = np.abs(y - base) > max(_SIGMAS * noise, 1e-9 * float(np.abs(y - base).max()))
    first = int(np.argmax(out))
    stop = min(len(y), first + max(12, first // 4))
    if first < 4 or stop - first < 4:
        raise RecordingError(
            f"the event is at the edge: {first} samples before it, {len(y) - first} after; give a "
            "window with more rest before it"
        )
    # The corner with the least squares left, its sd from the slopes of all three unknowns.
    t = t[:stop]
    y = y[:stop]
    start = float(t[first])
    low, high = float(t[2]), min(float(t[-3]), start + 0.5 * float(t[-1] - start))
    tries = np.linspace(low, high, 4 * len(t))
    best = float(tries[np.argmin([_bent(t, y, x)[0] for x in tries])])
    reach = 2 * float(tries[1] - tries[0])
    found = minimize_scalar(
        lambda x: _bent(t, y, x)[0], bounds=(best - reach, best + reach), method="bounded",
        options={"xatol": 1e-6 * reach},
    )  # fmt: skip
    t0 = float(found.x)
    squares, b = _bent(t, y, t0)
    slopes = np.column_stack([np.ones_like(t), np.maximum(0.0, t - t0), -b * (t > t0)])
    covariance = np.linalg.pinv(slopes.T @ slopes) * squares / (len(t) - 3)
    return t0, float(np.sqrt(covariance[2, 2]))


def _bent(t: Floats, y: Floats, t0: float) -> tuple[float, float]:
    """Sum of squares that a + b max(0, t - t0) leaves, and b."""
    climb = np.maximum(0.0, t - t0)
    across, up = climb - climb.mean(), y - y.mean()
    b = float(across @ up) / max(float(across @ across), 1e-300)
    return float(np.sum((up - b * across) ** 2)), b


def _require_height(height: float, noise: float, unit: str) -> None:
    if abs(height) <= _SIGMAS * noise or height == 0:
        raise RecordingError(
            f"no event: the signal changes by {abs(height):.3g} {unit}, its noise is {noise:.3g}; "
            "give a window with the event or take another stream"
        )
