"""The verdict over many checks: Holm's correction, evidence, and what fails."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from scipy.stats import norm

from validate.compare.overall import ALPHA, judge_all
from validate.compare.verdict import Check, Verdict

_NAMES = count()


def check(
    value: float, verdict: Verdict | None = None, count: int = 1, name: str | None = None
) -> Check:
    """An error of so many u_val, of a comparison of its own."""
    own: Verdict = "differs" if abs(value) > 2 else "agrees"
    name = name or f"q{next(_NAMES)}"
    return Check(name, value, 9.0, 1.0, 1.0, 0.0, 0.0, "m", count, verdict or own, "because")


def test_one_check_is_not_corrected() -> None:
    assert pytest.approx(2 * norm.sf(2.0)) == ALPHA
    assert judge_all([check(2.01)]).differs
    assert not judge_all([check(1.99)]).differs


def test_holm_by_hand() -> None:
    """Three checks: the smallest p against alpha/3, the next against alpha/2, the last alpha."""
    third, half = (float(norm.isf(ALPHA / (2 * m))) for m in (3, 2))
    assert len(judge_all([check(third + 0.01), check(0.1), check(2.1)]).differs) == 1
    both = judge_all([check(0.1), check(half + 0.01), check(third + 0.01)])
    assert [c.value for c in both.differs] == [half + 0.01, third + 0.01]
    assert len(judge_all([check(2.1), check(half + 0.01), check(-third - 0.01)]).differs) == 3
    none = judge_all([check(third - 0.01), check(2.1), check(2.1)])
    assert (none.differs, len(none.alone), none.passed, none.word) == ((), 3, True, "agrees")


def test_perfect_experiments_of_many_checks_rarely_differ() -> None:
    """2000 perfect experiments of 20 checks: alone 60 % show a difference, corrected 4.6 %."""
    z = np.random.default_rng(5).normal(size=(2000, 20))
    found = [judge_all([check(v) for v in row]) for row in z]
    shown = np.mean([bool(f.differs or f.alone) for f in found])
    assert shown == pytest.approx(1 - 0.9545**20, abs=0.03)
    assert np.mean([not f.passed for f in found]) < 0.06


def test_undecided_counts_as_a_test_and_fails() -> None:
    found = judge_all([check(2.1), check(0.5, "cannot decide")])
    assert (found.differs, found.passed, found.word) == ((), False, "undecided")
    assert found.counted == "evidence: 1 of 2 checks"


@pytest.mark.parametrize("verdict", ["fitted", "repeats itself"])
def test_without_evidence_nothing_fails_and_nothing_agrees(verdict: Verdict) -> None:
    found = judge_all([check(0.1, verdict) for _ in range(3)])
    assert (found.passed, found.word) == (True, "no evidence")
    assert found.counted == "evidence: 0 of 3 checks"


def test_fitted_checks_do_not_dilute_the_correction() -> None:
    assert judge_all([check(2.1), *(check(9.0, "fitted") for _ in range(3))]).differs


def test_nothing_checked_has_failed() -> None:
    assert not judge_all([]).passed
    assert judge_all([]).word == "undecided"


def test_an_error_without_uncertainty_is_certain() -> None:
    sure = replace(check(1e-9, "differs"), u_val=0.0)
    assert judge_all([sure, *(check(0.1) for _ in range(20))]).differs == (sure,)


def test_methods_on_the_same_data_are_one_piece_of_evidence() -> None:
    """Two models fitted to one slope show one error: the second adds and hides nothing."""
    two = judge_all([check(-0.8, name="force@10pct"), check(-0.8, name="force@10pct")])
    assert (two.evidence, two.total, two.word) == (1, 1, "agrees")
    assert two.counted == "evidence: 1 of 1 checks (1 more on the same data)"
    assert len(judge_all([check(2.01, name="f"), check(2.01, name="f")]).differs) == 2


def test_a_method_that_agrees_does_not_hide_one_that_differs_on_the_same_data() -> None:
    found = judge_all([check(0.1, name="f"), check(2.5, name="f"), check(0.1, name="g")])
    assert [c.value for c in found.differs] == [2.5]
    assert (found.evidence, found.total, found.again) == (2, 2, 1)
    weak = judge_all([check(2.1, name="f"), check(9.0, name="f"), check(0.1, name="g")])
    assert [c.value for c in weak.differs] == [9.0]
    assert [c.value for c in weak.alone] == [2.1]


@pytest.mark.parametrize("weaker_first", [False, True])
def test_repeated_names_are_corrected_by_hand(weaker_first: bool) -> None:
    """Three checks of two comparisons: f counts once, by its smallest p, against alpha/2."""
    third, half = (float(norm.isf(ALPHA / (2 * m))) for m in (3, 2))
    beyond = half + 0.01
    assert beyond < third  # three comparisons would not reject it
    pair = [check(beyond, name="f"), check(2.1, name="f")]
    found = judge_all([*(pair[::-1] if weaker_first else pair), check(0.1, name="g")])
    assert [c.value for c in found.differs] == [beyond]
    assert [c.value for c in found.alone] == [2.1]
    last = judge_all([check(9.0, name="g"), *pair])  # g is gone: f is held against alpha
    assert [c.value for c in last.differs] == [9.0, beyond, 2.1]
