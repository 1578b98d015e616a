"""Rows for what a paper sets, cites or draws: no results, and not counted as figures."""

from validate.compare.published import Figure

INPUT = "an input, taken as printed"
CITED = "cited from other work, not a result of the paper"
MACHINE = "another machine: ours is in the environment section of the report"


def taken(name: str, theirs: float, ours: float, unit: str, source: str,
          reason: str = INPUT) -> Figure:  # fmt: skip
    """A number of the set-up, with the one that the experiment runs with."""
    return Figure(
        name, lambda _: ours, theirs, None, unit, "not comparable", reason, source, ours,
        1e-12 * max(1.0, abs(ours)), setting=True,
    )  # fmt: skip


def said(name: str, theirs: float | None, unit: str, source: str, reason: str) -> Figure:
    """A number or picture beside which nothing of ours can stand."""
    return Figure(
        name, None, theirs, None, unit, "not comparable", reason, source, setting=True
    )  # fmt: skip


def drawn(name: str, score: str, unit: str, source: str, reason: str) -> Figure:
    """A curve or picture without a printed number, with a number of ours."""
    return Figure(name, score, None, None, unit, "not comparable", reason, source)
