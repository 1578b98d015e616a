"""Closed-form moduli, their budget, and the test for a shape in a residual."""

import numpy as np
import pytest

from validate.errors import ComparisonError
from validate.identify.budget import IdentifiedValue, dependence, pattern
from validate.identify.scaled_curve import (
    UnitCurve,
    fit_modulus_of,
    fit_proportional,
    fit_scaled,
)

D = np.linspace(0.0, 2e-3, 41)
CURVE = UnitCurve(D, 30.0 * D + 4e3 * D**2, 1.0)


def test_an_exact_curve_gives_its_scale_and_shift() -> None:
    d = np.linspace(3e-4, 1.5e-3, 60)
    found = fit_scaled(CURVE, d, 25e3 * CURVE(d - 1e-4), shifted=True)
    assert found.scale == pytest.approx(25e3, rel=1e-9)
    assert found.shift == pytest.approx(1e-4, rel=1e-9)


def test_the_covariance_is_that_of_repeated_fits() -> None:
    d, rng = np.linspace(3e-4, 1.5e-3, 80), np.random.default_rng(4)
    exact = 25e3 * CURVE(d - 1e-4)
    fits = [
        fit_scaled(CURVE, d, exact + rng.normal(0, 5.0, len(d)), shifted=True) for _ in range(300)
    ]
    scales, shifts = np.array([f.scale for f in fits]), np.array([f.shift for f in fits])
    mean = np.mean([f.covariance for f in fits], axis=0)
    assert np.sqrt(mean[0, 0]) == pytest.approx(scales.std(), rel=0.15)
    assert np.sqrt(mean[1, 1]) == pytest.approx(shifts.std(), rel=0.15)
    own = mean[0, 1] / np.sqrt(mean[0, 0] * mean[1, 1])
    assert own == pytest.approx(np.corrcoef(scales, shifts)[0, 1], abs=0.05)
    f = fits[0]
    assert np.hypot(f.alone, f.along_shift) == pytest.approx(f.sd)


def test_a_fit_of_a_scale_alone_is_weighted_least_squares() -> None:
    f, force = np.array([1.0, 2.0]), np.array([2.0, 5.0])
    found = fit_proportional(f, force)
    assert found.scale == pytest.approx(12 / 5)
    assert found.noise == pytest.approx(np.hypot(-0.4, 0.2))
    assert found.sd == pytest.approx(np.hypot(-0.4, 0.2) / np.sqrt(5))
    assert fit_proportional(f, force, sd=3.0).sd == pytest.approx(3 / np.sqrt(5))
    with pytest.raises(ComparisonError, match="falls as the load rises"):
        fit_proportional(f, -force)


def test_a_law_in_proportion_needs_two_solutions_and_another_more() -> None:
    force = 25e3 * CURVE(D)

    def plain(E: float) -> UnitCurve:
        return UnitCurve(D, E * CURVE(D), E)

    def stiffened(E: float) -> UnitCurve:
        """A part of the force has a modulus of its own, 2 kPa."""
        return UnitCurve(D, (E + 2e3) * CURVE(D), E)

    for law, E, solutions in ((plain, 25e3, 2), (stiffened, 23e3, 3)):
        _, found, count = fit_modulus_of(law, lambda c: fit_scaled(c, D, force), 10e3)
        assert found.scale == pytest.approx(E, rel=1e-5)
        assert count >= solutions
        assert (count == 2) == (law is plain)


def test_successive_samples_that_depend_count_less() -> None:
    """1 + 2 sum of a^k is (1 + a) / (1 - a) of a first-order process."""
    rng, a = np.random.default_rng(2), 0.6
    white = rng.normal(size=20_000)
    y = np.zeros_like(white)
    for i in range(1, len(y)):
        y[i] = a * y[i - 1] + white[i]
    assert dependence(y) == pytest.approx((1 + a) / (1 - a), rel=0.1)
    assert dependence(white) == pytest.approx(1.0, abs=0.1)


def test_a_budget_adds_squares_and_names_its_largest_term() -> None:
    one = IdentifiedValue("E", 100.0, "Pa", "m", "log", {"noise": 3.0, "mesh": 4.0}, 9)
    assert one.u == pytest.approx(5.0)
    assert one.dominant == "mesh"
    assert one.interval == pytest.approx((100 - 9.8, 100 + 9.8), abs=1e-2)
    few = IdentifiedValue("E", 100.0, "Pa", "m", "log", {"noise": 3.0}, 3, freedom=2)
    assert few.factor == pytest.approx(4.303, abs=1e-3)  # Student's of 2 degrees of freedom
    mixed = IdentifiedValue("E", 1.0, "Pa", "m", "log", {"noise": 3.0, "mesh": 4.0}, 3, freedom=2)
    assert mixed.factor == pytest.approx(2.126, abs=1e-3)  # of 2 (5/3)^4 = 15.4


@pytest.mark.parametrize(("bend", "seen"), [(0.0, False), (0.02, True), (-0.02, True)])
def test_a_bent_residual_is_no_noise(bend: float, seen: bool) -> None:
    x, rng = np.linspace(0, 1, 120), np.random.default_rng(1)
    residual = bend * x**2 + 0.05 * x + rng.normal(0, 1e-3, len(x))
    found = pattern(x, residual, np.stack([x, np.ones_like(x)], axis=1), 1e-3)
    assert found is not None
    assert found.significant == seen
    if seen:
        assert found.stiffens == (bend > 0)
        exact = bend * (x**2 - np.polyval(np.polyfit(x, x**2, 1), x))
        assert found.rms == pytest.approx(np.sqrt(np.mean(exact**2)), rel=0.2)


def test_noise_alone_is_called_a_shape_as_often_as_it_should() -> None:
    x, rng = np.linspace(0, 1, 80), np.random.default_rng(3)
    followed = np.stack([x, np.ones_like(x)], axis=1)
    found = [pattern(x, rng.normal(size=80), followed) for _ in range(1000)]
    chances = np.array([f.chance for f in found if f is not None])
    assert len(chances) == 1000
    assert (chances < 0.01).mean() < 0.025
    assert (chances < 0.5).mean() == pytest.approx(0.5, abs=0.06)
