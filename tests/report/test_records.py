"""Tables and charts declared over records."""

from types import SimpleNamespace as Made

import pytest

from validate.compare.exhibit import TableCell
from validate.report.views.view_filling import chart, grouped, objects, sized, table

FAST = Made(name="fast", step=Made(p50=2e-6), error=1e-3, sizes=(4, 5), more={"K": 7.0}, unit="m")
SLOW = Made(name="slow", step=None, error=3e-3, sizes=(6, 7), more={}, unit="m")


def test_numbers_are_shown_in_the_unit_of_their_heading() -> None:
    columns = {"who": "name", "time / us": "step.p50", "± 95 % / mm (paired)": "error",
               "last size": "sizes.1", "cond K / 1": "more.K"}  # fmt: skip
    made = table("costs", "Costs", (FAST, SLOW), columns, below="who")
    assert made.headings == tuple(columns)
    assert made.rows == (("fast", pytest.approx(2.0), pytest.approx(1.0), 5, 7.0),
                         ("slow", None, pytest.approx(3.0), 7, None))  # fmt: skip
    assert (made.name, made.below) == ("costs", "who")


def test_a_path_that_no_record_has_is_an_error() -> None:
    with pytest.raises(AttributeError, match="speed"):
        table("", "", (FAST,), {"speed": "speed"})


def test_a_number_in_the_unit_of_its_record() -> None:
    ((cell,),) = table("", "", (FAST,), {"error": sized("error")}).rows
    assert cell == TableCell(1e-3, "m")


def test_members_of_json_are_si() -> None:
    assert objects((FAST, None), {"p50_s": "step.p50"}) == [{"p50_s": 2e-6}, None]


def test_a_chart_has_points_lines_and_levels_of_one_unit() -> None:
    made = chart(
        "cost", "Cost", ("time / us", "step.p50"), ("error / mm", "error"),
        points=grouped((FAST, SLOW), "name"), lines={"all": (FAST, SLOW)}, levels={"floor": 5e-4},
    )  # fmt: skip
    drawn = [(s.label, s.style, s.x.tolist(), s.y.tolist()) for s in made.series]
    near = pytest.approx
    assert drawn == [("fast", "points", near([2.0]), near([1.0])),
                     ("all", "line", near([2.0]), near([1.0]))]  # fmt: skip
    assert made.levels == (("floor", near(0.5)),)
