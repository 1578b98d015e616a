"""A parameter's interval from its chi-square profile."""

import numpy as np
import pytest

from experiments.fluid_phantom.friction_profile import profile_interval
from validate.compare.result import Result
from validate.errors import ComparisonError


def test_a_parabola_gives_its_minimum_and_two_standard_deviations() -> None:
    grid = np.linspace(0, 1, 21)
    found = profile_interval(grid, 30 + ((grid - 0.4) / 0.05) ** 2, 30)
    assert found.best == pytest.approx(0.4, abs=1e-3)
    assert (found.low, found.high) == pytest.approx((0.3, 0.5), abs=2e-3)
    assert (found.chi_square, found.count) == (pytest.approx(30.0, abs=1e-3), 30)


def test_a_side_that_the_data_do_not_bound_ends_with_the_grid() -> None:
    grid = np.linspace(0, 1, 8)
    found = profile_interval(grid, 5 + 100 * grid**2, 9)
    assert (found.best, found.low) == (0.0, 0.0)
    assert found.high == pytest.approx(0.2, abs=0.02)


def test_the_meshs_share_widens_both_sides_within_the_grid() -> None:
    grid = np.linspace(0, 1, 21)
    chi_square = 30 + ((grid - 0.4) / 0.05) ** 2
    found = profile_interval(grid, chi_square, 30, mesh=0.12)
    assert (found.low, found.high) == pytest.approx((0.4 - 0.26, 0.4 + 0.26), abs=2e-3)
    wide = profile_interval(grid, chi_square, 30, mesh=2.0)
    assert (wide.low, wide.high) == (0.0, 1.0)


def test_nothing_to_profile_is_an_error() -> None:
    with pytest.raises(ComparisonError, match="3 points over 9"):
        profile_interval(np.arange(3.0), np.zeros(3), 9)
    with pytest.raises(ComparisonError, match="over 0 residuals"):
        profile_interval(np.arange(5.0), np.zeros(5), 0)


def test_the_phantoms_slipping_plates_are_identified(phantom_result: Result) -> None:
    found = {s.name: s for s in phantom_result.identified}
    assert found["friction.share.low"].value == 0.0
    assert found["friction.share.high"].value < 0.1
    assert 0 < found["friction.share.mesh"].value < 0.05
    assert found["friction.share"].count == 126
