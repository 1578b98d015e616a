"""Declared verdicts: what equals them, and what moved, in either direction."""

import pytest

from validate.compare.overall_verdict import Expected, moved
from validate.compare.verdict import Acceptance, Check, Validation
from validate.errors import ComparisonError

KNOWN = Expected("not good enough", "a linear law on stiffening skin", "force@*", "linear")


def check(name: str, acceptance: Acceptance, validation: Validation = "differs") -> Check:
    limit = None if acceptance == "no requirement" else 1.0
    return Check(name, 0.0, limit, 1.0, 1.0, 0.0, 0.0, "N", 1, validation, acceptance, "because")


def test_the_declared_verdict_is_no_failure() -> None:
    found = [
        ("linear", check("force@end", "not good enough")),
        ("neo", check("force@end", "good enough")),
    ]
    assert moved(found, (KNOWN,)) == ()


@pytest.mark.parametrize("today", ["good enough", "undecided", "nothing compared"])
def test_a_verdict_that_moves_in_either_direction_is_named(today: Acceptance) -> None:
    (one,) = moved([("linear", check("force@end", today))], (KNOWN,))
    assert (one.expected, one.found) == ("not good enough", today)
    assert f"linear: force@end is {today}; expected not good enough" in one.words


def test_what_nobody_declared_must_not_be_adverse() -> None:
    bad = [("neo", check("force@end", "undecided")), ("neo", check("x", "no requirement"))]
    assert [m.check for m in moved(bad, (KNOWN,))] == ["force@end", "x"]
    good: list[tuple[Acceptance, Validation]] = [
        ("good enough", "differs"), ("no requirement", "not distinguishable"),
        ("fitted", "fitted"), ("same model", "same model"),
    ]  # fmt: skip
    assert moved([("neo", check("x", *both)) for both in good], (KNOWN,)) == ()


def test_the_last_declaration_that_fits_counts() -> None:
    two = (Expected("undecided", "noise"), KNOWN)
    assert moved([("linear", check("force@end", "not good enough"))], two) == ()
    assert moved([("neo", check("force@end", "undecided"))], two) == ()


def test_a_declaration_is_a_verdict_with_a_reason() -> None:
    with pytest.raises(ComparisonError, match="'agrees': expected one of good enough"):
        Expected("agrees", "because")
    with pytest.raises(ComparisonError, match="give the reason"):
        Expected("undecided", " ")
