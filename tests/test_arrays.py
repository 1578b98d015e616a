"""One root mean square: of numbers, of vectors, weighted; three points by hand."""

import numpy as np
import pytest

from validate.arrays import rms

ROWS = np.array([[3.0, 4.0], [0.0, 0.0], [0.0, 2.0]])


def test_rms_of_vectors_is_that_of_their_lengths() -> None:
    assert rms(ROWS) == pytest.approx(np.sqrt((25 + 0 + 4) / 3))
    assert rms(ROWS[None]) == rms(ROWS)


def test_rms_of_numbers_counts_each() -> None:
    assert rms([1.0, -2.0, 2.0]) == pytest.approx(np.sqrt(3.0))


def test_weights_need_not_sum_to_one() -> None:
    assert rms(ROWS, np.array([2.0, 1.0, 1.0])) == pytest.approx(np.sqrt((2 * 25 + 4) / 4))
