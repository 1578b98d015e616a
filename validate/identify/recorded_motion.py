"""Motion of a recording: amplitude, direction, frequencies and decay, rest intervals, gaps.

The motion is that of the marker that moves most, along the direction in which it moves most (the
first principal axis of its displacements); of outlines that of places at every 10 degrees about
the centroid, along their normals; of a signal that of its channels. From it and the body's first
natural frequency follows whether inertia matters: statics answers at once, and is off by (f /
f_1)^2 of what moves at f (Clough & Penzien 1993, eq. 3-14): by a tenth at a third of the first
mode.

Frequency and damping of a free decay, by separable least squares.

y = a + b t + c t^2 + exp(-d t) (p cos w t + s sin w t): the five factors are linear and solved
for at every w and d (variable projection, Golub & Pereyra 1973), so that only two are searched,
from the highest peak of the spectrum. A slow creep is the parabola's, not the ringing's.

The standard deviations are those of the fit, widened by what its residuals remember from sample
to sample: n (1 - r) / (1 + r) of n samples are independent, r their correlation at one sample.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.optimize import least_squares

from validate.arrays import Floats
from validate.errors import ComparisonError
from validate.recording.types import Contours, Markers, Recording, Signal
from validate.register.outlines.outlines import EVERY_TEN, along_normals, outline_places

_PERIODS = 3.0  # fewer tell no damping from creep
_LINEAR = 5
_RING_PADDED = 8  # times as long for the spectrum's peak


@dataclass(frozen=True)
class Ringing:
    """Frequency Hz of the damped oscillation and its ratio of critical damping, with standard
    deviations; `periods` were seen."""

    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float
    periods: float

    @classmethod
    def of(cls, t: Floats, y: Floats) -> Self:
        """Of y (nt,) at times t (nt,) s; gaps are left out by the caller.

        Raises `ComparisonError` for fewer than three periods, too few samples, and what does not
        ring.
        """
        if len(t) < 4 * _LINEAR:
            raise ComparisonError(f"{len(t)} samples of ringing; at least {4 * _LINEAR} are needed")
        t = t - t[0]
        f0 = _peak(t, y)
        if f0 * t[-1] < _PERIODS:
            raise ComparisonError(
                f"{f0 * t[-1]:.1f} periods of ringing in {t[-1]:.2f} s: {_PERIODS:g} are needed; "
                "record longer"
            )
        w0 = 2 * np.pi * f0
        start = [w0, 0.05 * w0]
        found = least_squares(_left, start, x_scale=start, args=(t, y), ftol=1e-12, xtol=1e-12)
        w, d = (float(x) for x in found.x)
        if not (found.success and 0.5 * w0 < w < 2 * w0):
            raise ComparisonError(f"no ringing near {f0:.2f} Hz was found: {found.message}")
        # Standard deviations of w and d (1/s each) of residuals whose neighbours are correlated.
        left, slope = found.fun, np.asarray(found.jac)
        squares = float(left @ left)
        r = float(np.clip(left[1:] @ left[:-1] / squares, 0.0, 1.0)) if squares else 0.0
        freedom = max(len(left) * (1 - r) / (1 + r) - _LINEAR - 2, 1.0)
        variances = squares / freedom * np.diag(np.linalg.pinv(slope.T @ slope))
        sd_w, sd_d = np.sqrt(variances).tolist()
        whole = np.hypot(w, d)
        return cls(
            w / (2 * np.pi), sd_w / (2 * np.pi), d / whole, sd_d / whole, w * t[-1] / (2 * np.pi)
        )

    @staticmethod
    def spectrum(t: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Frequencies (nf,) Hz and amplitudes (nf,) in y's unit of y (nt,) less its parabola, under
        Hann's window, on the mean step of t."""
        z = y - np.polyval(np.polyfit(t, y, 2), t)
        window = np.hanning(len(z))
        n = _RING_PADDED * len(z)
        step = float(np.diff(t).mean())
        amplitude = 2 * np.abs(np.fft.rfft(window * z, n)) / window.sum()
        return np.asarray(np.fft.rfftfreq(n, step)), np.asarray(amplitude, dtype=np.float64)


def _peak(t: Floats, y: Floats) -> float:
    f, amplitude = Ringing.spectrum(t, y)
    return float(f[amplitude.argmax()])


def _left(p: Floats, t: Floats, y: Floats) -> Floats:
    """What the best linear factors leave of y."""
    fade = np.exp(-p[1] * t)
    basis = np.stack(
        [np.ones_like(t), t, t**2, fade * np.cos(p[0] * t), fade * np.sin(p[0] * t)], axis=1
    )
    factors = np.linalg.lstsq(basis, y, rcond=None)[0]
    return np.asarray(basis @ factors - y)


FRACTION = 1 / 3  # of the first mode: statics is off by a tenth of what moves there
_SHARE = 0.02  # of the whole motion: less above that frequency is no reason for dynamics
_ABOVE_NOISE = 3.0
_FEWEST = 16  # samples of a spectrum
_SMOOTH = 10  # samples a period from which neighbours tell the noise
_GAP = 1.5  # median intervals: a longer one is a gap
_STILL = 0.01  # of the whole motion: within it the body rests
_RISE = (0.02, 0.3)  # of the first swing: where its start is read off
_PADDED = 8
_AXES = "xyz"


