"""What calibrates: declared with bounds and a source, kept apart from what validates."""

import math

import pytest

from validate.errors import UsageError
from validate.replay.calibration import Calibrates, Calibration, Free

E = Free("material.E", 1e3, 1e5, "assumed")


def test_bounds_are_two_finite_numbers_in_order() -> None:
    for low, high in ((2.0, 1.0), (1.0, 1.0), (math.nan, 1.0), (0.0, math.inf)):
        with pytest.raises(UsageError, match=r"material\.E: bounds"):
            Free("material.E", low, high, "assumed")


def test_bounds_have_a_source() -> None:
    with pytest.raises(UsageError, match="no source"):
        Free("material.E", 1.0, 2.0, " ")


def test_a_calibration_names_parameters_and_residuals_each_once() -> None:
    on = (Calibrates(("force",)),)
    with pytest.raises(UsageError, match="0 parameters on 1 quantities"):
        Calibration("fem", (), on)
    with pytest.raises(UsageError, match="1 parameters on 0 quantities"):
        Calibration("fem", (E,), (Calibrates(()),))
    with pytest.raises(UsageError, match=r"material\.E is free twice"):
        Calibration("fem", (E, E), on)
