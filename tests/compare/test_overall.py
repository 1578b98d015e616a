"""Both answers over many checks: the intersection-union test, Holm's correction, what fails."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from report_samples import small_result
from scipy.stats import norm

from validate.commands.run_screen import headline
from validate.compare.overall_verdict import correction, judge_all
from validate.compare.verdict import ALPHA, Acceptance, Check, Validation
from validate.pipeline.checks.verdict_sentence import verdict_sentence

_NAMES = count()


def check(
    value: float,
    validation: Validation | None = None,
    acceptance: Acceptance = "no requirement",
    count: int = 1,
    name: str | None = None,
) -> Check:
    """An error of so many u_val, of a comparison of its own."""
    own: Validation = "differs" if abs(value) > 2 else "not distinguishable"
    name = name or f"q{next(_NAMES)}"
    return Check(name, value, None if acceptance == "no requirement" else 9.0, 1.0, 1.0, 0.0, 0.0,
                 "m", count, validation or own, acceptance, "because", abs(value) / 2)  # fmt: skip


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
    assert (none.differs, len(none.alone), none.passed) == ((), 3, True)
    assert none.word == "not distinguishable"


def test_perfect_experiments_of_many_checks_rarely_differ() -> None:
    """2000 perfect experiments of 20 checks: alone 60 % show a difference, corrected 4.6 %."""
    z = np.random.default_rng(5).normal(size=(2000, 20))
    found = [judge_all([check(v) for v in row]) for row in z]
    shown = np.mean([bool(f.differs or f.alone) for f in found])
    assert shown == pytest.approx(1 - 0.9545**20, abs=0.03)
    assert np.mean([not f.passed for f in found]) < 0.06


def test_all_requirements_met_passes_whatever_differs() -> None:
    """No correction: each is met by itself (intersection-union test)."""
    found = judge_all([check(9.0, None, "good enough"), check(3.0, None, "good enough")])
    assert (found.word, found.passed, len(found.met)) == ("good enough", True, 2)
    assert len(found.differs) == 2
    free = judge_all([check(9.0, None, "good enough"), check(9.0)])
    assert (free.word, free.passed) == ("good enough", True)


@pytest.mark.parametrize(
    ("acceptance", "word"), [("not good enough", "not good enough"), ("undecided", "undecided")]
)
def test_one_requirement_that_is_not_met_fails_all(acceptance: Acceptance, word: str) -> None:
    others = [check(0.1, None, "good enough") for _ in range(20)]
    found = judge_all([*others, check(0.1, None, acceptance)])
    assert (found.word, found.passed) == (word, False)


def test_not_good_enough_is_said_before_undecided() -> None:
    both = [check(0.1, None, "undecided"), check(9.0, None, "not good enough")]
    assert judge_all(both).word == "not good enough"


def test_undecided_counts_as_a_test() -> None:
    found = judge_all([check(2.1), check(0.5, None, "undecided")])
    assert (found.differs, found.passed, found.word) == ((), False, "undecided")
    assert found.counted == "evidence: 1 of 2 checks"


def test_what_has_no_bound_and_no_requirement_fails() -> None:
    assert not judge_all([check(0.1), check(0.1, "no answer")]).passed
    met = judge_all([check(0.1, None, "good enough"), check(0.1, "no answer")])
    assert (met.word, met.passed) == ("good enough", True)


@pytest.mark.parametrize("word", ["fitted", "same model"])
def test_without_evidence_nothing_fails_and_nothing_is_confirmed(word: Validation) -> None:
    for acceptance in (word, "no requirement"):
        found = judge_all([check(0.1, word, acceptance) for _ in range(3)])  # type: ignore[arg-type]
        assert (found.passed, found.word) == (True, "no evidence")
        assert found.counted == "evidence: 0 of 3 checks"


def test_fitted_checks_do_not_dilute_the_correction() -> None:
    assert judge_all([check(2.1), *(check(9.0, "fitted") for _ in range(3))]).differs


def test_nothing_compared_has_failed_whatever_else_is_met() -> None:
    assert (judge_all([]).passed, judge_all([]).word) == (False, "nothing compared")
    absent = check(0.0, "nothing compared", "nothing compared", 0)
    found = judge_all([check(0.1, None, "good enough"), absent])
    assert (found.passed, found.word) == (False, "nothing compared")


def test_an_error_without_uncertainty_is_certain() -> None:
    sure = replace(check(1e-9, "differs"), u_val=0.0, ratio=np.inf)
    assert judge_all([sure, *(check(0.1) for _ in range(20))]).differs == (sure,)


def test_methods_on_the_same_data_are_one_piece_of_evidence() -> None:
    """Two models fitted to one slope show one error: the second adds and hides nothing."""
    two = judge_all([check(-0.8, name="force@10pct"), check(-0.8, name="force@10pct")])
    assert (two.evidence, two.total, two.word) == (1, 1, "not distinguishable")
    assert two.counted == "evidence: 1 of 1 checks (1 more on the same data)"
    assert len(judge_all([check(2.01, name="f"), check(2.01, name="f")]).differs) == 2


def test_a_method_without_a_difference_does_not_hide_one_that_differs() -> None:
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


def test_an_interval_that_excludes_zero_says_what_it_is_corrected_for() -> None:
    """In the sentence of the report and on the terminal; nothing where none excludes it."""
    inside = [check(1.9, count=40), check(-0.5, count=7)]
    many = [*inside, check(2.4, "not distinguishable", count=30)]
    alone = [*inside, check(2.1)]
    assert [correction(c) for c in (inside, many)] == ["", " (corrected for 30 comparisons)"]
    for checks, number in ((inside, 0), (many, 30), (alone, 3)):
        method = replace(small_result().methods[0], checks=tuple(checks))
        result = replace(small_result(), methods=(method,))
        line = headline(result)
        assert "no error is distinguishable" in line
        assert (f"corrected for {number} comparisons" in line) == (number > 0)
        said = verdict_sentence(result.methods, "measured", quick=False)
        assert ("corrected for 30 comparisons" in said) == (number == 30)