@dataclass(frozen=True)
class RecordedMotion:
    """Displacements `y` (nt,) m at `t` (nt,) s of `marker` along `direction` (d,), since the first
    sample; `noise` m, `frequency` Hz of the largest peak of its spectrum, `resolution` Hz. Of a
    signal, which is a "marker" of its own, y and noise are in its `unit`.

    It stands still from the first sample until `rests_until` s and from `rests_from` s to the last
    one (None: not at all); `starts` s is the instant of rest that its first swing begins at. From
    the first to the last sample it drifts by `drift` m. The longest interval is `gap` s, `gaps` are
    longer than 1.5 usual ones, and in a share `missing` of the samples it was not seen.
    """

    marker: str
    direction: Floats
    t: Floats
    y: Floats
    noise: float
    frequency: float
    resolution: float
    starts: float
    rests_until: float | None
    rests_from: float | None
    gap: float
    gaps: int
    missing: float
    ringing: Ringing | None
    unit: str = "m"

    @property
    def axis(self) -> str:
        """The axis that lies nearest to the direction."""
        return _AXES[int(np.abs(self.direction).argmax())]

    @property
    def size(self) -> float:
        """Peak to peak of the whole recording, noise included, m."""
        return float(np.ptp(self.y))

    @property
    def drift(self) -> float:
        return float(self.y[-1] - self.y[0])

    @property
    def rate(self) -> float:
        """Samples a second."""
        return float(1 / np.median(np.diff(self.t)))

    def above(self, frequency: float) -> float:
        """Rms m of what moves at this frequency Hz or faster, less what noise explains there."""
        if self.resolution == 0 or frequency >= self.rate / 2:
            return 0.0
        t, y = _even(self.t, self.y)
        z = y - np.interp(t, [t[0], t[-1]], [y[0], y[-1]])  # ends that meet do not leak
        power = 2 * np.abs(np.fft.rfft(z) / len(z)) ** 2
        kept = np.fft.rfftfreq(len(z), float(t[1] - t[0])) >= frequency
        noise = self.noise**2 * kept.sum() / len(kept)
        return float(np.sqrt(max(power[kept].sum() - _ABOVE_NOISE**2 * noise, 0.0)))

    def inertia_matters(self, first: float | None) -> bool:
        """Return whether statics misses a part of this motion of a body with its first natural
        frequency at `first` Hz; unknown: whether it rings down."""
        if first is None:
            found = self.ringing
            return found is not None and 0.002 < found.damping < 0.5 and (
                found.damping > 3 * found.damping_sd
            )  # fmt: skip
        return self.above(FRACTION * first) > _SHARE * self.size


def motion_of(recording: Recording, topic: str | None) -> RecordedMotion:
    """Return the motion of a topic; none: of the first markers, else signal in m, else outlines.

    Raises `ComparisonError` where there are none, or nothing moves.
    """
    if topic is None:
        lengths = [t for t, s in recording.signals.items() if s.unit == "m"]
        topics = (*recording.markers, *lengths, *recording.contours)
        if not topics:
            raise ComparisonError(
                f"{recording.name}: it has no markers, no signal in m and no outlines, so no "
                "motion is recorded"
            )
        topic = topics[0]
    if topic not in recording.streams:
        raise ComparisonError(f"no stream '{topic}'; it has {sorted(recording.streams)}")
    return motion_in(topic, recording.streams[topic])


def motion_in(topic: str, stream: object) -> RecordedMotion:
    """Return the motion of one stream; raises `ComparisonError` for images, and where nothing
    moves."""
    if isinstance(stream, Markers):
        named = {name: stream.x[:, j] for j, name in enumerate(stream.names)}
        return recorded_motion(stream.t, named, stream.sd)
    if isinstance(stream, Signal):
        names = (topic, *(f"{topic}, channel {c + 1}" for c in range(1, stream.y.shape[1])))
        named = {name: stream.y[:, [c]] for c, name in enumerate(names)}
        return replace(recorded_motion(stream.t, named, stream.sd), unit=stream.unit)
    if isinstance(stream, Contours):
        moved = along_normals(stream.outlines[0], stream.outlines, EVERY_TEN)
        named = dict(zip(outline_places(EVERY_TEN), moved.transpose(1, 0, 2), strict=True))
        return recorded_motion(stream.t, named, stream.sd)
    raise ComparisonError(f"'{topic}': images have no motion as they are; find outlines in them")


