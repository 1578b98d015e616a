"""Real-time factors."""

import numpy as np
import pytest

from validate.errors import UsageError
from validate.solve.haptic import RealTime


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
