"""Places, ties, dominance and failures on results made by hand."""

from collections.abc import Sequence
from types import SimpleNamespace

import pytest

from validate.engine.cell import Record
from validate.errors import ComparisonError, UsageError
from validate.study.filters import study as filters
from validate.study.filters.plan import FilterCell
from validate.study.filters.ranking import Ranking, dominator, rankings
from validate.study.filters.score import FilterScores

# private: _require_score: called alone, case by case.


def ranked(**cells: tuple[Sequence[float], float | None]) -> Ranking:
    made = [FilterCell(name, (), (), key=name) for name in cells]
    records = {name: record(name, scores, step) for name, (scores, step) in cells.items()}
    return rankings(made, records, "e")[0]


def record(key: str, scores: Sequence[float], step: float | None = 1.0) -> Record[FilterScores]:
    return Record(key, FilterScores({"e": tuple(scores)}, {"e": "m"}, step_s=step))


def test_the_least_mean_error_is_first_and_overlaps_are_named() -> None:
    found = ranked(
        far=((9.0, 9.1, 9.2), 1.0), best=((1.0, 2.0, 3.0), 1.0), near=((1.4, 2.1, 3.3), 1.0)
    )
    assert [r.cell.method for r in found.rows] == ["best", "near", "far"]
    assert found.rows[0].overlaps == (2,)
    assert found.rows[2].overlaps == ()


def test_paired_differences_can_tell_what_intervals_cannot() -> None:
    found = ranked(best=((1.0, 2.0, 3.0), 1.0), worse=((1.1, 2.1, 3.11), 1.0))
    assert found.rows[1].overlaps == (1,)
    assert not found.rows[1].tied
    tie = ranked(best=((1.0, 2.0, 3.0), 1.0), other=((2.2, 1.1, 3.3), 1.0))
    assert tie.rows[1].tied


def test_one_seed_tells_nothing_apart() -> None:
    assert ranked(best=((1.0,), 1.0), far=((90.0,), 1.0)).rows[1].tied


def test_a_cell_with_more_error_and_more_time_is_dominated() -> None:
    found = ranked(
        exact=((1.0, 1.0), 10.0), quick=((5.0, 5.0), 1.0), poor=((6.0, 6.0), 20.0),
        jitter=((5.5, 5.5), 0.9), same=((1.0, 1.0), 9.0),
    )  # fmt: skip
    by_name = {r.cell.method: r.dominated_by for r in found.rows}
    assert by_name == {
        "exact": None, "same": None, "quick": None, "poor": 1, "jitter": 3,
    }  # fmt: skip
    assert [r.cell.method for r in found.front] == ["quick", "same", "exact"]


def test_what_sees_the_future_is_first_by_error_and_no_rival_by_rate() -> None:
    found = ranked(smoothed=((1.0, 1.0), None), quick=((5.0, 5.0), 1.0), exact=((2.0, 2.0), 9.0))
    assert [r.cell.method for r in found.rows] == ["smoothed", "exact", "quick"]
    assert [r.dominated_by for r in found.rows] == [None, None, None]
    assert [r.cell.method for r in found.front] == ["quick", "exact"]


def test_conditions_are_ranked_apart_and_failures_are_rows() -> None:
    quiet, loud = (("twin.noise", "1"),), (("twin.noise", "2"),)
    cells = [
        FilterCell("a", (), quiet, key="1"),
        FilterCell("a", (), loud, key="2"),
        FilterCell("b", (), loud, key="3"),
    ]
    records = {
        "1": record("1", [1.0]),
        "2": record("2", [2.0]),
        "3": Record[FilterScores]("3", refused="diverged at step 3"),
    }
    one, two = rankings(cells, records, "e")
    assert (len(one.rows), len(two.rows)) == (1, 1)
    assert two.failed == ((cells[2], "diverged at step 3"),)


def test_errors_that_differ_by_rounding_are_one_error() -> None:
    """Two solvers of one system: the slower one is no point of the front."""
    assert dominator(0, [1.0 - 1e-12, 1.0], [168.0, 118.0]) == 1
    assert dominator(1, [1.0 - 1e-12, 1.0], [168.0, 118.0]) is None


def test_nothing_is_ranked_by_a_score_that_is_not_there_or_of_cells_that_failed() -> None:
    failed = {str(i): Record(str(i), failed=f"trap {i}") for i in range(3)}
    with pytest.raises(ComparisonError, match=r"all 3 cells.*0 compared.*trap 0"):
        filters._require_score(SimpleNamespace(records=failed), "rmse")  # type: ignore[arg-type]
    good = {"a": Record("a", SimpleNamespace(scores={"top.rmse": 1.0}))}
    filters._require_score(SimpleNamespace(records=good), "top.rmse")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"no score 'top\.rms' .*top\.rmse"):
        filters._require_score(SimpleNamespace(records=good), "top.rms")  # type: ignore[arg-type]
