"""Heat maps: colours turn at the centre, holes are grey, words say what colours do."""

import numpy as np

from validate.compare.exhibit import Heat
from validate.report.charts.heat import _norm, picture

# private: _norm: called alone, case by case.

VALUES = np.array([[0.1, 1.0, 100.0], [np.nan, 2.0, 0.5]])
HEAT = Heat("nis_kf", "NIS", "Q", "R", ("1", "2", "3"), ("a", "b"), VALUES, "NIS per dof / 1", 1.0)


def test_the_centre_is_in_the_middle_of_the_colours() -> None:
    norm = _norm(HEAT)
    assert float(norm(1.0)) == 0.5
    assert float(norm(100.0)) == 1.0
    low = Heat("low", "NIS", "Q", "R", ("1", "2"), ("a",), np.array([[1e-3, 2.0]]), "1", 1.0)
    assert float(_norm(low)(1e-3)) == 0.0
    assert abs(float(norm(0.1)) - 0.25) < 1e-12


def test_signed_values_are_not_taken_by_logarithms() -> None:
    heat = Heat("h", "Bias", "x", "y", ("1", "2"), ("a",), np.array([[-1.0, 3.0]]), "m", 0.0)
    assert float(_norm(heat)(0.0)) == 0.5
    assert "Logarithmic" not in picture(heat).caption


def test_holes_are_grey_and_counted() -> None:
    made = picture(HEAT)
    assert "Grey: 1 without a number" in made.caption
    assert "2 by 3" in made.alt
    grey = (made.pixels == 0xBD).all(axis=2)
    assert grey.mean() > 0.02


def test_large_maps_have_no_numbers_and_stay_small() -> None:
    values = np.arange(1.0, 3601.0).reshape(60, 60)
    texts = tuple(str(i) for i in range(60))
    made = picture(Heat("big", "Big", "x", "y", texts, texts, values, "m"))
    assert made.pixels.shape[0] < 1400
    assert made.pixels.shape[1] < 1800
