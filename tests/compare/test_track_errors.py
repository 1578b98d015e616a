"""Errors over time on hand-computed cases."""

import numpy as np
import pytest

from validate.compare.exhibit import NumberTable, Series
from validate.compare.force_error import TrackError, track_error, track_scores
from validate.errors import ComparisonError


def test_three_points_by_hand() -> None:
    """Errors 1, -2, 3 m over a range of 10 m: |e| = 1, 2, 3 with mean 2 and sample sd 1."""
    reference = np.array([0.0, 10.0, 5.0])
    error = track_error("node_A", "z", reference + [1.0, -2.0, 3.0], reference)
    found = {s.name: s.value for s in track_scores(error, "reference")}
    assert found == pytest.approx(
        {
            "node_A.mae": 2.0,
            "node_A.rmse": np.sqrt(14 / 3),
            "node_A.sd": 1.0,
            "node_A.max": 3.0,
            "node_A.nrmse": np.sqrt(14 / 3) / 10,
        },
        rel=1e-15,
    )


def test_scores_carry_condition_unit_count_and_definition() -> None:
    error = TrackError("node_B", "x", np.array([1.0, 1.0]), 2.0)
    scores = track_scores(error, "reference", "stiffer")
    assert [s.name for s in scores][:2] == ["node_B.mae@stiffer", "node_B.rmse@stiffer"]
    assert [s.unit for s in scores] == ["m", "m", "m", "m", "1"]
    assert all(s.count == 2 and "x displacement" in s.definition for s in scores)


def test_nothing_compared_is_an_error() -> None:
    with pytest.raises(ComparisonError, match="1 compared times"):
        TrackError("node_A", "z", np.ones(1), 1.0)
    with pytest.raises(ComparisonError, match="2 estimated and 3 reference"):
        track_error("node_A", "z", np.ones(2), np.ones(3))
    with pytest.raises(ComparisonError, match="does not move"):
        track_scores(TrackError("node_A", "z", np.ones(3), 0.0), "reference")


def test_tables_and_series_refuse_what_is_no_number() -> None:
    with pytest.raises(ComparisonError, match="a row of 1 under 2"):
        NumberTable("t", "t", ("a", "b / mm"), ((1.0,),))
    with pytest.raises(ComparisonError, match="not finite"):
        NumberTable("t", "t", ("a", "b / mm"), (("x", float("nan")),))
    with pytest.raises(ComparisonError):
        Series("s", np.arange(2.0), np.array([1.0, np.nan]))
