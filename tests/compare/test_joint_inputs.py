"""First-order effects of the inputs beside draws of all of them at once."""

import numpy as np
import pytest

from validate.compare.effects import difference, joint, joint_draws
from validate.compare.residual import Residual
from validate.compare.verdict import Sensitivity
from validate.errors import ComparisonError


def scalar(value: float) -> Residual:
    return Residual("force", "3mm", np.array([[value]]), 0.0, 0.0, "N", "force")


def test_draws_fill_every_range_once_and_are_hardly_correlated() -> None:
    table = joint_draws(12, 7)
    strata = np.sqrt(3) * (np.arange(12) * 2 + 1 - 12) / 12
    for column in table.T:
        assert np.sort(column) == pytest.approx(strata)
    assert np.abs(np.corrcoef(table.T) - np.eye(7)).max() < 0.4
    assert np.array_equal(table, joint_draws(12, 7))


def test_a_linear_model_shows_the_same_both_ways() -> None:
    base, table = scalar(2.0), joint_draws(12, 2)
    parts = [Sensitivity("a", scalar(3.0)), Sensitivity("b", scalar(-4.0))]
    drawn = [scalar(2 + 3 * a - 4 * b) for a, b in table]
    found = joint(base, parts, drawn)
    assert found.first_order == 5.0
    assert found.sampled == pytest.approx(5.0, rel=0.05)
    assert (found.draws, found.unit) == (12, "N")
    assert found.percent == pytest.approx(0, abs=5)


def test_inputs_that_act_together_are_seen_only_by_the_sample() -> None:
    """By hand: y = a b has no first order at a = b = 0; the rms of a b over the draws remains."""
    table = joint_draws(16, 2)
    parts = [Sensitivity("a", scalar(0.0)), Sensitivity("b", scalar(0.0))]
    found = joint(scalar(0.0), parts, [scalar(a * b) for a, b in table])
    assert (found.first_order, found.percent) == (0.0, None)
    assert found.sampled == pytest.approx(np.sqrt(np.mean(table[:, 0] ** 2 * table[:, 1] ** 2)))


def window(measured: list[float], off: float) -> Residual:
    reference = np.array(measured)[:, None]
    values = off * reference
    return Residual("force", "fit", values, 0.0, 0.0, "N", "force", reference=reference)


def test_an_input_that_moves_a_windows_ends_is_compared_at_the_samples_of_both() -> None:
    """A height moves strains, so that samples enter or leave at the ends of a window."""
    base = window([2.0, 3.0, 4.0, 5.0], 0.1)
    earlier = difference(window([0.0, 1.0, 2.0, 3.0, 4.0], 0.2), base)
    assert earlier[:, 0] == pytest.approx([0.2, 0.3, 0.4, 0.4])  # the last as its neighbour
    more = difference(window([2.0, 3.0, 4.0, 5.0, 6.0], 0.2), base)
    assert more[:, 0] == pytest.approx([0.2, 0.3, 0.4, 0.5])
    fewer = difference(window([3.0, 4.0, 5.0], 0.2), base)
    assert fewer[:, 0] == pytest.approx([0.3, 0.3, 0.4, 0.5])
    with pytest.raises(ComparisonError, match="4 samples, 3 with an input moved"):
        difference(window([7.0, 8.0, 9.0], 0.2), base)
