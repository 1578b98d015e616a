"""Blocks of time, nested choices, NIS marks and agreement with the truth, on hand-made scores."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from validate.engine.cell import Record
from validate.study.filters.page import consistency_words
from validate.study.filters.plan import FilterCell
from validate.study.filters.ranking import Ranked, picks, rankings
from validate.study.filters.score import (
    AHEAD,
    HELD_OUT,
    LOG_LOSS,
    POOLED,
    WITHHELD,
    Blocks,
    FilterScores,
    blocks_of,
    cut,
    nested,
    score_difference,
    withheld_scores,
)
from validate.study.filters.study import Best, _best, _edges, usual_score
from validate.study.filters.withheld_errors import Innovations, Withheld
from validate.study.sweep import axes

# private: _best, _edges: called alone, case by case.

ONE_SEGMENT = 0.1  # s
BLOCKS = Blocks((0, 1, 2, 3), ONE_SEGMENT, ONE_SEGMENT, "kf")


def scored(*squares: list[float], loss: float = 0.0, correlation_s: float = 0.1) -> FilterScores:
    """A filter on one recording: squared errors by marker and segment, one sample in each."""
    count = np.ones((1, len(squares[0])))
    parts = tuple(
        Withheld(f"m{i}", "m", np.array([row]), count, marker=True) for i, row in enumerate(squares)
    )
    rms = float(np.sqrt(np.mean(squares)))
    innovations = Innovations(-loss * count, count, correlation_s, 0.0)
    return FilterScores(
        {WITHHELD: (rms,), LOG_LOSS: (loss,)}, {WITHHELD: "m", LOG_LOSS: "1"}, nis=1.0, nis_dof=1,
        step_s=1e-3, withheld=parts, innovations=innovations, segment_s=ONE_SEGMENT,
    )  # fmt: skip


# --- blocks ---------------------------------------------------------------------------------------


def test_eight_blocks_give_an_interval_and_seven_do_not() -> None:
    eight, seven = cut(80, ONE_SEGMENT, 1.0, "kf"), cut(79, ONE_SEGMENT, 1.0, "kf")
    assert (eight.count, eight.sure) == (8, True)
    assert (seven.count, seven.sure) == (7, False)


def test_the_blocks_are_those_of_the_likeliest_filter() -> None:
    row = [1.0] * 40
    found = blocks_of({
        "poor": scored(row, loss=3.0, correlation_s=0.2),
        "good": scored(row, loss=-2.0, correlation_s=0.4),
        "plain": replace(scored(row), innovations=None),
    })  # fmt: skip
    assert found is not None
    assert (found.name, found.correlation_s, found.length_s) == ("good", 0.4, pytest.approx(0.4))


def test_a_difference_is_taken_block_by_block() -> None:
    """Errors that differ from block to block, and by the same amount between two filters."""
    base = np.arange(1.0, 21.0)
    one, other = scored(list(base + 3.0)), scored(list(base))
    found = score_difference(one, other, WITHHELD, cut(20, ONE_SEGMENT, 0.1, "kf"))
    assert found.mean == pytest.approx(np.sqrt(13.5) - np.sqrt(10.5))
    assert found.half == pytest.approx(0.0, abs=1e-12)


# --- nested choices -------------------------------------------------------------------------------


def test_a_block_does_not_choose_the_setting_that_it_reports() -> None:
    """One setting is exact on the first block alone: without that block the other one is chosen."""
    lucky, steady = scored([0.0, 2.0, 2.0, 2.0]), scored([1.6] * 4)
    found = nested({"lucky": lucky, "steady": steady}, {}, WITHHELD, BLOCKS)
    assert found is not None
    assert dict(found.chosen) == {"steady": 1, "lucky": 3}
    assert found.error.mean == pytest.approx(np.sqrt((1.6 + 3 * 2.0) / 4))


def test_a_marker_does_not_choose_the_setting_that_it_reports() -> None:
    """One setting is exact at the first marker and poor at the second, the other one is even."""
    uneven, even = scored([0.0] * 4, [4.0] * 4), scored([1.0] * 4, [1.0] * 4)
    found = nested({"uneven": uneven, "even": even}, {}, WITHHELD, BLOCKS)
    assert found is not None
    assert dict(found.chosen) == {"uneven": 4, "even": 4}
    assert found.error.mean == pytest.approx(np.sqrt((4.0 + 1.0) / 2))


def test_a_nested_choice_by_likelihood_is_a_mean_and_no_root() -> None:
    good, poor = scored([1.0] * 4, loss=-3.0), scored([1.0] * 4, loss=2.0)
    plain = scored([1.0] * 4, loss=-1.0)
    found = nested({"good": good, "poor": poor}, {"plain": plain}, LOG_LOSS, BLOCKS)
    assert found is not None
    assert (found.error.mean, dict(found.beside), dict(found.chosen)) == (
        pytest.approx(-3.0), {"plain": pytest.approx(-1.0)}, {"good": 4},
    )  # fmt: skip


# --- marks of a ranking ---------------------------------------------------------------------------


def place(nis: float) -> Ranked:
    """The first place of a filter with NIS per degree of freedom, of 100."""
    value = replace(scored([1.0] * 4), nis=100 * nis, nis_dof=100)
    cells = [FilterCell("kf", (), (), key="kf")]
    return rankings(cells, {"kf": Record("kf", value)}, WITHHELD)[0].rows[0]


@pytest.mark.parametrize(
    ("nis", "mark", "doubt"),
    [
        (1.0, "consistent", ""),
        (1.4, "over-confident: interval not used", "NIS 1.4 is outside its 95 % band"),
        (0.6, "under-confident: interval not used", "NIS 0.6 is outside its 95 % band"),
    ],
)
def test_a_filter_outside_of_its_nis_band_is_marked(nis: float, mark: str, doubt: str) -> None:
    """chi-square of 100 degrees of freedom: 95 % between 0.742 and 1.296 per degree."""
    row = place(nis)
    assert consistency_words(row) == mark
    doubts = Best(row, "", 0, ()).doubts
    assert (doubt in doubts) if doubt else "NIS" not in doubts


def test_ties_of_the_best_filter_are_counted_where_there_is_an_interval() -> None:
    rng = np.random.default_rng(3)
    base = rng.chisquare(3, 40)
    values = {
        "best": scored(list(base)), "tie": scored(list(base + 0.1 * rng.standard_normal(40))),
        "far": scored(list(base + 2.0)),
        "plain": replace(scored(list(0.5 * base)), nis=None, innovations=None),
    }  # fmt: skip
    cells = [FilterCell(name, (), (), key=name) for name in values]
    records = {name: Record(name, value) for name, value in values.items()}
    (ranking,) = rankings(cells, records, WITHHELD)
    experiment = SimpleNamespace(name="e", methods={}, accepted=(), reference="")
    planned = SimpleNamespace(experiment=experiment, job=SimpleNamespace(values=()), axes=())
    found = _best(planned, ranking, WITHHELD)  # type: ignore[arg-type]
    assert found.ranked.cell.method in ("best", "tie")
    assert (found.ties, found.better, found.ranked.place) == (1, "plain", 2)


def test_a_score_is_of_markers_and_names_what_was_given() -> None:
    """A force and an outline have scores of other units: they are in none of the three."""
    one = np.ones((1, 1))
    parts = (
        Withheld("a", "m", 4 * one, one, marker=True),
        Withheld("b", "m", 16 * one, one, ahead=True, marker=True),
        Withheld("force", "N", 100 * one, one),
    )
    scores, units = withheld_scores(parts, None)
    assert scores == {
        WITHHELD: (pytest.approx(np.sqrt(10)),), HELD_OUT: (2.0,), AHEAD: (4.0,),
        "a.held_out.rmse": (2.0,), "b.ahead.rmse": (4.0,), "force.held_out.rmse": (10.0,),
    }  # fmt: skip
    assert units["force.held_out.rmse"] == "N"


def test_cells_that_are_scored_on_fewer_markers_have_no_place() -> None:
    two, one = scored([1.0] * 4, [1.0] * 4), scored([0.1] * 4)
    cells = [FilterCell(name, (), (), key=name) for name in ("two", "one")]
    records = {"two": Record("two", two), "one": Record("one", one)}
    (ranking,) = rankings(cells, records, WITHHELD)
    assert [r.cell.method for r in ranking.rows] == ["two"]
    ((cell, why),) = ranking.failed
    assert (cell.method, "scored on m0, other cells on m0, m1" in why) == ("one", True)


def test_the_best_at_the_end_of_a_sweep_is_named() -> None:
    path = "methods.kf.Q"
    (sweep,) = axes([f"{path}=1e-12,1e-11,1e-10"])
    planned = SimpleNamespace(axes=(sweep,))

    def ends(value: str) -> tuple[str, ...]:
        return _edges(planned, FilterCell("kf", ((path, value),), ()))  # type: ignore[arg-type]

    assert [ends(v) for v in sweep.values] == [(path,), (), (path,)]


def test_in_turn_ranks_by_held_out_markers_where_every_filter_has_some() -> None:
    value = replace(scored([1.0]), scores={WITHHELD: (1.0,), HELD_OUT: (1.0,), AHEAD: (1.0,)})
    ahead = replace(value, scores={AHEAD: (1.0,), WITHHELD: (1.0,)})
    done = SimpleNamespace(records={"a": Record("a", value)})
    mixed = SimpleNamespace(records={"a": Record("a", value), "b": Record("b", ahead)})
    assert usual_score(done, in_turn=True) == HELD_OUT  # type: ignore[arg-type]
    assert usual_score(done, in_turn=False) == WITHHELD  # type: ignore[arg-type]
    assert usual_score(mixed, in_turn=True) == AHEAD  # type: ignore[arg-type]


# --- agreement with the truth ---------------------------------------------------------------------


def known(withheld: list[float], true: list[float]) -> FilterScores:
    return FilterScores({WITHHELD: tuple(withheld), POOLED: tuple(true)}, {}, nis=1.0, nis_dof=1)


def test_agreement_counts_picks_within_a_tenth_of_the_least_true_error() -> None:
    """Three seeds: the same setting, one 9 % and one 30 % worse than the best."""
    values = {
        FilterCell("a", (), (), seeds=(1, 2, 3)): known([1.0, 1.0, 1.0], [2.0, 2.18, 2.6]),
        FilterCell("b", (), (), seeds=(1, 2, 3)): known([3.0, 3.0, 3.0], [5.0, 2.0, 2.0]),
        FilterCell("c", (), (), seeds=(1, 2, 3), baseline="alone"): known([0.1] * 3, [0.1] * 3),
    }
    found = picks(values)
    assert [(p.seed, p.cell.method, p.best.method) for p in found] == [
        (1, "a", "a"), (2, "a", "b"), (3, "a", "b"),
    ]  # fmt: skip
    assert [p.ratio for p in found] == pytest.approx([1.0, 1.09, 1.3])
    assert [p.near for p in found] == [True, True, False]


def test_no_agreement_without_a_truth_or_with_one_filter() -> None:
    one = {FilterCell("a", (), (), seeds=(1,)): known([1.0], [2.0])}
    assert picks(one) == ()
    blind = replace(known([1.0], [2.0]), scores={WITHHELD: (1.0,)})
    assert picks({**one, FilterCell("b", (), (), seeds=(1,)): blind}) == ()
