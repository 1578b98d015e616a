"""Real-time factors."""

import numpy as np
import pytest

from validate.errors import UsageError
from validate.solve.haptic.rates import RealTime, TickTimes


def test_a_rate_means_something_beside_its_step() -> None:
    """Paper 003 shows 75 Hz at 1 ms steps: 13 times slower than life, 4 times beyond stability."""
    printed = RealTime(75.0, 1e-3, 0.24e-3)
    assert printed.factor == pytest.approx(0.075)
    assert printed.ratio == pytest.approx(4.17, abs=0.01)
    ours = RealTime(16.2e3, 0.24e-3, 0.26e-3)
    assert ours.factor == pytest.approx(3.888)


@pytest.mark.parametrize("numbers", [(0.0, 1e-3, 1e-3), (1e3, -1e-3, 1e-3), (1e3, 1e-3, np.nan)])
def test_rates_and_steps_are_positive(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(UsageError, match="all must be positive"):
        RealTime(*numbers)


def test_ticks_are_missed_beyond_the_deadline_alone() -> None:
    times = TickTimes(np.array([1.0, 2.0, 3.0, 4.0]) * 1e-3)
    assert [times.missed(d) for d in (0.5e-3, 2e-3, 3.9e-3, 4e-3)] == [4, 2, 1, 0]
    assert len(times.quantiles) == len(TickTimes.shares) + 1
    assert times.quantiles[0] == pytest.approx(2.5e-3)
    assert times.quantiles[-1] == 4e-3


@pytest.mark.parametrize("seconds", [np.zeros(0), np.array([1.0, np.nan])])
def test_times_of_no_ticks_tell_nothing(seconds: np.ndarray) -> None:
    with pytest.raises(UsageError):
        TickTimes(seconds)
