"""Bias and scatter over experiments: by hand, against draws of known ones, and the area metric."""

import numpy as np
import pytest

from validate.arrays import Floats
from validate.compare.bias import Predicted, Statement, area_metric, statement
from validate.errors import ComparisonError


def of(ratios: Floats | list[float], own: float = 0.0, specimens: str = "") -> Statement:
    names = specimens or [str(i) for i in range(len(ratios))]
    return statement(
        [Predicted(name, float(np.log(r)), own) for name, r in zip(names, ratios, strict=True)]
    )


def test_three_predictions_by_hand() -> None:
    found = of(np.exp([0.0, 0.1, 0.2]), own=0.06)
    scatter = np.sqrt(0.1**2 - 0.06**2)  # 0.08
    assert found.scatter is not None
    assert found.scatter.value == pytest.approx(scatter)
    assert found.bias.value == pytest.approx(np.exp(0.1 + 0.08**2 / 2 - 0.06**2 / 2))
    off = 4.302653 * 0.1 / np.sqrt(3)  # Student's t of two degrees
    assert found.bias.low == pytest.approx(found.bias.value * np.exp(-off))
    assert found.bias.high == pytest.approx(found.bias.value * np.exp(off))
    assert found.scatter.low == pytest.approx(0.0)  # 0.1^2 2/7.3778 = 0.0521^2 < own^2
    assert found.scatter.high == pytest.approx(np.sqrt(0.1**2 * 2 / 0.0506356 - 0.06**2))
    assert (found.points, found.specimens, found.own) == (3, 3, pytest.approx(0.06))


def test_repeats_of_a_specimen_weigh_no_more_than_it() -> None:
    ratios = np.exp([0.3, 0.3, 0.3, 0.3, 0.1])
    found = of(ratios, specimens="aaaab")
    twice = of(np.exp([0.3, 0.1]))
    assert found.bias == twice.bias
    assert found.scatter == twice.scatter
    assert (found.points, found.specimens) == (5, 2)


def test_what_varies_within_specimens_is_scatter_as_well() -> None:
    found = of(np.exp([0.2, 0.4, -0.1, 0.1]), specimens="aabb")
    assert found.scatter is not None
    # Between the means 0.3 and 0.0: 0.045; within, 0.01 each.
    assert found.scatter.value == pytest.approx(np.sqrt(0.045 + 0.01))


def test_one_specimen_has_no_interval_and_one_point_no_scatter() -> None:
    alone = of([1.2])
    assert (alone.bias.value, alone.bias.low, alone.scatter) == (pytest.approx(1.2), None, None)
    same = of(np.exp([0.0, 0.2]), specimens="aa")
    assert same.scatter is not None
    assert same.scatter.value == pytest.approx(np.sqrt(0.02))
    assert (same.bias.low, same.scatter.low, same.scatter.high) == (None, None, None)
    with pytest.raises(ComparisonError, match="0 predictions"):
        statement([])


def test_intervals_hold_what_was_drawn() -> None:
    """Predictions 8 % high with 12 % scatter, measured within 6 %: ten at a time."""
    rng = np.random.default_rng(3)
    delta, model, own, draws = 1.08, 0.12, 0.06, 1500
    truth = rng.uniform(1.0, 9.0, (draws, 10))
    measured = truth * np.exp(own * rng.normal(size=truth.shape) - own**2 / 2)
    predicted = delta * truth * np.exp(model * rng.normal(size=truth.shape) - model**2 / 2)
    found = [of(p / m, own) for p, m in zip(predicted, measured, strict=True)]
    assert np.mean([s.bias.value for s in found]) == pytest.approx(delta, rel=0.004)
    scatter = [s.scatter for s in found if s.scatter]
    assert np.mean([s.value**2 for s in scatter]) == pytest.approx(model**2, rel=0.05)
    holds = np.mean([s.bias.low <= delta <= s.bias.high for s in found])  # type: ignore[operator]
    assert 0.935 < holds < 0.965
    held = np.mean([s.low <= model <= s.high for s in scatter])  # type: ignore[operator]
    assert 0.935 < held < 0.965


def test_intervals_hold_where_specimens_have_many_points() -> None:
    """Eight specimens, each 10 % off in its own way and measured at five loads."""
    rng = np.random.default_rng(4)
    each = 0.1 * rng.normal(size=(800, 8, 1)) + 0.03 * rng.normal(size=(800, 8, 5))
    names = [str(i) for i in range(8) for _ in range(5)]
    found = [
        statement([Predicted(n, float(y), 0.0) for n, y in zip(names, one.ravel(), strict=True)])
        for one in each
    ]
    delta = np.exp((0.1**2 + 0.03**2) / 2)
    holds = np.mean([s.bias.low <= delta <= s.bias.high for s in found])  # type: ignore[operator]
    assert 0.93 < holds < 0.97  # of forty independent points it would be 0.6


@pytest.mark.parametrize(("E", "a", "b"), [(0.3, 0.2, 0.1), (-1.0, 0.0, 0.4), (0.0, 0.5, 0.1)])
def test_the_area_lies_between_the_two_distributions(E: float, a: float, b: float) -> None:
    from scipy.special import ndtr

    x = np.linspace(-6, 6, 200_001)
    one = ndtr((x - E) / a) if a else (x >= E).astype(float)
    area = np.abs(one - ndtr(x / b)).sum() * (x[1] - x[0])
    assert area_metric(E, a, b) == pytest.approx(area, abs=2e-4)


def test_the_area_of_sharp_values_is_their_distance() -> None:
    assert area_metric(-0.7, 0.0, 0.0) == 0.7
    assert area_metric(-0.7, 0.2, 0.2) == 0.7
