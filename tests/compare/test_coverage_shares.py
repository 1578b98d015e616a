"""How often a verdict is wrong: exact intervals, and the term that is named."""

import numpy as np
import pytest
from scipy.stats import binomtest

from validate.compare.coverage import Share, Term, find_fault, reach, term
from validate.compare.overall_verdict import ALPHA


@pytest.mark.parametrize(("number", "count"), [(0, 20), (9, 200), (200, 200), (1, 3)])
def test_the_interval_is_that_of_clopper_and_pearson(number: int, count: int) -> None:
    low, high = binomtest(number, count).proportion_ci(0.95, "exact")
    assert (Share(number, count).low, Share(number, count).high) == pytest.approx((low, high))


def test_two_to_seven_percent_hold() -> None:
    assert [Share(n, 200).inside for n in (3, 4, 14, 15)] == [False, True, True, False]


def test_what_a_normal_law_shows_is_its_standard_deviation() -> None:
    errors = 0.3 * np.random.default_rng(1).standard_normal(200_000)
    assert reach(errors) == pytest.approx(0.3, rel=0.01)


def test_a_uniform_range_shows_less_than_its_spread_and_is_named_for_its_end() -> None:
    z = np.linspace(-np.sqrt(3), np.sqrt(3), 20_001)
    found = term("u_input (modulus)", 1.0, z)
    assert found.spread == pytest.approx(1.0, rel=1e-3)
    assert found.shown == pytest.approx(np.sqrt(3) / 2 * (1 - ALPHA), rel=1e-3)
    assert "a uniform range ends at 1.73 u" in find_fault(Share(0, 200), [found]).words


MEASURED = Term("measurement", 1.0, 1.0, 1.0, "measurement")
MESH = Term("u_num (mesh)", 2.0, 0.0, 0.0, "numerical")
NARROW = Term("u_input (modulus)", 1.0, 3.0, 3.0)


def test_the_term_that_is_furthest_off_that_way_is_named() -> None:
    terms = [MEASURED, MESH, NARROW]
    assert find_fault(Share(9, 200), terms).word == "holds"
    wide, narrow = (find_fault(Share(n, 200), terms) for n in (0, 60))
    assert (wide.word, wide.fault) == ("blunt", MESH)
    assert (narrow.word, narrow.fault) == ("too narrow", NARROW)


@pytest.mark.parametrize("right", [MESH, Term("u_input (modulus)", 2.0, 1.65, 2.0)])
def test_what_claims_rightly_more_than_it_shows_is_blunt_and_hides_no_term_that_does_not(
    right: Term,
) -> None:
    assert find_fault(Share(0, 200), [MEASURED, right]).word == "blunt"
    wide = Term("measurement", 2.0, 1.0, 1.0, "measurement")
    found = find_fault(Share(0, 200), [wide, right])
    assert (found.word, found.fault) == ("too wide", wide)
    little = Term("u_num (mesh)", 0.2, 0.0, 0.0, "numerical")
    assert find_fault(Share(3, 200), [MEASURED, little]).word == "blunt"
    by_chance = find_fault(Share(3, 200), [MEASURED])
    assert (by_chance.word, by_chance.fault) == ("too wide", None)


def test_no_term_is_blamed_where_none_is_off() -> None:
    found = find_fault(Share(40, 200), [MEASURED])
    assert (found.word, found.fault) == ("too narrow", None)
    assert "act together" in found.words


def test_a_share_that_chance_explains_says_so() -> None:
    assert "may be chance" in find_fault(Share(15, 200), [NARROW]).words
    assert "may be chance" not in find_fault(Share(60, 200), [NARROW]).words
