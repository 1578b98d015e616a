"""Clock offset between two streams: search of the lag, its refinement, and a stream shifted by it.

It stands on the recording floor because clocks are mended before anything is registered or
compared. An offset is what must be *added* to a stream's times to bring them onto the reference's
clock. Nothing is moved without saying so: `shift` writes the record `clock_offset/<topic>`.

Method: masked normalised cross-correlation finds the lag (Padfield 2012, IEEE Trans. Image
Process. 21, eqs. 10-12, in one dimension); the slope of the correlation is then brought to zero
between the samples. Its curvature there and the residual noise give the standard uncertainty.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.types import GAP_FACTOR, Recording, Signal, Stream, by_kind

MIN_CORRELATION = 0.5  # two streams below it do not show one motion
AMBIGUITY = 2.0  # a lag whose unexplained share is below this many times the best one's is a rival
MAX_GRID = 2**21  # samples of the common grid
MIN_MATCHED = 10
SMOOTHING = 6.0  # samples of the slower stream, width of the Gaussian before the slope
FLOOR = 1e-3  # samples of the slower stream, what interpolation without noise is off
_MAX_STEPS = 50
_TRIES = 9
_NEIGHBOURS = 4

Bools = NDArray[np.bool_]


def coarse_lag(
    reference: Signal,
    stream: Signal,
    step: float,
    within: float,
    min_coverage: float,
    min_correlation: float = MIN_CORRELATION,
) -> float:
    """Return the lag (s) of the highest correlation on a grid of `step` s, when it is the only
    one."""
    a, a_seen = _on_grid(reference, step)
    b, b_seen = _on_grid(stream, step)
    start = float(reference.t[0] - stream.t[0])
    reach = int(np.ceil((within + abs(start)) / step)) + 1
    lags = np.arange(-min(reach, len(b)), min(reach, len(a)) + 1)
    # Correlation and overlap of b(i) with a(i + lag), means and variances over the overlap.
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(a) + len(b), real=True)
    A, A1, A2 = (rfft(x, size) for x in (a, a_seen, a * a))
    B, B1, B2 = (np.conj(rfft(x, size)) for x in (b, b_seen, b * b))

    def over(x: NDArray[np.complex128], y: NDArray[np.complex128]) -> Floats:
        return np.asarray(irfft(x * y, size), dtype=np.float64)[lags % size]

    n = np.maximum(np.rint(over(A1, B1)), 0.0)
    safe = np.maximum(n, 1.0)
    sum_a, sum_b = over(A, B1), over(A1, B)
    var_a = over(A2, B1) - sum_a**2 / safe
    var_b = over(A1, B2) - sum_b**2 / safe
    scale = np.sqrt(np.maximum(var_a, 0) * np.maximum(var_b, 0))
    top = over(A, B) - sum_a * sum_b / safe
    enough = scale > 1e-9 * np.sqrt(float(a @ a) * float(b @ b))
    found = np.divide(top, scale, out=np.zeros_like(top), where=enough)
    correlation, overlap = np.clip(found, -1.0, 1.0), n
    tau = start + lags * step
    usable = (np.abs(tau) <= within + step) & (overlap >= min_coverage * b_seen.sum())
    if usable.sum() < 3:
        best = 100 * float(overlap[np.abs(tau) <= within + step].max(initial=0)) / b_seen.sum()
        raise RecordingError(
            f"within {within:g} s the streams overlap by {best:.0f} % at most; at least "
            f"{100 * min_coverage:.0f} % are needed; widen the search (--within) or record "
            "longer together"
        )
    return _only_peak(tau[usable], correlation[usable], within, min_correlation)


def _only_peak(tau: Floats, correlation: Floats, within: float, least: float) -> float:
    peak = int(np.argmax(correlation))
    best = float(correlation[peak])
    if best < least:
        raise RecordingError(
            f"the streams correlate by {best:.2f} at most (at {tau[peak]:+.4g} s); at least "
            f"{least:g} is needed; widen the search (--within), align them by a "
            "marked event (--event), or lower the limit (--correlation)"
        )
    rivals = 1 - correlation**2 <= AMBIGUITY * (1 - best**2) + 1e-9
    rivals &= correlation > 0
    if rivals[0] or rivals[-1]:
        raise RecordingError(
            f"ambiguous: correlation {best:.3f} at {tau[peak]:+.4g} s reaches the edge of the "
            f"search ({tau[0]:+.4g}..{tau[-1]:+.4g} s), as for ramps or for an offset beyond "
            f"{within:g} s; widen the search (--within) or align by a marked event (--event)"
        )
    at = np.flatnonzero(rivals)
    if (np.diff(at) > 1).any():
        # Which lags are not in one run with the peak.
        runs = np.concatenate([[0], np.cumsum(np.diff(at) > 1)])
        found: Bools = runs != runs[np.searchsorted(at, peak)]
        other = at[np.argmax(np.where(found, correlation[at], -1))]
        raise RecordingError(
            f"ambiguous: correlation {best:.3f} at {tau[peak]:+.4g} s and {correlation[other]:.3f} "
            f"at {tau[other]:+.4g} s, as in periodic signals; narrow the search (--within) or "
            "align by a marked event (--event)"
        )
    return float(tau[peak])


def _on_grid(signal: Signal, step: float) -> tuple[Floats, Floats]:
    """Values less their mean on a grid from the first sample, 0 in gaps, and 1 where seen."""
    t = signal.t - signal.t[0]
    count = int(t[-1] / step) + 1
    if count > MAX_GRID:
        raise RecordingError(
            f"{count} samples of {step:.3g} s, the limit is {MAX_GRID}; shorten the recording"
        )
    grid = np.arange(count, dtype=np.float64) * step
    seen = met(t, grid).astype(np.float64)
    return (np.interp(grid, t, signal.y[:, 0]) - signal.y.mean()) * seen, seen


def refined_lag(known: Signal, seen: Signal, start: float) -> tuple[float, float]:
    """Offset of `seen` against `known` and its sd (s), to a small part of a sample.

    Solves sum g (y - a - b x(t + tau)) = 0 for tau: x interpolates the samples of `known`, g is
    their smoothed slope without its parts along 1 and the smoothed signal, so that errors of a and
    b do not count. Least squares itself would be drawn to the samples, where interpolation keeps
    most noise.
    """
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import gaussian_filter1d

    times, values = _distinct(known)
    x_of = CubicSpline(times, values)
    width = max(step_of(known.t), step_of(seen.t))
    # The reference and its slope (1/s) on a grid, under a Gaussian.
    spacing = step_of(times)
    grid = np.arange(times[0], times[-1] + spacing, spacing)
    even, sigma = np.interp(grid, times, values), SMOOTHING * width / spacing
    smooth = gaussian_filter1d(even, sigma, mode="nearest")
    slope = gaussian_filter1d(even, sigma, order=1, mode="nearest") / spacing
    usable = np.all([met(known.t, seen.t + start + w) for w in (-2 * width, 2 * width)], axis=0)
    if usable.sum() < MIN_MATCHED:
        raise RecordingError(
            f"{int(usable.sum())} samples lie within the reference; {MIN_MATCHED} are needed"
        )
    t, y = seen.t[usable], seen.y[usable, 0]
    tries = np.linspace(-width, width, _TRIES)
    tau = start
    for _ in range(_MAX_STEPS):
        along = np.column_stack([np.ones_like(t), np.interp(t + tau, grid, smooth)])
        # x less its least-squares parts along the columns.
        x = np.interp(t + tau, grid, slope)
        g = np.asarray(x - along @ np.linalg.lstsq(along, x, rcond=None)[0])
        left = np.stack([_left(along, x_of(t + tau + x), y) for x in tries])
        falls, at_zero = np.polyfit(tries, left @ g, 1)
        if not falls < 0:
            break
        step = float(np.clip(-at_zero / falls, -width, width))
        tau += step
        # The sd of sum g e, of noise e like `left`, whose neighbours may be correlated.
        left = left.mean(axis=0)
        count = len(left) - 3
        alone = float(left @ left) / count * float(g @ g)
        near = sum(
            float(left[:-k] @ left[k:]) / count * float(g[:-k] @ g[k:])
            for k in range(1, _NEIGHBOURS)
        )
        sd = float(np.sqrt(max(alone + 2 * near, 0.5 * alone))) / abs(float(falls))
        if abs(step) < 1e-4 * width + 0.05 * sd:
            return tau, float(np.hypot(sd, FLOOR * width))
        if abs(tau - start) > 2 * width:
            break
    raise RecordingError(
        f"no best offset near {start:+.4g} s: the streams do not follow each other there; align "
        "them by a marked event"
    )


def correlation_at(reference: Signal, stream: Signal, seconds: float) -> float:
    """How the stream (nt, 1), moved by `seconds` s, correlates with the reference where they meet.

    The faster of both is interpolated at the samples of the slower one.
    """
    known, seen, moved = reference, stream, seconds
    if step_of(reference.t) > step_of(stream.t):
        known, seen, moved = stream, reference, -seconds
    t = seen.t + moved
    there = met(known.t, t)
    values = np.interp(t[there], *_distinct(known))
    return float(np.corrcoef(values, seen.y[there, 0])[0, 1])


def _left(along: Floats, x: Floats, y: Floats) -> Floats:
    """y - a - b x with a and b found along 1 and the smoothed signal, as x holds noise."""
    line = np.column_stack([np.ones_like(x), x])
    a, b = np.linalg.solve(along.T @ line, along.T @ y)
    return np.asarray(y - a - b * x)


def met(t: Floats, wanted: Floats) -> Bools:
    """Which of the wanted times lie within t and not in one of its gaps."""
    after = np.clip(np.searchsorted(t, wanted, side="right"), 1, len(t) - 1)
    near = t[after] - t[after - 1] <= GAP_FACTOR * step_of(t)
    slack = 1e-9 * step_of(t)
    found: Bools = near & (wanted >= t[0] - slack) & (wanted <= t[-1] + slack)
    return found


def _distinct(signal: Signal) -> tuple[Floats, Floats]:
    keep = np.concatenate([[True], np.diff(signal.t) > 0])
    return signal.t[keep], signal.y[keep, 0]


def step_of(t: Floats) -> float:
    steps = np.diff(t)
    return float(np.median(steps[steps > 0]))


def noise_of(y: Floats) -> float:
    """Standard deviation of white noise on a slow signal (n,): of its steps, over root 2."""
    return float(np.std(np.diff(y)) / np.sqrt(2))


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

    @classmethod
    def by_correlation(
        cls,
        reference: Signal,
        stream: Signal,
        within: float,
        min_coverage: float = MIN_COVERAGE,
        min_correlation: float = MIN_CORRELATION,
    ) -> "Offset":
        """Return the offset |tau| <= `within` (s) at which the stream follows the reference, up to
        scale.

        Both signals (nt, 1), of any rate, with gaps; a positive linear relation is assumed. Raises
        `RecordingError`, with the numbers, for flat and periodic signals, ramps (any lag fits
        them), a weak correlation, an offset at the edge of the search, and too small a coverage.
        """
        for signal, name in ((reference, "reference"), (stream, "stream")):
            if signal.y.shape[1] != 1:
                raise RecordingError(f"{name}: {signal.y.shape[1]} columns, expected 1; choose one")
            if len(np.unique(signal.t)) < MIN_MATCHED:
                raise RecordingError(
                    f"{name}: {len(signal.t)} samples; at least {MIN_MATCHED} are needed"
                )
            y = signal.y[:, 0]
            noise = noise_of(y)
            spread = float(np.std(y))
            if spread <= max(1.2 * noise, 1e-12 * float(np.abs(y).max())):
                raise RecordingError(
                    f"{name}: flat, its standard deviation {spread:.3g} {signal.unit} is that of "
                    f"its noise ({noise:.3g}); it cannot be correlated, align by another stream"
                )
        if not within > 0:
            raise RecordingError(f"offset within {within} s: expected a range above 0")
        step = min(step_of(reference.t), step_of(stream.t))
        coarse = coarse_lag(reference, stream, step, within, min_coverage, min_correlation)
        seconds, sd = offset_near(reference, stream, coarse)
        return matched(reference, stream, cls(seconds, sd, "correlation", 0, 0), min_coverage)

    def shift(self, recording: Recording, topic: str) -> Recording:
        """Return a recording whose stream `topic` is moved by the offset, kept as a record.

        Times start again at the earliest sample of all streams. Raises `RecordingError` for an
        unknown topic and for one that was moved before.
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
            "seconds": repr(self.seconds),
            "sd": repr(self.sd),
            "method": self.method,
            "count": str(self.count),
            "coverage": repr(self.coverage),
        }
        metadata = {**recording.metadata, name: record}
        return rebased(replace(moved(recording, self.seconds, topic), metadata=metadata))


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
