"""A published figure's verdict falls when ours moves or leaves its tolerance."""

from dataclasses import replace

from validate.compare.published import Published

GOOD = Published("f", 1.02, 1.0, 0.05, "N", "reproduced", "why", "table 1", 1.0, 0.03)


def test_a_figure_that_stands_has_no_fault() -> None:
    assert GOOD.fault == ""
    assert replace(GOOD, ours=None, verdict="not comparable").fault == ""
    assert replace(GOOD, theirs=9.0, verdict="not reproduced").fault == ""


def test_ours_that_moved_is_a_fault_whatever_the_verdict() -> None:
    for verdict in ("reproduced", "not reproduced", "not comparable"):
        assert "ours moved from 1 to 1.04" in replace(GOOD, ours=1.04, verdict=verdict).fault


def test_a_reproduced_figure_must_stay_in_its_tolerance() -> None:
    assert "off by 0.06" in replace(GOOD, ours=1.06, expected=None).fault
    assert "off by 0.02" in replace(GOOD, tolerance=0.01).fault


def test_reproduced_without_a_value_is_a_fault() -> None:
    assert "compared nothing" in replace(GOOD, ours=None).fault
