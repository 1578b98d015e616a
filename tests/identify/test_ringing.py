"""Ringing: exact without noise, within its own uncertainty with noise, nothing from a creep."""

import numpy as np
import pytest

from validate.errors import ComparisonError
from validate.identify import recorded_motion as module
from validate.identify.recorded_motion import Ringing

# private: _peak: replaced, to bring a case about.

T = 0.01 * np.arange(140)


def rung(f: float, zeta: float, phase: float = 0.3, creep: float = 0.0) -> np.ndarray:
    """A damped oscillation m of damped frequency f about a level that creeps."""
    d = 2 * np.pi * f * zeta / np.sqrt(1 - zeta**2)
    swing = np.exp(-d * T) * np.cos(2 * np.pi * f * T + phase)
    return 4e-3 * swing - 6e-3 - creep * (1 - np.exp(-T / 0.6))


@pytest.mark.parametrize(("f", "zeta"), [(7.7, 0.055), (4.3, 0.02), (9.0, 0.1)])
def test_frequency_and_damping_are_exact_without_noise(f: float, zeta: float) -> None:
    found = Ringing.of(T + 3.0, rung(f, zeta))
    assert found.frequency == pytest.approx(f, rel=2e-5)
    assert found.damping == pytest.approx(zeta, rel=1e-3)
    assert found.periods == pytest.approx(f * T[-1], rel=2e-5)


def test_its_error_is_what_it_says_of_noise_and_creep() -> None:
    """Over 60 seeded signals of 3.5 to 9 Hz with 10 um of noise and .5 mm of creep."""
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(60):
        f, zeta = rng.uniform(3.5, 9), rng.uniform(0.02, 0.1)
        y = rung(f, zeta, rng.uniform(0, 6), 5e-4) + 1e-5 * rng.normal(size=len(T))
        found = Ringing.of(T, y)
        errors.append(
            (found.frequency - f, found.frequency_sd, found.damping - zeta, found.damping_sd)
        )
    off_f, sd_f, off_z, sd_z = np.array(errors).T
    assert np.sqrt((off_f**2).mean()) < 0.002  # Hz
    assert np.sqrt((off_z**2).mean()) < 3e-4
    assert (np.abs(off_f) < 2 * sd_f).mean() > 0.85
    assert (np.abs(off_z) < 2 * sd_z).mean() > 0.85


def test_what_does_not_ring_is_refused() -> None:
    with pytest.raises(ComparisonError, match=r"1\.\d periods .* 1\.39 s: 3 are needed"):
        Ringing.of(T, rung(1.2, 0.05))
    with pytest.raises(ComparisonError, match=r"5 samples.*least 20"):
        Ringing.of(T[:5], T[:5])


def test_the_spectrum_peaks_where_it_rings_with_its_amplitude() -> None:
    f, amplitude = Ringing.spectrum(T, 2e-3 * np.cos(2 * np.pi * 8.0 * T) + 5 * T**2 - T)
    assert f[amplitude.argmax()] == pytest.approx(8.0, abs=0.1)
    assert amplitude.max() == pytest.approx(2e-3, rel=0.02)


def test_a_frequency_that_runs_away_from_the_peak_is_no_ringing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The search may end at most a factor two from the largest peak of the spectrum."""
    y = rung(7.7, 0.055)
    monkeypatch.setattr(module, "_peak", lambda t, y: 3.0)
    with pytest.raises(ComparisonError, match=r"no ringing near 3\.00 Hz was found: "):
        Ringing.of(T, y)
