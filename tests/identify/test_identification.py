"""Identification against exact cases: linear least squares, and what cannot be identified."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from validate.arrays import Floats
from validate.errors import ComparisonError, UsageError
from validate.identify.identification import InTurn, identify
from validate.identify.least_squares import (
    RISE,
    CalledOnce,
    Fit,
    Range,
    Residual,
    Side,
    Space,
    fit,
    side,
)
from validate.identify.scaled_curve import linear_fit

TWO = Space((Range("a", -1.0, 3.0), Range("b", 0.0, 5.0)))
X = np.linspace(0.0, 1.0, 30)


def linear(seed: int = 0, sd: float = 0.1) -> tuple[Residual, Floats, Floats]:
    """Residuals of a + b x with noise, the exact estimate and its covariance."""
    rng = np.random.default_rng(seed)
    A = np.stack([np.ones_like(X), X], axis=1) / sd
    y = A @ np.array([1.0, 2.0]) + rng.normal(size=len(X))
    C = np.linalg.inv(A.T @ A)
    return lambda x: A @ np.array(TWO.values(x)) - y, C @ A.T @ y, C


def test_rise_is_the_likelihood_ratio_of_one_parameter() -> None:
    assert pytest.approx(3.8415, abs=1e-4) == RISE


def test_linear_least_squares_and_its_interval_are_exact() -> None:
    residual, best, C = linear()
    found = identify(TWO, InTurn(residual), starts=3)
    assert found.found_again == 3
    for i, e in enumerate(found.estimates):
        half = 1.959964 * np.sqrt(C[i, i])
        assert e.value == pytest.approx(best[i], abs=1e-5)
        assert (e.low, e.high) == pytest.approx((best[i] - half, best[i] + half), abs=1e-4 * half)
        assert e.sd == pytest.approx(np.sqrt(C[i, i]), rel=1e-2)
    correlation = C[0, 1] / np.sqrt(C[0, 0] * C[1, 1])
    assert found.correlations[0, 1] == pytest.approx(correlation, abs=0.01)


def test_a_curved_profile_ends_where_chi_square_fitted_again_has_risen() -> None:
    """r = (10 (b - a^2), 1 - a): fitted again, b = a^2, and chi-square is (1 - a)^2 w^2."""
    w = 4.0

    def residual(x: Floats) -> Floats:
        a, b = TWO.values(x)
        return np.array([40 * (b - a**2), w * (1 - a)])

    best = fit(residual, np.array([0.2, 0.8]))
    assert best.converged
    assert TWO.values(best.x) == pytest.approx((1.0, 1.0), abs=1e-3)
    for sign in (-1, 1):
        end = TWO.value(0, side(residual, best, 0, sign).end)
        assert end == pytest.approx(1 + sign * np.sqrt(RISE) / w, abs=0.01)


def test_a_skew_profile_is_not_a_symmetric_interval() -> None:
    """y = exp(-k): the ends are those of the exact likelihood ratio."""
    space, sd = Space((Range("k", 0.01, 10.0),)), 0.05
    y = np.exp(-1.0)

    def rise(k: float) -> float:
        return ((np.exp(-k) - y) / sd) ** 2 - RISE

    found = identify(space, InTurn(lambda x: np.array([(np.exp(-space.value(0, x[0])) - y) / sd])))
    (e,) = found.estimates
    exact = brentq(rise, 0.1, 1.0), brentq(rise, 1.0, 5.0)
    assert (e.low, e.high) == pytest.approx(exact, rel=2e-3)
    assert e.high - e.value > 1.1 * (e.value - e.low)


def test_a_linear_residual_is_fitted_in_closed_form() -> None:
    """On a logarithmic range of five decades: four evaluations, and the seeded search agrees."""
    space, load = Space((Range("E", 0.1, 1e4),)), np.linspace(0.1, 1.0, 20)
    noise = np.random.default_rng(8).normal(size=20)
    calls: list[float] = []

    def residual(x: Floats) -> Floats:
        calls.append(float(x[0]))
        return np.asarray((space.value(0, x[0]) - 40.0) * load + noise)

    found = identify(space, InTurn(residual))
    assert found.linear
    assert len(calls) == 4
    searched = InTurn(residual)
    best = min(searched.fits(space.starts(10)), key=lambda f: f.chi_square)
    assert found.best.x == pytest.approx(best.x, abs=1e-6)
    assert found.best.chi_square == pytest.approx(best.chi_square, rel=1e-6)
    (e,) = found.estimates
    shift = -(load @ noise) / (load @ load)
    half = np.sqrt(RISE * found.misfit / (load @ load))
    assert (e.value, e.low, e.high) == pytest.approx(
        (40 + shift, 40 + shift - half, 40 + shift + half), rel=1e-6
    )
    assert (e.low_open, e.high_open) == (False, False)


@pytest.mark.parametrize("power", [0.7, 1.01, 2.0])
def test_what_is_nearly_linear_is_searched(power: float) -> None:
    space = Space((Range("k", 1.0, 9.0),))
    found = identify(space, InTurn(lambda x: np.array([space.value(0, x[0]) ** power - 4.0])))
    assert not found.linear
    assert len(found.fits) == 10
    assert found.estimates[0].value == pytest.approx(4.0 ** (1 / power), rel=1e-3)


def test_a_misfit_widens_by_its_root_and_says_so() -> None:
    residual, _, C = linear(sd=0.1)
    found = identify(TWO, InTurn(lambda x: 5 * residual(x)), starts=2)
    assert found.misfit == pytest.approx(25, rel=0.6)
    e = found.estimates[1]
    widened = 1.959964 * np.sqrt(found.misfit / 25 * C[1, 1])
    assert e.high - e.value == pytest.approx(widened, rel=1e-3)


def test_only_a_combination_that_is_measured_is_not_identifiable() -> None:
    """a + b alone: both intervals are as wide as the search."""
    found = identify(TWO, InTurn(lambda x: np.array([sum(TWO.values(x)) - 3.0, 0.0]) / 0.01))
    assert [e.identified for e in found.estimates] == [False, False]
    assert found.estimates[0].findings[0] == "its 95 % interval is the whole range searched"
    assert "spans 80 % of the range searched" in found.estimates[1].findings[0]
    assert np.isfinite(found.covariance).all()
    assert found.covariance[0, 0] <= 1 / 12 + 1e-12


def test_an_optimum_at_a_bound_is_a_finding() -> None:
    space = Space((Range("E", 1e3, 1e5),))
    found = identify(space, InTurn(lambda x: np.array([(space.value(0, x[0]) - 3e5) / 2e4])))
    (e,) = found.estimates
    assert any("at a bound, 100000" in f for f in e.findings)
    assert e.high_open


def test_starts_that_end_elsewhere_and_fit_as_well_are_a_finding() -> None:
    """a^2 = 1 has two answers in [-1.5, 1.5]."""
    space = Space((Range("a", -1.5, 1.5),))
    found = identify(space, InTurn(lambda x: (np.array([space.value(0, x[0])]) ** 2 - 1) / 0.01))
    (e,) = found.estimates
    assert any("end at other values with an equally good fit" in f for f in e.findings)


def test_an_interval_wider_than_a_factor_two_is_a_finding() -> None:
    space = Space((Range("E", 1e3, 1e5),))

    def of(sd: float) -> tuple[str, ...]:
        found = identify(space, InTurn(lambda x: np.array([(space.value(0, x[0]) - 1e4) / sd])))
        return found.estimates[0].findings

    assert of(1.5e3) == ()
    assert any("spans a factor" in f for f in of(2.5e3))


def test_starts_that_cannot_be_simulated_are_left_out() -> None:
    residual, best, _ = linear()

    def breaks(x: Floats) -> Floats:
        if x[0] > 0.7:
            raise ComparisonError("diverged")
        return residual(x)

    found = identify(TWO, InTurn(breaks), starts=6)
    assert 0 < sum(f.count == 0 for f in found.fits) < 6
    assert found.estimates[0].value == pytest.approx(best[0], abs=1e-4)


def test_none_that_converges_is_one_line_with_numbers() -> None:
    rough = np.random.default_rng(0)

    def noise(x: Floats) -> Floats:
        return 100 * rough.normal(size=5)

    with pytest.raises(ComparisonError, match=r"b.*2 starts.*\(lowest"):
        identify(TWO, InTurn(noise), starts=2)


def test_nothing_that_can_be_simulated_says_why() -> None:
    def broken(x: Floats) -> Floats:
        raise ComparisonError("no residual 'forse'")

    with pytest.raises(ComparisonError, match="no residual 'forse'"):
        identify(TWO, InTurn(broken), starts=2)


def test_fewer_residuals_than_parameters_are_refused() -> None:
    with pytest.raises(ComparisonError, match=r"1 residuals for 2 parameters \(a, b\)"):
        identify(TWO, InTurn(lambda x: x[:1]), starts=2)


def test_residuals_that_come_and_go_are_refused() -> None:
    def odd(x: Floats) -> Floats:
        return np.ones(3 if x[0] == 0.5 else 4)

    with pytest.raises(ComparisonError, match="3 residuals at the start, 4 later"):
        identify(TWO, InTurn(odd), starts=1)


def test_a_profile_that_falls_leads_to_a_better_best() -> None:
    """The first start ends in the worse of two valleys; its profile walks into the other."""
    space = Space((Range("a", 0.0, 1.0),))

    def residual(x: Floats) -> Floats:
        a = x[0]
        return np.array([10 * (a - 0.5) * (a - 0.62) * 8, 1.0 + 0.5 * (a - 0.62)])

    found = identify(space, InTurn(residual), starts=1)
    assert found.estimates[0].value == pytest.approx(0.5, abs=0.02)


def test_starts_are_seeded_and_fill_the_box() -> None:
    one, again, other = (TWO.starts(9, seed) for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    assert np.array_equal(one[0], [0.5, 0.5])
    assert {int(8 * x) for x in one[1:, 0]} == set(range(8))
    with pytest.raises(UsageError, match="at least one start"):
        TWO.starts(0)


def test_bounds_a_decade_apart_are_searched_by_logarithm() -> None:
    log, straight = Range("E", 1e3, 1e5), Range("nu", 0.1, 0.5)
    assert log.logarithmic
    assert not straight.logarithmic
    space = Space((log, straight))
    assert space.values(np.array([0.5, 0.5])) == pytest.approx((1e4, 0.3))
    assert space.slope(0, 0.5) == pytest.approx(1e4 * np.log(100))
    assert replace(log, low=-1.0).logarithmic is False


@pytest.mark.slow
def test_intervals_cover_the_truth_of_two_hundred_seeded_twins() -> None:
    """A decay with an offset, nonlinear in its rate; 95 % intervals hold 92 to 98 %."""
    space = Space((Range("k", 0.1, 20.0), Range("c", -1.0, 1.0)))
    truth, sd, t = (3.0, 0.2), 0.1, np.linspace(0, 1, 15)
    held = np.zeros(2)
    for seed in range(200):
        noise = np.random.default_rng(seed).normal(size=len(t))
        y = np.exp(-truth[0] * t) + truth[1] + sd * noise

        def residual(x: Floats, y: Floats = y) -> Floats:
            k, c = space.values(x)
            return (np.exp(-k * t) + c - y) / sd

        found = identify(space, InTurn(residual), starts=2)
        held += [e.low <= true <= e.high for e, true in zip(found.estimates, truth, strict=True)]
    assert (held >= 0.92 * 200).all()
    assert (held <= 0.98 * 200).all()


class Deepening:
    """Evaluates whose profile finds a better best by 10 each time it is walked, `times` times."""

    def __init__(self, times: int) -> None:
        self.times, self.walked = times, 0

    def linear(self, space: Space) -> Fit:
        return linear_fit(lambda x: x**2, space)

    def fits(self, starts: Floats) -> list[Fit]:
        chi_square = 100.0 - 10.0 * self.walked
        return [Fit(x, x, chi_square, 200, np.eye(1), 1, True) for x in starts]

    def sides(self, best: Fit, wanted: object, scale: float) -> list[Side]:
        deeper = self.walked < self.times
        self.walked += 1
        x = np.array([0.3 + 0.1 * self.walked]) if deeper else best.x
        ends = np.array([0.4, 0.5]), np.array([0.0, RISE])
        return [Side(0, s, *ends, 0.5, False, x, -10.0 if deeper else 0.0) for s in (-1, 1)]


@pytest.mark.parametrize(("times", "walked", "chi_square"), [(0, 1, 100), (1, 2, 90), (9, 3, 70)])
def test_a_better_best_is_profiled_again_at_most_three_times(
    times: int, walked: int, chi_square: float
) -> None:
    evaluates = Deepening(times)
    found = identify(Space((Range("a", 0.0, 1.0),)), evaluates, starts=1)
    assert (evaluates.walked, found.best.chi_square) == (walked, chi_square)


def test_a_simulation_that_breaks_first_later_or_compares_nothing() -> None:
    def residual(x: Floats) -> Floats:
        if x[0] > 0.5:
            raise ComparisonError("cells turned\n  over")
        return np.array([3.0, 4.0])

    once = CalledOnce(residual)
    assert once(np.array([0.1])).tolist() == [3.0, 4.0]
    far = once(np.array([0.9]))
    assert far.tolist() == [far[0]] * 2
    assert far[0] > 10 * np.sqrt(12.5)
    assert (once.failure, once.calls) == ("cells turned over", 2)
    with pytest.raises(ComparisonError, match=r"cells turned\s+over"):
        CalledOnce(residual)(np.array([0.9]))
    with pytest.raises(ComparisonError, match="0 matched samples, so nothing can"):
        CalledOnce(lambda x: np.zeros(0))(np.array([0.1]))


def test_a_profile_that_never_settles_ends_after_its_points() -> None:
    """Chi-square jumps over the wanted rise at 0.75, as where a simulation breaks."""

    def residual(x: Floats) -> Floats:
        return np.array([0.0 if x[0] < 0.75 else 10.0])

    best = Fit(np.array([0.5]), np.array([0.5]), 0.0, 1, np.eye(1), 1, True)
    found = side(residual, best, 0, 1)
    assert len(found.at) == 15
    assert found.end == pytest.approx(0.75, abs=1e-3)
    assert not found.open
