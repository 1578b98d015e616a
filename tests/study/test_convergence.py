"""Observed order, Richardson and the index on series whose order is known."""

import numpy as np
import pytest

from validate.compare.convergence import FAR, NEAR, observed_order, richardson
from validate.errors import ComparisonError


def series(h: list[float], p: float, c: float = 0.3) -> list[np.ndarray]:
    """Answers 2 + c h^p at two points, along one direction each."""
    return [np.array([[2.0 + c * x**p, 1.0], [5.0, 3.0 - c * x**p]]) for x in h]


@pytest.mark.parametrize("p", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("h", [[1.0, 2.0, 4.0], [1.0, 1.3, 2.1]])
def test_a_manufactured_series_gives_its_order_limit_and_error(h: list[float], p: float) -> None:
    found = richardson(h, series(h, p), p)
    assert found.conduct == "monotone"
    assert found.order == pytest.approx(p, rel=1e-9)
    assert found.extrapolated == pytest.approx(np.array([[2.0, 1.0], [5.0, 3.0]]), abs=1e-12)
    assert found.error == pytest.approx(0.3, rel=1e-9)  # c h^p at h = 1, at every point
    assert found.index == pytest.approx(NEAR * found.error)


def test_the_published_example_of_the_procedure() -> None:
    """Celik et al. (2008), Table 1, first column: r 1.5 and 1.333, p 1.53, GCI 2.2 %."""
    values = [6.063, 5.972, 5.863]
    h = [1.0, 1.5, 2.0]
    order = observed_order(1.5, 2.0 / 1.5, values[0] - values[1], values[1] - values[2])
    assert order == pytest.approx(1.53, abs=0.01)
    found = richardson(h, [np.array(v) for v in values], 2.0)
    assert float(found.extrapolated) == pytest.approx(6.1685, abs=1e-3)
    assert found.index / values[0] == pytest.approx(0.022, abs=5e-4)


def test_two_answers_show_no_order() -> None:
    found = richardson([1.0, 2.0], series([1.0, 2.0], 2.0), 2.0)
    assert (found.conduct, found.order, found.used) == ("two only", None, 2.0)
    assert found.index == pytest.approx(FAR * 0.3)


def test_growing_differences_are_called_diverging() -> None:
    answers = [np.array(v) for v in (0.0, 1.0, 1.5)]
    assert richardson([1.0, 2.0, 4.0], answers, 2.0).conduct == "diverging"


def test_oscillating_answers_are_not_trusted() -> None:
    answers = [np.array(v) for v in (1.0, 1.25, 0.25)]
    found = richardson([1.0, 2.0, 4.0], answers, 2.0)
    assert found.conduct == "oscillating"
    assert found.order == pytest.approx(2.0)
    assert found.index == pytest.approx(FAR * found.error)


def test_sizes_must_rise() -> None:
    with pytest.raises(ComparisonError, match="at least two, with increasing sizes"):
        richardson([2.0, 1.0], series([2.0, 1.0], 2.0), 2.0)