def recorded_motion(t: Floats, moved: Mapping[str, Floats], noise: float = 0.0) -> RecordedMotion:
    """Of displacements (nt, d) m by name at t (nt,) s, NaN = not seen; a signal is one of d = 1.

    `noise` is the declared standard deviation. It is used as it is where the motion has fewer than
    ten samples a period: differences of neighbours are the motion itself there, not its noise.
    Raises `ComparisonError` where nothing was seen twice.
    """
    sizes = {name: _extent(x) for name, x in moved.items()}
    name = max(sizes, key=lambda n: sizes[n], default="")
    if not name or not sizes[name] > 0:
        raise ComparisonError("the recording has no motion: none of its markers is seen twice")
    x = moved[name]
    seen = np.isfinite(x).all(axis=1)
    t_all, t, x = t, t[seen], x[seen]
    # The unit vector (d,) along which x (nt, d) varies most, its largest part positive.
    _, _, V = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)
    along = V[0]
    direction = np.asarray(along * np.sign(along[np.abs(along).argmax()]))
    y = (x - x[0]) @ direction
    steps = np.diff(t)
    usual = float(np.median(np.diff(t_all)))
    # Frequency of the spectrum's largest peak and its resolution, Hz; zeros where none is.
    if len(t) < _FEWEST:
        frequency, resolution = 0.0, 0.0
    else:
        f, amplitude = Ringing.spectrum(*_even(t, y))
        frequency, resolution = float(f[amplitude.argmax()]), float(1 / (t[-1] - t[0]))
    coarse = noise > 0 and frequency * usual * _SMOOTH > 1
    # How it rings after its largest excursion.
    after = int(np.abs(y - np.median(y)).argmax())
    try:
        rings = Ringing.of(*_even(t[after:], y[after:]))
    except (ComparisonError, ValueError, np.linalg.LinAlgError):
        rings = None
    found = noise
    if not coarse and len(y) >= _FEWEST:
        # From fourth differences: a smooth motion has small ones.
        found = max(noise, float(1.4826 * np.median(np.abs(np.diff(y, n=4))) / np.sqrt(70)))
    starts = _starts(t, y, found)
    # Until when it stays within a hundredth of the motion about its start, or within noise.
    first = int((np.abs(y - y[0]) > max(6 * found, _STILL * np.ptp(y))).argmax())
    held_until = float(t[first - 1]) if first > 1 else None
    # From when it stays within a hundredth of the motion of where it ends, for a tenth of the
    # time at least.
    late = t[-1] - 0.1 * (t[-1] - t[0])
    tail = y[t >= late]
    near = np.abs(y - np.median(tail)) <= max(4 * found, _STILL * np.ptp(y))
    away = np.flatnonzero(~near)
    start = t[0] if not len(away) else t[min(away[-1] + 1, len(t) - 1)]
    return RecordedMotion(
        name, direction, t, y, found, frequency, resolution,
        _released(t, y, starts, rings) if rings else starts, held_until,
        float(start) if start <= late else None, float(steps.max()),
        int((steps > _GAP * usual).sum()), float(1 - seen.mean()), rings,
    )  # fmt: skip


def _extent(x: Floats) -> float:
    seen = x[np.isfinite(x).all(axis=1)]
    return float(np.linalg.norm(np.ptp(seen, axis=0))) if len(seen) > 1 else 0.0


def _even(t: Floats, y: Floats) -> tuple[Floats, Floats]:
    """On as many evenly spaced times."""
    at = np.linspace(t[0], t[-1], len(t))
    return at, np.interp(at, t, y)


def _starts(t: Floats, y: Floats, noise: float) -> float:
    """The last instant of rest: the first swing rises as (t - t_0)^2, and its root is a line."""
    away = np.abs(y - y[0])
    size = float(away.max())
    least = max(5 * noise, _RISE[0] * size)
    first = int(np.argmax(away > least))
    peak = first + int(np.argmax(np.diff(away[first:], append=0.0) <= 0))
    low = max(5 * noise, _RISE[0] * away[peak])
    rise = np.flatnonzero((away[: peak + 1] > low) & (away[: peak + 1] < _RISE[1] * away[peak]))
    rise = rise[rise >= first - 1]
    if len(rise) < 2:
        return float(t[max(first - 1, 0)])
    slope, offset = np.polyfit(t[rise], np.sqrt(away[rise]), 1)
    at = -offset / slope if slope > 0 else t[first]
    return float(np.clip(at, t[0], t[first]))


def _released(t: Floats, y: Floats, starts: float, rings: Ringing) -> float:
    """The start again, of a body let go: its mode begins at an extreme, without velocity. It is the
    extreme of the fitted ring-down that is nearest, if within a quarter of a period."""
    w = 2 * np.pi * rings.frequency
    d = w * rings.damping / np.sqrt(1 - min(rings.damping, 0.9) ** 2)
    after = t > starts + 0.5 / rings.frequency
    if after.sum() < _FEWEST:
        return starts
    tau = t[after] - starts
    fade = np.exp(-d * tau)
    basis = np.stack(
        [np.ones_like(tau), tau, fade * np.cos(w * tau), fade * np.sin(w * tau)], axis=1
    )
    _, _, p, s = np.linalg.lstsq(basis, y[after], rcond=None)[0]
    # d/dt of exp(-d t)(p cos w t + s sin w t) vanishes where tan(w t) = (w s - d p) / (w p + d s).
    at = np.arctan2(w * s - d * p, w * p + d * s) / w
    at = (at + 0.25 / rings.frequency) % (0.5 / rings.frequency) - 0.25 / rings.frequency
    return float(max(starts + at, t[0]))
