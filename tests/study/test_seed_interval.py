"""Intervals against tables of Student's t, and their coverage on fixed draws."""

import numpy as np
import pytest

from validate.study.filters.score import FilterScores, SeedInterval, interval, score_difference


def test_the_95_percent_interval_of_five_numbers() -> None:
    found = interval([1.0, 2.0, 3.0, 4.0, 5.0])
    assert found.mean == 3.0
    assert found.half == pytest.approx(2.7764 * np.sqrt(2.5 / 5), rel=1e-4)  # t(.975, 4) = 2.7764


def test_one_number_has_no_interval() -> None:
    assert interval([2.0]) == SeedInterval(2.0, None, 1)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    draws = np.random.default_rng(3).standard_normal((2000, 6))
    found = [interval(row.tolist()) for row in draws]
    share = np.mean([i.low <= 0 <= i.high for i in found])
    assert share == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / 2000))


def test_pairs_see_what_common_noise_hides() -> None:
    noise = np.random.default_rng(4).standard_normal(20)
    one, other = (noise + 0.1).tolist(), noise.tolist()
    assert interval(one).overlaps(interval(other))
    scores = [FilterScores({"e": tuple(v)}, {"e": "m"}) for v in (one, other)]
    apart = score_difference(scores[0], scores[1], "e", None)
    assert apart.mean == pytest.approx(0.1)
    assert apart.low > 0.09
