"""Frequency and damping of a free decay, by separable least squares.

y = a + b t + c t^2 + exp(-d t) (p cos w t + s sin w t): the five factors are linear and solved for
at every w and d (variable projection, Golub & Pereyra 1973), so that only two are searched, from
the highest peak of the spectrum. A slow creep is the parabola's, not the ringing's.

The standard deviations are those of the fit, widened by what its residuals remember from sample to
sample: n (1 - r) / (1 + r) of n samples are independent, r their correlation at one sample.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from validate.arrays import Floats
from validate.errors import ComparisonError

_PERIODS = 3.0  # fewer tell no damping from creep
_LINEAR = 5
_PADDED = 8  # times as long for the spectrum's peak


@dataclass(frozen=True)
class Ringing:
    """Frequency Hz of the damped oscillation and its ratio of critical damping, with standard
    deviations; `periods` were seen."""

    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float
    periods: float


def ringing(t: Floats, y: Floats) -> Ringing:
    """Of y (nt,) at times t (nt,) s; gaps are left out by the caller.

    Raises `ComparisonError` for fewer than three periods, too few samples, and what does not ring.
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
    sd_w, sd_d = _spread(found.fun, np.asarray(found.jac))
    whole = np.hypot(w, d)
    return Ringing(
        w / (2 * np.pi), sd_w / (2 * np.pi), d / whole, sd_d / whole, w * t[-1] / (2 * np.pi)
    )


def spectrum(t: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Frequencies (nf,) Hz and amplitudes (nf,) in y's unit of y (nt,) less its parabola, under
    Hann's window, on the mean step of t."""
    z = y - np.polyval(np.polyfit(t, y, 2), t)
    window = np.hanning(len(z))
    n = _PADDED * len(z)
    step = float(np.diff(t).mean())
    amplitude = 2 * np.abs(np.fft.rfft(window * z, n)) / window.sum()
    return np.asarray(np.fft.rfftfreq(n, step)), np.asarray(amplitude, dtype=np.float64)


def _peak(t: Floats, y: Floats) -> float:
    f, amplitude = spectrum(t, y)
    return float(f[amplitude.argmax()])


def _left(p: Floats, t: Floats, y: Floats) -> Floats:
    """What the best linear factors leave of y."""
    fade = np.exp(-p[1] * t)
    basis = np.stack(
        [np.ones_like(t), t, t**2, fade * np.cos(p[0] * t), fade * np.sin(p[0] * t)], axis=1
    )
    factors = np.linalg.lstsq(basis, y, rcond=None)[0]
    return np.asarray(basis @ factors - y)


def _spread(left: Floats, slope: Floats) -> tuple[float, float]:
    """Standard deviations of w and d (1/s each)."""
    squares = float(left @ left)
    r = float(np.clip(left[1:] @ left[:-1] / squares, 0.0, 1.0)) if squares else 0.0
    freedom = max(len(left) * (1 - r) / (1 + r) - _LINEAR - 2, 1.0)
    w, d = np.sqrt(squares / freedom * np.diag(np.linalg.pinv(slope.T @ slope))).tolist()
    return w, d
