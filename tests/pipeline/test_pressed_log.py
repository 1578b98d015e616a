"""A log as it drives and checks a compression: less contact, toe and the cell's offset."""

from types import SimpleNamespace

import numpy as np
import pytest
from machine_logs import pressed_cylinder

from validate.parameters import describe
from validate.pipeline.checks.checks import Refined
from validate.pipeline.plates.scene import pressed_log


def test_a_log_begins_where_the_fitted_line_meets_no_force() -> None:
    """Height 50 mm, contact at 1 mm, a toe of 2 %: the strain counts from 2 mm on."""
    t = np.arange(11.0)
    d, force = 1e-3 * t[:, None], 0.5 + 2.0 * t[:, None]
    signals = {
        "displacement": SimpleNamespace(t=t, y=d, sd=1e-6),
        "force": SimpleNamespace(t=t, y=force, sd=0.01),
    }
    recording = SimpleNamespace(metadata={}, signal=lambda name, unit: signals[name])
    fit = SimpleNamespace(contact=1e-3, toe=0.02, offset=0.5)
    seen = pressed_log(recording, fit, 0.05, 0.1, {"late": (0.04, 0.08)}, 0.02)
    stage, cell = seen.observations
    assert stage.y[:, 0] == pytest.approx(1e-3 * np.arange(-2.0, 6.0))  # to a strain of 10 %
    assert cell.y[:, 0] == pytest.approx(2.0 * np.arange(8.0))
    assert cell.sd == 0.02
    assert seen.outside == 3


def test_what_is_rounding_is_the_larger_of_two_bounds() -> None:
    """What cannot move a verdict, and what arithmetic leaves, both count as nothing."""
    residual = SimpleNamespace(values=np.array([[3.0], [4.0]]), simulated=None, measured=None)
    refined = SimpleNamespace(_runs={"mesh": ()}, _converged=lambda part, r, rounding: rounding)

    def rounding(limit: float) -> float:
        return Refined.of(refined, residual, limit)["mesh"]

    alone = rounding(float("inf"))
    assert 0 < alone < 1e-6
    assert rounding(1e-30) == alone
    assert rounding(1e6) > 1e3 * alone


def test_both_sizes_of_a_specimen_are_asked_for() -> None:
    asked = {p.path for p in describe(pressed_cylinder(None, None)) if p.asked}
    assert asked == {"body.diameter", "body.height"}
