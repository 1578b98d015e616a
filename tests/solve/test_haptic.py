"""Real-time factors, and forces between the steps of a model."""

import numpy as np
import pytest

from validate.errors import UsageError
from validate.solve.haptic import RealTime, extrapolate


def test_a_rate_means_something_beside_its_step() -> None:
    """Paper 003 shows 75 Hz at 1 ms steps: 13 times slower than life, 4 times beyond stability."""
    printed = RealTime(75.0, 1e-3, 0.24e-3)
    assert printed.factor == pytest.approx(0.075)
    assert printed.ratio == pytest.approx(4.17, abs=0.01)
    assert not printed.haptic
    ours = RealTime(16.2e3, 0.24e-3, 0.26e-3)
    assert ours.factor == pytest.approx(3.888)
    assert ours.force_hz == pytest.approx(1 / 0.24e-3)
    assert ours.haptic


def test_fast_steps_too_short_for_real_time_are_not_haptic() -> None:
    assert not RealTime(20e3, 2e-5, 3e-5).haptic


@pytest.mark.parametrize("numbers", [(0.0, 1e-3, 1e-3), (1e3, -1e-3, 1e-3), (1e3, 1e-3, np.nan)])
def test_rates_and_steps_are_positive(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(UsageError, match="all must be positive"):
        RealTime(*numbers)


def test_a_linear_force_is_extrapolated_exactly_at_uneven_times() -> None:
    times = np.array([0.0, 0.0013, 0.0021])
    slope, start = np.array([3.0, -2.0, 50.0]), np.array([0.1, 0.2, 0.3])
    forces = start + times[:, None] * slope
    assert extrapolate(times, forces, 0.003) == pytest.approx(start + 0.003 * slope, rel=1e-12)
    assert extrapolate(times, forces, 0.0021) == pytest.approx(forces[-1])


def test_the_error_falls_with_the_square_of_the_gap() -> None:
    def error(h: float) -> float:
        times = np.array([0.2 - h, 0.2])
        found = extrapolate(times, np.sin(5 * times)[:, None], 0.2 + h)
        return abs(float(found[0]) - np.sin(5 * (0.2 + h)))

    assert error(2e-3) / error(1e-3) == pytest.approx(4, rel=0.02)


def test_one_force_is_held_and_none_is_refused() -> None:
    assert extrapolate(np.array([1.0]), np.array([[2.0]]), 5.0) == pytest.approx([2.0])
    for times in (np.zeros(0), np.array([0.0, 0.0]), np.array([0.0, 2.0])):
        with pytest.raises(UsageError, match="none after t"):
            extrapolate(times, np.zeros((len(times), 1)), 1.0)
