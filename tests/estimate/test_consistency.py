"""NIS and NEES against chi-square: hand-computed cases, right and wrong claims, empty ones."""

import numpy as np
import pytest

from validate.errors import ComparisonError
from validate.estimate.consistency import (
    WRONG_CLASS,
    nees,
    nees_consistency,
    nis_consistency,
    whiteness,
)


def test_three_steps_by_hand() -> None:
    """Mean of 1 + 5 + 3 over 2 + 3 + 1 degrees; chi-square of 6 has 1.237 and 14.449 at 95 %."""
    found = nis_consistency([1.0, 0.0, 5.0, 3.0], [2, 0, 3, 1])
    assert found.mean == pytest.approx(9 / 6)
    assert (found.samples, found.dof) == (3, 6)
    assert found.band_95.low == pytest.approx(1.2373 / 6, abs=1e-4)
    assert found.band_95.high == pytest.approx(14.4494 / 6, abs=1e-4)
    assert found.verdict == "consistent"
    assert "3 steps, 6 degrees" in found.line


@pytest.mark.parametrize(
    ("factor", "verdict"), [(0.5, "over-confident"), (1, "consistent"), (2, "under-confident")]
)
def test_a_claimed_sd_off_by_a_factor_is_named(factor: float, verdict: str) -> None:
    y = np.random.default_rng(3).normal(size=(400, 2))
    found = nis_consistency((y**2).sum(axis=1) / factor**2, np.full(400, 2))
    assert found.verdict == verdict
    assert found.holds == (factor == 1)
    assert found.alarm == ""


def test_far_too_much_error_raises_the_alarm() -> None:
    assert "wrong model class: NIS per degree of freedom 40" in nis_consistency([120.0], [3]).alarm
    assert nis_consistency([3 * WRONG_CLASS], [3]).alarm == ""


def test_nothing_compared_is_an_error() -> None:
    for dof in ([], [0, 0]):
        with pytest.raises(ComparisonError, match="nothing was compared"):
            nis_consistency(np.zeros(len(dof)), dof)
    with pytest.raises(ComparisonError, match="not finite"):
        nis_consistency([np.nan], [1])


def test_nees_by_hand_and_without_claim() -> None:
    assert nees([1.0, 2.0], np.diag([1.0, 4.0])) == (pytest.approx(2.0), 2)
    assert nees([1.0, 2.0], np.diag([0.0, 4.0])) == (pytest.approx(1.0), 1)
    with pytest.raises(ComparisonError, match="no covariance"):
        nees([1.0, 2.0], np.diag([-1.0, 4.0]))


def test_nees_of_a_right_claim_is_consistent() -> None:
    rng = np.random.default_rng(5)
    L = rng.normal(size=(4, 4))
    values = [nees(L @ rng.normal(size=4), L @ L.T) for _ in range(300)]
    found = nees_consistency(*zip(*values, strict=True))
    assert found.verdict == "consistent"
    assert found.dof == 1200


def test_white_noise_is_white_and_a_walk_is_not() -> None:
    e = np.random.default_rng(2).normal(size=500)
    sd = np.full(500, 2.0)
    assert whiteness(2 * e, sd).white
    assert not whiteness(2 * (e + 0.5), sd).white
    walk = np.convolve(e, [1, 0.6])[:500]
    found = whiteness(walk, sd)
    assert found.autocorrelation[0] == pytest.approx(0.6 / 1.36, abs=0.1)
    assert not found.white


def test_whiteness_counts_measured_steps_only() -> None:
    sd = np.where(np.arange(90) % 3 == 0, 1.0, 0.0)
    assert whiteness(np.random.default_rng(2).normal(size=90) * sd, sd).samples == 30
    with pytest.raises(ComparisonError, match="29 innovations for 10 lags"):
        whiteness(np.ones(29), np.ones(29))
