"""Both answers of a check: every branch, and how often each is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from validate.compare.convergence import Numerical
from validate.compare.residual import Residual
from validate.compare.result import Result
from validate.compare.verdict import (
    ALPHA,
    Accept,
    Check,
    Sensitivity,
    Statistic,
    as_fitted,
    as_same_model,
    errors_of,
    judge,
    nothing_compared,
)
from validate.errors import ComparisonError

REPEATS = 1000  # the share of 4.6 % of them has a standard deviation of 0.66 %


def scalar(value: float, sd: float = 1.0, systematic: float = 0.0) -> Residual:
    return Residual("pressure", "9mm", np.array([[value]]), sd, systematic, "Pa", "")


def points(values: np.ndarray, sd: float = 1.0, systematic: float = 0.0) -> Residual:
    return Residual("contour", "9mm", values, sd, systematic, "m", "")


def required(limit: float | None, statistic: Statistic = "every") -> Accept:
    return Accept("pressure", limit, "a tenth of the largest", statistic=statistic)


def judged(
    residual: Residual, limit: float | None = 1e9, statistic: Statistic = "every", **inputs: float
) -> Check:
    """Judged without a discretisation; inputs of one unit each."""
    parts = [
        Sensitivity(name, replace(residual, values=np.full(residual.values.shape, size)))
        for name, size in inputs.items()
    ]
    return judge(residual, required(limit, statistic), Numerical(), parts)


# Two questions


@pytest.mark.parametrize(
    ("value", "limit", "validation", "acceptance"),
    [
        (0.0, 3.0, "not distinguishable", "good enough"),
        (1.0, 3.0, "not distinguishable", "good enough"),
        (-1.0, 3.0, "not distinguishable", "good enough"),
        (1.01, 3.0, "not distinguishable", "undecided"),
        (-1.99, 1.0, "not distinguishable", "undecided"),
        (2.01, 5.0, "differs", "good enough"),
        (-2.01, 3.0, "differs", "undecided"),
        (5.01, 3.0, "differs", "not good enough"),
        (-5.01, 3.0, "differs", "not good enough"),
        (4.99, 3.0, "differs", "undecided"),
        (0.0, 1.99, "not distinguishable", "undecided"),
    ],
)
def test_the_interval_against_zero_and_against_the_limit(
    value: float, limit: float, validation: str, acceptance: str
) -> None:
    check = judged(scalar(value), limit)
    assert (check.validation, check.acceptance) == (validation, acceptance)
    assert (check.value, check.u_val, check.count, check.unit) == (value, 1.0, 1, "Pa")
    assert (check.name, check.verdict) == ("pressure@9mm", acceptance)
    assert check.margin == pytest.approx(limit - abs(value) - 2)
    assert check.requirement == "ours: a tenth of the largest"


def test_an_error_well_within_its_limit_is_good_enough_however_good_the_measurement() -> None:
    """The rubber strip: E .0030, 2 u .0007, limit .0050."""
    check = judged(scalar(0.0030, 0.00035), 0.0050)
    assert (check.validation, check.acceptance) == ("differs", "good enough")


def test_an_interval_of_twice_the_limit_is_not_good_enough() -> None:
    assert judged(scalar(4.0, 2.0), 4.0).acceptance == "undecided"


@pytest.mark.parametrize("accept", [Accept("p"), Accept("p", 3.0), Accept("p", 3.0, " ")])
def test_without_a_written_reason_nothing_is_required(accept: Accept) -> None:
    for value, answer in ((0.1, "not distinguishable"), (9.0, "differs")):
        check = judge(scalar(value), accept, Numerical(), [])
        assert (check.acceptance, check.verdict) == ("no requirement", answer)
        assert (check.limit, check.margin) == (None, None)
    assert "no requirement" in accept.why


def test_uncertainties_add_in_squares() -> None:
    """u_D 3 and 4, u_num 12 of mesh and step, inputs 2 x 6 and 5: 13 from (5, 12)."""
    one = scalar(1.0, 3.0, 4.0)
    numerical = Numerical({"mesh": 12.0 * 0.6, "time step": 12.0 * 0.8}, "three meshes")
    inputs = [Sensitivity("friction", scalar(-12.0)), Sensitivity("pose", scalar(5.0))]
    check = judge(one, required(1e3), numerical, inputs)
    assert check.numerical == "three meshes"
    assert (check.u_D, check.u_num, check.u_input) == pytest.approx((5.0, 12.0, 13.0))
    assert check.u_val == pytest.approx(np.sqrt(25 + 144 + 169))


def test_undecided_names_what_would_decide() -> None:
    for name, parts in (
        ("measurement", {}),
        ("friction", {"friction": 2.0, "pose": 1.5}),
        ("pose", {"friction": 2.0, "pose": 2.5}),
    ):
        why = judged(scalar(0.1), 0.5, **parts).why
        assert f"better measurement of '{name}' reduces it" in why
        assert "straddles the limit 0.500 Pa: a u_val below 0.200 Pa would decide" in why
    for name, better in (("mesh", "a finer mesh"), ("time step", "a shorter time step")):
        check = judge(scalar(0.0), required(0.5), Numerical({name: 10.0}), [])
        assert f"{better} reduces it" in check.why
    known = Numerical({"mesh": 10.0}, "", {"mesh": "cells of 2 mm"})
    assert "cells of 2 mm reduces it" in judge(scalar(0.0), required(0.5), known, []).why


@pytest.mark.parametrize("error", [0.0, 1e6])
def test_nothing_is_answered_where_nothing_bounds_the_discretisation(error: float) -> None:
    unbounded = Numerical({"mesh": np.inf, "time step": 0.1}, "two meshes only")
    check = judge(scalar(error), required(1e9), unbounded, [])
    assert (check.validation, check.acceptance) == ("no answer", "undecided")
    assert (check.why, check.u_num, check.u_val) == ("two meshes only", np.inf, np.inf)
    assert check.margin is None
    assert judge(scalar(error), Accept("p"), unbounded, []).verdict == "no answer"


def test_exact_agreement_without_any_uncertainty() -> None:
    """Volume errors have no noise: zero is zero, anything else differs."""
    assert judged(scalar(0.0, sd=0.0), 0.01).validation == "not distinguishable"
    off = judged(scalar(1e-9, sd=0.0), 0.01)
    assert (off.validation, off.acceptance) == ("differs", "good enough")
    assert (off.why, off.p_value) == ("u_val is zero", 0.0)


# Many points: every one


def test_errors_that_cancel_are_not_good_enough() -> None:
    """+2 and -2 limits: their mean is zero and every one is far outside."""
    check = judged(points(np.array([[2.0], [-2.0]]), 0.01), 1.0)
    assert (check.acceptance, check.validation) == ("not good enough", "differs")
    assert abs(check.value) == 2.0
    assert check.name == "contour.max@9mm"
    mean = judged(points(np.array([[2.0], [-2.0]]), 0.01), 1.0, "mean")
    assert (mean.name, mean.value, mean.acceptance) == ("contour.mean@9mm", 0.0, "good enough")


def test_the_worst_point_decides_and_is_named() -> None:
    values = np.array([[0.1], [-0.9], [0.2], [0.3]])
    check = judged(points(values, 0.1), 1.0)
    assert (check.value, check.acceptance) == (-0.9, "undecided")
    assert "worst of 4 values: number 2" in check.why
    assert judged(points(values, 0.04), 1.0).acceptance == "good enough"


def test_a_point_with_a_larger_uncertainty_may_be_the_worst() -> None:
    near = points(np.array([[0.5], [0.6]]), 0.0)
    change = replace(near, values=np.array([[0.2], [0.0]]))
    check = judge(near, required(0.8), Numerical(), [Sensitivity("pose", change)])
    assert (check.value, check.u_input) == (0.5, pytest.approx(0.2))
    assert check.acceptance == "undecided"


@pytest.mark.parametrize(("k", "c"), [(1, 1), (3, 1), (42, 2), (3, 3)])
@pytest.mark.parametrize("statistic", ["every", "rms", "mean"])
def test_perfect_model_differs_in_5_of_100_repetitions(
    k: int, c: int, statistic: Statistic
) -> None:
    rng = np.random.default_rng(1000 * k + c)
    draws = 0.2 * rng.normal(size=(REPEATS, k, c))
    found = np.mean(
        [judged(points(d, 0.2), None, statistic).validation == "differs" for d in draws]
    )
    assert found == pytest.approx(ALPHA, abs=0.015)


@pytest.mark.parametrize(("k", "c"), [(1, 1), (40, 1), (12, 2)])
@pytest.mark.parametrize("statistic", ["every", "rms", "mean"])
def test_a_model_wrong_by_its_limit_is_rarely_called_either(
    k: int, c: int, statistic: Statistic
) -> None:
    """At the limit both answers are wrong half of the time for no reason; each stays below 5 %."""
    rng = np.random.default_rng(10 * k + c)
    off = np.zeros((k, c))
    off[:, 0] = 1.0
    answers = [
        judged(points(off + 0.1 * rng.normal(size=(k, c)), 0.1), 1.0, statistic).acceptance
        for _ in range(REPEATS)
    ]
    assert answers.count("good enough") / REPEATS < 0.05
    assert answers.count("not good enough") / REPEATS < 0.06


# Many points: an rms


def test_rms_of_many_points_is_what_noise_does_not_explain() -> None:
    """12 points with (3, 4): rms 5; noise 1 per component explains sqrt(2) of it."""
    seen = errors_of(points(np.tile([3.0, 4.0], (12, 1)), 1.0, 0.5), "rms")
    assert (seen.raw, seen.noise) == pytest.approx((5.0, np.sqrt(2.0)))
    assert pytest.approx(np.sqrt(23.0)) == seen.E[0]
    assert seen.systematic == pytest.approx(np.sqrt(2) * 0.5)
    assert judged(points(np.tile([3.0, 4.0], (12, 1))), 9.0, "rms").name == "contour.rms@9mm"


@pytest.mark.parametrize(("k", "c", "true"), [(3, 1, 2.0), (40, 1, 1.0), (12, 2, 3.0)])
def test_interval_of_the_rms_is_that_of_the_noncentral_chi_square(
    k: int, c: int, true: float
) -> None:
    """The larger side of the interval, half of it, computed in another way: by its quantiles."""
    m = k * c
    values = np.zeros((k, c))
    values[:, 0] = np.sqrt(true**2 + c)
    seen = errors_of(points(values), "rms")
    x, low, high = m / c * (true**2 + c), true - 2 * seen.u_D[0], true + 2 * seen.u_D[0]
    inside = ncx2.cdf(x, m, m / c * max(low, 1e-9) ** 2) > 1 - ALPHA - 1e-9 or low <= 0
    assert inside
    assert ncx2.cdf(x, m, m / c * high**2) < ALPHA / 2 + 1e-9


def test_noise_is_counted_once() -> None:
    """40 points of noise 1 about a bias of 2: u_D is that of a mean square, 1/sqrt(40) or so."""
    rng = np.random.default_rng(4)
    found = [errors_of(points(2 + rng.normal(size=(40, 1))), "rms") for _ in range(400)]
    spread = np.std([f.E[0] for f in found])
    claimed = np.median([f.u_D[0] for f in found])
    assert spread == pytest.approx(1 / np.sqrt(40), rel=0.15)
    assert 1.0 < claimed / spread < 1.25


def test_residual_smaller_than_its_noise_is_no_error() -> None:
    seen = errors_of(points(np.full((10, 1), -0.5)), "rms")
    assert (seen.E[0], seen.raw, seen.noise) == (0.0, 0.5, 1.0)
    assert str(seen.E[0]) == "0.0"
    bound = np.sqrt(_upper(10.0, 10) / 10)
    assert 2 * seen.u_D[0] == pytest.approx(bound, rel=1e-6)
    assert judged(points(np.full((10, 1), 0.5)), None, "rms").validation == "not distinguishable"


def _upper(x: float, m: int) -> float:
    """The noncentrality that leaves half of ALPHA below x, by bisection."""
    low, high = 0.0, 1e3
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if ncx2.cdf(x, m, middle) > ALPHA / 2 else (low, middle)
    return low


@pytest.mark.parametrize(("k", "c"), [(1, 1), (40, 1), (42, 2)])
def test_bias_of_three_u_is_found(k: int, c: int) -> None:
    values = np.full((k, c), 3.0 / np.sqrt(c))
    check = judged(points(values + 0.0, 0.3), 1e9, "rms")
    assert check.validation == "differs"
    assert check.value == pytest.approx(3.0, rel=0.02)


def test_noisy_bias_is_found_as_often_as_the_normal_law_says() -> None:
    """|3 + z| > 2 for 84.1 % of normal z; 1.5 u is missed in 69.1 %."""
    z = np.random.default_rng(3).normal(size=2000)
    for bias, share in ((3.0, 0.8413), (1.5, 0.3087)):
        found = np.mean([judged(scalar(bias + zi)).validation == "differs" for zi in z])
        assert found == pytest.approx(share, abs=0.02)


def test_the_largest_of_many_lengths_by_chance() -> None:
    """Of 12 points in a plane the largest length that noise shows in 4.6 % of repetitions."""
    reach = errors_of(points(np.zeros((12, 2)))).reach(np.zeros(12))[0]
    assert reach == pytest.approx(np.sqrt(chi2.ppf((1 - ALPHA) ** (1 / 12), 2)), rel=1e-6)


# What is not a number


@pytest.mark.parametrize("hole", [np.nan, np.inf])
def test_what_is_not_a_number_is_never_good_enough(hole: float) -> None:
    """A NaN compares false with everything, so every branch would let it through."""
    checks = [judged(scalar(1.0, sd=hole)), judged(scalar(1.0, systematic=hole))]
    assert [(c.validation, c.acceptance) for c in checks] == 2 * [("no answer", "undecided")]
    assert all("not a finite number: " in c.why for c in checks)


@pytest.mark.parametrize("limit", [np.nan, np.inf, 0.0, -1.0])
def test_a_limit_is_a_positive_number(limit: float) -> None:
    with pytest.raises(ComparisonError, match="expected a positive number"):
        Accept("force", limit, "ours")


def test_an_unknown_statistic_is_refused() -> None:
    with pytest.raises(ComparisonError, match="'median'; expected one of every, rms"):
        Accept("force", 1.0, "ours", statistic="median")  # type: ignore[arg-type]


# What is no evidence


def test_fitted_is_no_evidence_whatever_the_error() -> None:
    for value in (0.1, 9.0):
        check = as_fitted(judged(scalar(value)), "served to identify")
        assert (check.validation, check.acceptance, check.evidence) == ("fitted", "fitted", False)
        assert check.why.startswith("served to identify: no evidence; |E| is")
    free = as_fitted(judged(scalar(0.1), None), "served to identify")
    assert (free.verdict, free.acceptance) == ("fitted", "no requirement")
    nothing = nothing_compared(required(1.0), "pressure", "Pa", "no such quantity")
    assert as_fitted(nothing, "served") == nothing


def test_a_model_of_its_own_recording_is_never_confirmed_but_may_fail() -> None:
    same = as_same_model(judged(scalar(0.1)), "same")
    assert (same.validation, same.acceptance, same.evidence) == ("same model", "same model", False)
    differs = as_same_model(judged(scalar(9.0)), "same")
    assert (differs.validation, differs.acceptance) == ("differs", "same model")
    assert as_same_model(judged(scalar(9.0), None), "same").verdict == "differs"
    assert as_same_model(judged(scalar(9.0), 1.0), "same").verdict == "not good enough"
    assert as_same_model(judged(scalar(0.1), 0.5), "same").verdict == "undecided"


def test_what_compared_nothing_says_so_with_and_without_a_requirement() -> None:
    for accept, word in ((required(1.0), "nothing compared"), (Accept("p"), "no requirement")):
        check = nothing_compared(accept, "p@9mm", "Pa", "unknown load")
        assert (check.acceptance, check.validation) == (word, "nothing compared")
        assert (check.verdict, check.count, check.margin) == ("nothing compared", 0, None)


# The whole


def test_result_that_checked_nothing_has_failed() -> None:
    nothing = Result("n", "t", "s", "", (), (), (), (), (), ())
    assert nothing.checks == ()
    assert not nothing.passed
    assert not nothing.as_expected


# Limits that nothing could fail


@pytest.mark.parametrize(("limit", "answer"), [(9.9, "good enough"), (10.0, "undecided")])
def test_a_limit_as_wide_as_what_was_measured_decides_nothing(limit: float, answer: str) -> None:
    near = replace(scalar(0.5), scale=10.0)
    check = judge(near, required(limit), Numerical(), [])
    assert check.acceptance == answer
    assert ("as large as the largest measured value, 10" in check.why) == (limit == 10.0)
    assert judge(replace(near, scale=None), required(1e9), Numerical(), []).evidence


@pytest.mark.parametrize(("k", "c"), [(25, 1), (200, 1), (12, 3)])
@pytest.mark.parametrize("shared", [0.3, 1.0, 5.0])
def test_a_shift_that_all_points_share_is_added_to_the_largest_of_them(
    k: int, c: int, shared: float
) -> None:
    """Noise of 1 and one shift along an axis: the quadrature of both was short, 15 % for 4.6."""
    rng = np.random.default_rng(17)
    draws = rng.normal(size=(20_000, k, c))
    draws[:, :, 0] += shared * rng.normal(size=(20_000, 1))
    largest = np.linalg.norm(draws, axis=2).max(axis=1)
    reach = errors_of(points(np.zeros((k, c)))).reach(np.full(k, shared))[0]
    assert np.mean(largest > reach) == pytest.approx(ALPHA, abs=0.008)
