"""What studies' pages say of results that are made by hand: every number in its place and unit."""

from types import SimpleNamespace as Made

import numpy as np
import pytest

from validate.pipeline.ladder.ladder import PaperSetting, Turned
from validate.report.views.view_filling import table
from validate.study.filters.page import _pareto_chart, _pareto_exhibit, _ranking_exhibit
from validate.study.stability import page as stability_exhibits
from validate.study.stability.gain import _cells
from validate.study.stability.gain import _map as gain_map
from validate.study.stability.page import _COST, _map, _marks
from validate.study.stability.study import points

# private: _COST: a limit or list of the code, which the test must meet exactly.
# private: _cells, _map, _marks, _pareto_chart, _pareto_exhibit, _ranking_exhibit:
#   called alone, case by case.
# private: _rows, _under: replaced, to bring a case about.

BASE = Turned(4e3, 0.45, 1e3, 1.0, 1e-3, 5)


def test_updates_of_a_loop_that_never_settles_are_none() -> None:
    limit = Made(gains=(1.0, 10.0, 100.0), updates=(0, 7, -1), predicted=50.0, tuned=10.0)
    found = Made(limits=((Made(load=0.5), limit),), experiment=Made(name="phantom"))
    assert _cells(found).rows == ((0.5, 1.0, 0), (0.5, 10.0, 7), (0.5, 100.0, None))
    assert gain_map(found).panels[0].codes.tolist() == [[0, 0, 1]]


def test_tables_of_a_front_are_numbered_from_one() -> None:
    empty = Made(rows=(), front=(), condition=())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("validate.study.filters.page._under", lambda ranking: "")
        made = _pareto_exhibit(Made(rankings=[empty, empty], unit="m"))
    assert [t.name for t in made.tables] == ["pareto_1", "pareto_2"]


@pytest.mark.parametrize(("conditions", "shown"), [(1, 25), (2, 8)])
def test_a_lone_ranking_shows_more_places(
    monkeypatch: pytest.MonkeyPatch, conditions: int, shown: int
) -> None:
    module = "validate.study.filters.page."
    monkeypatch.setattr(module + "_under", lambda ranking: "")
    monkeypatch.setattr(module + "_ranking_words", lambda study: ())
    monkeypatch.setattr(
        module + "table", lambda name, title, rows, columns: Made(title=title, rows=rows)
    )
    rankings = [Made(rows=tuple(range(30)))] * conditions
    made = _ranking_exhibit(Made(rankings=rankings, unit="m", by="all.rmse"))
    assert [len(t.rows) for t in made.tables] == [shown] * conditions
    assert made.tables[0].title == f"Ranking: the first {shown} of 30 places"


def test_a_point_of_the_front_is_drawn_under_its_method(monkeypatch: pytest.MonkeyPatch) -> None:
    def row(method: str, time: float | None, mean: float) -> Made:
        return Made(cell=Made(name=method), result=Made(step_s=time), score=Made(mean=mean))

    rows = (row("kf", 1e-3, 2e-3), row("ekf", 2e-3, 1e-3), row("kf", 4e-3, 3e-3),
            row("exact", 1e-3, 0.0), row("untimed", None, 1.0))  # fmt: skip
    monkeypatch.setattr("validate.study.filters.page._under", lambda ranking: "")
    chart = _pareto_chart(Made(by="rmse", unit="m"), Made(rows=rows, front=rows[:2]), 1)
    drawn = {s.label: (s.x.tolist(), s.y.tolist()) for s in chart.series}
    assert drawn == {
        "kf": ([1.0, 4.0], [2.0, 3.0]),
        "ekf": ([2.0], [1.0]),
        "Pareto front": ([1.0, 2.0], [2.0, 1.0]),
    }
    assert "1 without any error" in chart.caption
    assert "1 without times" in chart.caption


# --- stability maps -------------------------------------------------------------------------------


def study_of(*moduli: float) -> Made:
    """A map over E: one scheme, two steps, the longer one unstable."""
    variants = [Turned(E, 0.45, 1e3, 1.0, 1e-3, 5) for E in moduli]
    cells = tuple(Made(variant=v, key=str(v.E), steps=(1e-3, 1e-1)) for v in variants)
    found = Made(scheme="central", predicted=0.01, radii=(1.0, 1.5))
    value = Made(schemes=(found,), lowest=1.0)
    records = {c.key: Made(value=value, why="") for c in cells}
    paper = PaperSetting("001", "paper 001", Turned(20.0, 0.45, 1e3, 1.0, 1e-3, 5), 0.02)
    return Made(
        cells=cells, done=Made(records=records), schemes=("central",),
        base=Made(base=BASE, papers=(paper,)), experiment=Made(name="block"),
    )  # fmt: skip


def test_a_map_has_a_row_a_variant_that_was_run(monkeypatch: pytest.MonkeyPatch) -> None:
    study = study_of(10.0, 1000.0)
    rows = (*(c.variant for c in study.cells), Turned(1.0, 0.45, 1e3, 1.0, 1e-3, 5))
    monkeypatch.setattr(stability_exhibits, "_rows", lambda study, name: rows)
    shown = _map(study, "E")
    assert shown is not None
    assert shown.panels[0].codes.tolist() == [[0, 2], [0, 2]]
    assert shown.panels[0].border.tolist() == [0.01, 0.01]
    regimes = [p.regime for p in points(study.cells[0], study.done.records["10.0"], ("central",))]
    assert regimes == ["stable", "unstable"]
    monkeypatch.setattr(stability_exhibits, "_rows", lambda study, name: rows[1:])
    assert _map(study, "E") is None  # one row is no map


def cost(result: Made) -> tuple[object, ...]:
    return table("", "", [(BASE, result)], _COST).rows[0]


def test_what_cells_cost_stands_in_the_order_of_its_headings() -> None:
    rounding = Made(static=1e-6, positions=2e-6, velocities=3e-6)
    r = Made(rounding=rounding, conditions={"K": 10.0, "J": 3.0}, locking=0.1, warning="locks")
    assert cost(r) == (10.0, None, 3.0, 0.1, 1e-6, 2e-6, 3e-6, "locks")
    bare = Made(rounding=None, conditions={}, locking=None, warning="")
    assert cost(bare) == (None,) * 8


def test_a_paper_lies_between_the_moduli_of_the_rows_by_its_logarithm() -> None:
    study = study_of(10.0, 1000.0)
    rows = [c.variant for c in study.cells]
    (mark,) = _marks(study, "E", rows)
    assert mark.row == pytest.approx(np.log10(2.0) / 2)
    assert (mark.x, mark.on_map) == (0.02, True)
    assert [m.row for m in _marks(study, "nu", rows)] == [0.0]
    assert not list(_marks(study, "mesh", [Turned(10.0, 0.45, 1e3, 1.0, 1e-3, 9)]))
