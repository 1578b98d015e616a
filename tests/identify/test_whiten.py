"""What is whitened has the chi-square of its covariance."""

import numpy as np
import pytest

from validate.errors import ComparisonError
from validate.identify.least_squares import whitened


def test_chi_square_is_that_of_noise_and_what_all_points_share() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(size=(7, 2))
    sd, shared = 0.3, 0.8
    C = sd**2 * np.eye(7) + shared**2 * np.ones((7, 7))
    expected = sum(float(r @ np.linalg.solve(C, r)) for r in values.T)
    found = whitened(values, sd, shared)
    assert found.shape == (14,)
    assert float(found @ found) == pytest.approx(expected, rel=1e-12)


def test_one_value_has_both_parts() -> None:
    assert whitened(np.array([[2.0]]), 0.3, 0.4)[0] == pytest.approx(4.0)
    assert whitened(np.array([[2.0]]), 0.0, 0.5)[0] == pytest.approx(4.0)


def test_fewer_independent_numbers_weigh_as_many_as_they_are() -> None:
    values = np.ones((100, 1))
    found = whitened(values, 1.0, 0.0, freedom=4)
    assert float(found @ found) == pytest.approx(4.0)


def test_unstated_noise_is_as_large_as_what_is_shared() -> None:
    """The mean of k points is then no surer than what they share."""
    values = np.random.default_rng(1).normal(size=(5, 1))
    C = 0.2**2 * (np.eye(5) + np.ones((5, 5)))
    found = whitened(values, 0.0, 0.2)
    expected = float((values.T @ np.linalg.solve(C, values))[0, 0])
    assert float(found @ found) == pytest.approx(expected)


def test_a_sensor_without_any_uncertainty_is_refused() -> None:
    with pytest.raises(ComparisonError, match="force@1: 3 values"):
        whitened(np.ones((3, 1)), 0.0, 0.0, name="force@1")
