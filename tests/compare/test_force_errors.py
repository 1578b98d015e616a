"""Errors of a force over time: peak, rms and phase, and the plain statistics in its unit."""

import numpy as np
import pytest

from validate.arrays import Floats
from validate.compare.force_error import ForcePair
from validate.errors import ComparisonError
from validate.recording.types import Signal

T = np.arange(0.0, 6.0, 0.01)


def pulse(t: Floats) -> Floats:
    return -3.0 * np.exp(-(((t - 2.0) / 0.4) ** 2)) - 1.0 / (1 + np.exp(-4 * (t - 4)))


def signal(y: Floats, t: Floats = T, unit: str = "N") -> Signal:
    return Signal(t, y[:, None], unit, 0.0, "stage")


def scores(run: Signal, reference: Signal) -> dict[str, float]:
    return {s.name: s.value for s in ForcePair.of("F", run, reference, 0.5, "reference").scores()}


def test_identical_forces_are_zero() -> None:
    found = scores(signal(pulse(T)), signal(pulse(T)))
    assert set(found.values()) == {0.0}


def test_a_force_a_tenth_too_high_by_hand() -> None:
    y = pulse(T)
    found = scores(signal(1.1 * y), signal(y))
    top, rms = np.abs(y).max(), np.sqrt((y**2).mean())
    assert found["F.peak"] == pytest.approx(0.1 * top, rel=1e-12)
    assert found["F.peak.relative"] == pytest.approx(0.1, rel=1e-12)
    assert found["F.rms"] == found["F.rmse"] == pytest.approx(0.1 * rms, rel=1e-12)
    assert found["F.rms.relative"] == pytest.approx(0.1, rel=1e-12)
    assert found["F.mae"] == pytest.approx(0.1 * np.abs(y).mean(), rel=1e-12)
    assert found["F.nrmse"] == pytest.approx(0.1 * rms / np.ptp(y), rel=1e-12)
    assert abs(found["F.phase"]) < 1e-4


@pytest.mark.parametrize("late", [-0.137, 0.004, 0.137])
def test_a_late_force_has_a_positive_phase_error(late: float) -> None:
    """Between the samples, on another clock rate, with another scale and offset."""
    t = np.arange(0.0, 6.0, 0.013)
    found = scores(signal(0.7 * pulse(t - late) + 2.0, t), signal(pulse(T)))
    assert found["F.phase"] == pytest.approx(late, abs=1e-4)


def test_half_of_the_run_must_overlap_for_a_phase() -> None:
    enough, little = (signal(pulse(T[end >= T]), T[end >= T]) for end in (3.6, 2.4))
    assert scores(signal(pulse(T)), enough)["F.phase"] == pytest.approx(0.0, abs=1e-4)
    with pytest.raises(ComparisonError, match="at least 50 % are needed"):
        scores(signal(pulse(T)), little)


def test_only_times_that_the_run_meets_are_counted() -> None:
    """The run stops at 3 s and has a gap of 1 s, which also takes the sample it begins with."""
    t = T[(T <= 3.0) & ~((T > 0.5) & (T < 1.5))]
    force = ForcePair.of("F", signal(pulse(t), t), signal(pulse(T)), 0.5, "reference")
    assert len(force.t) == len(t) - 1
    assert np.array_equal(force.y, force.y_reference)
    found = force.scores()
    assert all(s.count == len(t) - 1 for s in found)


def test_every_score_has_its_unit_and_definition() -> None:
    forces = signal(pulse(T)), signal(1.1 * pulse(T))
    found = ForcePair.of("F", *forces, 0.5, "reference").scores()
    units = {s.name: s.unit for s in found}
    assert units == {
        "F.peak": "N", "F.peak.relative": "1", "F.rms": "N", "F.rms.relative": "1",
        "F.phase": "s", "F.mae": "N", "F.rmse": "N", "F.sd": "N", "F.max": "N", "F.nrmse": "1",
    }  # fmt: skip
    assert all(s.definition and s.against == "reference" for s in found)


def test_what_cannot_be_compared_is_refused() -> None:
    y = pulse(T)
    with pytest.raises(ComparisonError, match="in N against 1 in mN"):
        ForcePair.of("F", signal(y), signal(y, unit="mN"), 0.5, "reference")
    with pytest.raises(ComparisonError, match="0 of 600 reference"):
        ForcePair.of("F", signal(y, T + 100), signal(y), 0.5, "reference")
    with pytest.raises(ComparisonError, match="F: no phase error: "):
        scores(signal(np.sin(10 * np.pi * (T - 0.05))), signal(np.sin(10 * np.pi * T)))
    with pytest.raises(ComparisonError, match=r"F: no phase error.*0\."):
        scores(signal(np.random.default_rng(1).normal(size=len(T))), signal(y))
    with pytest.raises(ComparisonError, match="the reference force is always 0"):
        scores(signal(y), signal(0 * y))
    with pytest.raises(ComparisonError, match="expected a positive time"):
        ForcePair.of("F", signal(y), signal(y), 0.0, "reference")
