"""Regime maps: every regime is counted and coloured, shapes are checked at the door."""

import numpy as np
import pytest

from validate.compare.exhibit import Mark, Panel, RegimeMap
from validate.errors import ComparisonError
from validate.report.charts.regime_map import _edges, picture

# private: _edges: called alone, case by case.

X = np.array([1e-3, 1e-2, 1e-1])
CODES = np.array([[0, 0, 1], [0, 1, 2]])
NOWHERE = np.array([np.nan, 2e-2])


def shown(codes: np.ndarray = CODES) -> RegimeMap:
    panel = Panel("explicit", codes, NOWHERE)
    regimes = ("stable", "unstable", "refused")
    mark = Mark("001", 1e-2, 0.0)
    return RegimeMap("nu", "Step", "h / s", "nu", X, ("0", ".5"), regimes, (panel,) * 5, (mark,))


def test_regimes_are_counted_and_coloured() -> None:
    made = picture(shown())
    assert "stable 15, unstable 10, refused 5" in made.caption
    assert "5 panels of 2 by 3" in made.alt
    for colour in (0x56B4E9, 0xCFE8F7, 0xD55E00):
        rgb = [colour >> 16, colour >> 8 & 255, colour & 255]
        assert (made.pixels == rgb).all(axis=2).mean() > 0.01


def test_squares_meet_halfway_between_logarithms() -> None:
    assert _edges(X) == pytest.approx(10.0 ** np.array([-3.5, -2.5, -1.5, -0.5]))


def test_codes_of_another_shape_are_refused() -> None:
    with pytest.raises(ComparisonError, match=r"codes \(3, 2\), needs \(2, 3\)"):
        shown(CODES.T)
