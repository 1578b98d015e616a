"""Coordinates are where the values lie."""

import numpy as np
import pytest
from scipy.stats import qmc

from validate.identify.least_squares import Range, Space

SPACE = Space((Range("E", 1e3, 1e6), Range("nu", 0.2, 0.5)))


def test_values_and_coordinates_are_inverse() -> None:
    x = np.array([0.3, 0.8])
    assert SPACE.coordinates(SPACE.values(x)) == pytest.approx(x)
    assert SPACE.coordinates((1e3, 0.5)) == pytest.approx([0.0, 1.0])


@pytest.mark.parametrize("count", [1, 2, 10])
def test_starts_are_the_middle_and_the_latin_hypercube_of_scipy(count: int) -> None:
    found = SPACE.starts(count, seed=3)
    assert found[0] == pytest.approx([0.5, 0.5])
    assert (found[1:] == qmc.LatinHypercube(2, rng=3).random(count - 1)).all()
