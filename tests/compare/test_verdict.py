"""Verdicts: every branch, and how often noise alone or a known bias is called a difference."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from validate.compare.convergence import Numerical
from validate.compare.residual import Residual
from validate.compare.result import Result
from validate.compare.verdict import (
    Accept,
    Check,
    Sensitivity,
    as_fitted,
    as_repeated,
    error_of,
    judge,
)
from validate.errors import ComparisonError


def scalar(value: float, sd: float = 1.0, systematic: float = 0.0) -> Residual:
    return Residual("pressure", "9mm", np.array([[value]]), sd, systematic, "Pa", "")


def points(values: np.ndarray, sd: float = 1.0, systematic: float = 0.0) -> Residual:
    return Residual("contour", "9mm", values, sd, systematic, "m", "")


def judged(residual: Residual, limit: float = 1e9, **inputs: float) -> Check:
    """Judged without a discretisation; inputs of one unit each."""
    parts = [
        Sensitivity(name, replace(residual, values=np.full(residual.values.shape, size)))
        for name, size in inputs.items()
    ]
    return judge(residual, limit, Numerical(), parts)


# The three verdicts


@pytest.mark.parametrize(
    ("value", "limit", "verdict"),
    [
        (0.0, 3.0, "agrees"),
        (1.99, 3.0, "agrees"),
        (-1.99, 3.0, "agrees"),
        (2.0, 2.0, "agrees"),
        (2.01, 3.0, "differs"),
        (-2.01, 3.0, "differs"),
        (2.01, 1.0, "differs"),
        (1.99, 1.99, "cannot decide"),
        (0.0, 0.5, "cannot decide"),
    ],
)
def test_branches(value: float, limit: float, verdict: str) -> None:
    check = judged(scalar(value), limit)
    assert check.verdict == verdict
    assert check.evidence == (verdict != "cannot decide")
    assert (check.value, check.u_val, check.count, check.unit) == (value, 1.0, 1, "Pa")
    assert check.name == "pressure@9mm"


def test_uncertainties_add_in_squares() -> None:
    """u_D 3 and 4, u_num 12 of mesh and step, inputs 2 x 6 and 5: 13 from (5, 12)."""
    one = scalar(1.0, 3.0, 4.0)
    numerical = Numerical({"mesh": 12.0 * 0.6, "time step": 12.0 * 0.8}, "three meshes")
    inputs = [Sensitivity("friction", scalar(-12.0)), Sensitivity("pose", scalar(5.0))]
    check = judge(one, 1e3, numerical, inputs)
    assert check.numerical == "three meshes"
    assert check.u_D == pytest.approx(5.0)
    assert check.u_num == pytest.approx(12.0)
    assert check.u_input == pytest.approx(13.0)
    assert check.u_val == pytest.approx(np.sqrt(25 + 144 + 169))


def test_undecided_names_what_would_decide() -> None:
    for name, parts in (
        ("measurement", {}),
        ("friction", {"friction": 2.0, "pose": 1.5}),
        ("pose", {"friction": 2.0, "pose": 2.5}),
    ):
        why = judged(scalar(0.1), 0.5, **parts).why
        assert f"better measurement of '{name}' would decide" in why
        assert "exceeds the limit 0.5" in why
    for name, better in (("mesh", "a finer mesh"), ("time step", "a shorter time step")):
        check = judge(scalar(0.0), 0.5, Numerical({name: 10.0}), [])
        assert f"{better} would decide" in check.why


@pytest.mark.parametrize("error", [0.0, 1e6])
def test_nothing_is_decided_where_nothing_bounds_the_discretisation(error: float) -> None:
    unbounded = Numerical({"mesh": np.inf, "time step": 0.1}, "diverging: cells of 1 mm decide")
    check = judge(scalar(error), 1e9, unbounded, [])
    assert (check.verdict, check.why) == ("cannot decide", "diverging: cells of 1 mm decide")
    assert (check.u_num, check.u_val) == (np.inf, np.inf)


def test_exact_agreement_without_any_uncertainty() -> None:
    """Volume errors have no noise: zero agrees, anything else differs."""
    assert judged(scalar(0.0, sd=0.0), 0.01).verdict == "agrees"
    off = judged(scalar(1e-9, sd=0.0), 0.01)
    assert (off.verdict, off.why) == ("differs", "u_val is zero")


# Many points


def test_error_of_many_points_is_what_noise_does_not_explain() -> None:
    """12 points with (3, 4): rms 5; noise 1 per component explains sqrt(2) of it."""
    seen = error_of(points(np.tile([3.0, 4.0], (12, 1)), 1.0, 0.5))
    reach = np.sqrt(2.0 * (chi2.ppf(0.95, 24) / 24 - 1))
    assert (seen.raw, seen.noise) == pytest.approx((5.0, np.sqrt(2.0)))
    assert pytest.approx(np.sqrt(23.0)) == seen.E
    assert seen.u_D == pytest.approx(np.hypot(reach / 2, np.sqrt(2) * 0.5))
    assert judged(points(np.tile([3.0, 4.0], (12, 1)))).name == "contour.rms@9mm"


def test_residual_smaller_than_its_noise_is_no_error() -> None:
    seen = error_of(points(np.full((10, 1), -0.5)))
    assert (seen.E, seen.raw, seen.noise) == (0.0, 0.5, 1.0)
    assert str(seen.E) == "0.0"
    assert judged(points(np.full((10, 1), 0.5))).verdict == "agrees"


@pytest.mark.parametrize(("k", "c"), [(1, 1), (1, 2), (3, 1), (40, 1), (42, 2)])
def test_perfect_model_agrees_in_95_of_100_repetitions(k: int, c: int) -> None:
    """4000 repetitions: the share has a standard deviation of 0.35 %."""
    rng = np.random.default_rng(1000 * k + c)
    runs = 4000
    found = sum(
        judged(points(0.2 * rng.normal(size=(k, c)), 0.2)).verdict == "agrees" for _ in range(runs)
    )
    assert found / runs == pytest.approx(0.954 if k * c == 1 else 0.95, abs=0.012)


@pytest.mark.parametrize(("k", "c"), [(1, 1), (40, 1), (42, 2)])
def test_bias_of_three_u_is_found(k: int, c: int) -> None:
    values = np.zeros((k, c))
    u = error_of(points(values + 1e6)).u_D
    noise = 0.0 if k * c == 1 else float(c)
    values[:, 0] = np.sqrt((3 * u) ** 2 + noise)
    check = judged(points(values))
    assert check.value == pytest.approx(3 * u)
    assert check.verdict == "differs"
    assert check.why == "|E| is 3.0 u_val"


def test_noisy_bias_is_found_as_often_as_the_normal_law_says() -> None:
    """|3 + z| > 2 for 84.1 % of normal z; 1.5 u is missed in 69.1 %."""
    z = np.random.default_rng(3).normal(size=4000)
    for bias, share in ((3.0, 0.8413), (1.5, 0.3087)):
        found = np.mean([judged(scalar(bias + zi)).verdict == "differs" for zi in z])
        assert found == pytest.approx(share, abs=0.02)


def test_error_of_one_component_keeps_its_sign() -> None:
    """A force too low at every sample is a negative error; distances in a plane have no sign."""
    assert pytest.approx(-np.sqrt(24.0)) == error_of(points(np.full((12, 1), -5.0))).E
    assert pytest.approx(np.sqrt(24.0)) == error_of(points(np.full((12, 1), 5.0))).E
    assert error_of(points(np.full((12, 2), -5.0))).E > 0


# What is not a number


@pytest.mark.parametrize("hole", [np.nan, np.inf])
def test_what_is_not_a_number_never_agrees(hole: float) -> None:
    """A NaN compares false with everything, so every branch would let it through to `agrees`."""
    still = scalar(1.0)
    checks = [
        judged(scalar(1.0, sd=hole)),
        judged(scalar(1.0, systematic=hole)),
        judged(still, limit=hole),
    ]
    assert [c.verdict for c in checks] == 3 * ["cannot decide"]
    assert all("not a finite number: " in c.why for c in checks)


@pytest.mark.parametrize("limit", [np.nan, np.inf, 0.0, -1.0])
def test_accepted_limit_is_a_positive_number(limit: float) -> None:
    with pytest.raises(ComparisonError, match="is not a positive number"):
        Accept("force", limit, "ours")


# What is no evidence


def test_fitted_is_no_evidence_whatever_the_error() -> None:
    for value in (0.1, 9.0):
        check = as_fitted(judged(scalar(value)), "served to identify")
        assert (check.verdict, check.evidence) == ("fitted", False)
        assert check.why.startswith("served to identify: no evidence; |E| is")
    nothing = replace(judged(scalar(0.1)), count=0, verdict="cannot decide")
    assert as_fitted(nothing, "served") == nothing


def test_a_model_that_repeats_itself_cannot_agree_but_may_differ() -> None:
    assert as_repeated(judged(scalar(0.1)), "same").verdict == "repeats itself"
    assert as_repeated(judged(scalar(9.0)), "same").verdict == "differs"
    assert as_repeated(judged(scalar(0.1), 0.5), "same").verdict == "cannot decide"


# The whole


def test_result_that_checked_nothing_has_failed() -> None:
    nothing = Result("n", "t", "s", "", (), (), (), (), (), ())
    assert nothing.checks == ()
    assert not nothing.passed


# Limits that nothing could fail


@pytest.mark.parametrize(("limit", "verdict"), [(9.9, "agrees"), (10.0, "cannot decide")])
def test_a_limit_as_wide_as_what_was_measured_decides_nothing(limit: float, verdict: str) -> None:
    near = replace(scalar(0.5), scale=10.0)
    check = judge(near, limit, Numerical(), [])
    assert check.verdict == verdict
    assert ("as wide as the largest that was measured, 10" in check.why) == (limit == 10.0)
    assert judge(replace(near, scale=None), 1e9, Numerical(), []).verdict == "agrees"
    assert judge(replace(scalar(9.0), scale=10.0), 1e9, Numerical(), []).verdict == "differs"
