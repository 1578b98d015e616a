"""Panels of markers that lie in a line: as wide as they can be read."""

import numpy as np
import pytest

from validate.report.scenes.markers import _limits

# private: _limits: called alone, case by case.


def test_a_line_along_one_axis_has_room_across() -> None:
    """Two markers above each other had a panel of no width, their motion outside of it."""
    along, across = _limits(np.array([[10.0, 20.0], [10.0, 50.0], [np.nan, np.nan]]))[::-1]
    assert along == pytest.approx([18.5, 51.5])
    assert np.ptp(across) == pytest.approx(0.6 * np.ptp(along))
    assert across.mean() == pytest.approx(10)


def test_markers_that_spread_keep_their_own_limits() -> None:
    x, y = _limits(np.array([[0.0, 0.0], [10.0, 8.0]]))
    assert x == pytest.approx([-0.5, 10.5])
    assert y == pytest.approx([-0.4, 8.4])


def test_one_place_has_a_panel_too() -> None:
    assert (np.ptp(_limits(np.array([[3.0, 4.0]])), axis=1) > 0).all()
