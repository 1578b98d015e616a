"""A printed figure's verdict follows from today's value; a claim that cannot fail is refused."""

from dataclasses import replace

import pytest

from validate.compare.published import Figure, Published
from validate.errors import ComparisonError

GOOD = Published("f", 1.02, 1.0, 0.05, "N", "reproduced", "why", "table 1", 1.0, 0.03)
FIGURE = Figure("f", "m:s", 1.0, 0.05, "N", "reproduced", "why", "table 1", 1.0, 0.03)


def test_a_figure_that_stands_has_no_fault() -> None:
    assert (GOOD.verdict, GOOD.fault, GOOD.why) == ("reproduced", "", "why")
    assert replace(GOOD, ours=None, claim="not comparable").fault == ""
    assert replace(GOOD, theirs=9.0, claim="not reproduced").fault == ""


def test_ours_that_moved_is_shown_as_such_whatever_the_claim() -> None:
    for claim in ("reproduced", "not reproduced", "not comparable"):
        moved = replace(GOOD, ours=1.04, claim=claim)
        assert moved.verdict == moved.line == "moved"
        assert "our value moved from 1 to 1.04" in moved.fault
        assert moved.fault in moved.why


def test_a_reproduced_figure_must_stay_in_its_tolerance() -> None:
    left = replace(GOOD, ours=1.06, expected=None, drift=None)
    assert left.verdict == "not reproduced"
    assert "error 0.06" in left.fault
    assert "error 0.02" in replace(GOOD, tolerance=0.01).fault


def test_what_reproduces_against_its_claim_is_a_fault() -> None:
    found = replace(GOOD, claim="not reproduced")
    assert found.verdict == "reproduced"
    assert "within the tolerance 0.05" in found.fault


def test_no_value_of_ours_reproduces_nothing() -> None:
    for nothing in (replace(GOOD, ours=None), replace(GOOD, ours=float("nan"))):
        assert nothing.verdict == "not computed"
        assert nothing.fault
    for claim in ("not reproduced", "not comparable"):
        assert replace(GOOD, ours=float("nan"), claim=claim).fault


def test_a_figure_printed_for_other_data_is_not_compared() -> None:
    found = replace(FIGURE, other="printed for A; not compared with this data").beside({})
    assert (found.verdict, found.fault, found.ours) == ("other data", "", None)
    assert found.why == "printed for A; not compared with this data"


def test_an_order_counted_in_a_window_says_so_in_its_verdict() -> None:
    assert replace(GOOD, window="0..5 s").line == "reproduced (within 0..5 s)"
    assert replace(FIGURE, window="0..5 s").beside({"m": {"s": 1.0}}).window == "0..5 s"


def test_a_tolerance_as_wide_as_its_reference_is_refused_with_numbers() -> None:
    with pytest.raises(ComparisonError, match=r"3000 N .* a tenth .* 300,"):
        replace(FIGURE, theirs=3000.0, tolerance=3000.0)
    for theirs, tolerance, scale in ((0.0, 1e-5, 0.0), (1.0, 0.2, 1.0)):
        with pytest.raises(ComparisonError, match="wider than a tenth"):
            replace(FIGURE, theirs=theirs, tolerance=tolerance, scale=scale)
    assert replace(FIGURE, theirs=0.0, tolerance=1e-5, scale=1.0).tolerance == 1e-5
    assert replace(FIGURE, tolerance=0.1).tolerance == 0.1


def test_reproduced_needs_a_printed_number() -> None:
    with pytest.raises(ComparisonError, match="reproduced needs a printed number"):
        replace(FIGURE, theirs=None, tolerance=None)
    with pytest.raises(ComparisonError, match="of = None"):
        replace(FIGURE, of=None)
    with pytest.raises(ComparisonError, match="tolerance = None"):
        replace(FIGURE, tolerance=None)


def test_an_expected_value_needs_its_drift() -> None:
    with pytest.raises(ComparisonError, match="drift = None; give both or neither"):
        replace(FIGURE, drift=None)


@pytest.mark.parametrize("name", ["theirs", "tolerance", "expected", "drift"])
def test_a_declared_number_is_finite(name: str) -> None:
    with pytest.raises(ComparisonError, match="not finite cannot be compared"):
        replace(FIGURE, **{name: float("nan")})  # type: ignore[arg-type]


def test_a_figure_that_nothing_of_ours_can_stand_beside_has_no_value() -> None:
    figure = Figure("mass", None, 3.0, None, "kg", "not comparable", "no mass", "Table 1")
    found = figure.beside({"told": {"mass": 9.0}})
    assert (found.ours, found.missing, found.verdict) == (None, "", "not comparable")


def test_rows_that_no_run_reproduces_have_our_number_or_none() -> None:
    """Ours beside a number of the set-up; a score beside a picture; nothing beside a citation."""
    used = Figure.of_setup("width", 0.5, 0.25, "m", "Table 3").beside({})
    assert (used.ours, used.theirs, used.verdict, used.result) == (
        0.25,
        0.5,
        "not comparable",
        False,
    )
    cited = Figure.uncompared("modulus", 5e3, "Pa", "section 1", Figure.CITED).beside({})
    assert (cited.ours, cited.result) == (None, False)
    shown = Figure.drawn("Fig. 6", "told:peak", "N", "Fig. 6", "a curve")
    assert shown.beside({"told": {"peak": 2.0}}).ours == 2.0
