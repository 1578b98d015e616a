"""Verdicts that an experiment is known to have, declared with the reason, and those that moved.

A known finding (a linear law on stiffening skin is not good enough) is no failure of the code; a
verdict that differs from its declaration is, in either direction.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import get_args

from validate.compare.verdict import Acceptance, Check, Validation
from validate.errors import ComparisonError

VERDICTS = (*get_args(Acceptance), *get_args(Validation))
UNDECLARED = ("good enough", "not distinguishable", "fitted", "same model")


@dataclass(frozen=True)
class Expected:
    """The verdict of every check whose name fits `check` and whose method fits `method`, patterns
    as for file names, and `why`.

    Raises `ComparisonError` for a verdict that no check can have, and without a reason.
    """

    verdict: str
    why: str
    check: str = "*"
    method: str = "*"

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            raise ComparisonError(
                f"expected verdict '{self.verdict}': expected one of {', '.join(VERDICTS)}"
            )
        if not self.why.strip():
            raise ComparisonError(
                f"expected verdict '{self.verdict}' of {self.check}; give the reason"
            )

    def fits(self, method: str, check: str) -> bool:
        return fnmatchcase(method, self.method) and fnmatchcase(check, self.check)


@dataclass(frozen=True)
class MovedVerdict:
    """A check whose verdict is not the declared one; `expected` is "" where none is declared."""

    method: str
    check: str
    expected: str
    found: str
    why: str

    @property
    def words(self) -> str:
        told = self.expected or f"one of {', '.join(UNDECLARED)}, because none is declared"
        return f"{self.method}: {self.check} is {self.found}; expected {told}"


def moved(
    checks: Iterable[tuple[str, Check]], expected: Sequence[Expected]
) -> tuple[MovedVerdict, ...]:
    """The checks, each with its method's name, whose verdict is not the one that the last fitting
    declaration expects; where none fits, those that are adverse."""
    found = []
    for method, check in checks:
        fitting = [e for e in expected if e.fits(method, check.name)]
        verdict = check.verdict
        if fitting and fitting[-1].verdict != verdict:
            found.append(MovedVerdict(method, check.name, fitting[-1].verdict, verdict, check.why))
        if not fitting and verdict not in UNDECLARED:
            found.append(MovedVerdict(method, check.name, "", verdict, check.why))
    return tuple(found)
