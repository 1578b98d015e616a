"""Overall verdict of an experiment: acceptance and validation over all its checks.

*Good enough*: every requirement is met. Each check is a test of its own and all must pass, so that
their number needs no correction: an intersection-union test, Berger (1982), "Multiparameter
hypothesis testing and acceptance sampling", Technometrics 24, 295-300.

*Differs*: one check of a perfect model is beyond 2 u_val in 4.6 % of cases, so twenty of them show
a difference more often than not. Holm (1979), "A simple sequentially rejective multiple test
procedure", Scand. J. Stat. 6, 65-70: the i-th smallest of m p-values must stay below
alpha/(m - i + 1); whatever the checks have in common, a perfect model is then called different in
at most alpha of all experiments.

Checks of one name are one comparison: several accepted methods on the same data. It is one piece of
evidence, however many methods show it, and one of the m: its p-value is the smallest of theirs.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal, get_args

from validate.compare.verdict import ALPHA, Acceptance, Check, Validation
from validate.errors import ComparisonError

# --- Verdicts that an experiment is known to have, declared with the reason, and those that
# moved.
#
# A known finding (a linear law on stiffening skin is not good enough) is no failure of the code;
# a verdict that differs from its declaration is, in either direction.

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
    """Return the checks, each with its method's name, whose verdict is not the one that the last
    fitting declaration expects; where none fits, those that are adverse."""
    found = []
    for method, check in checks:
        fitting = [e for e in expected if e.fits(method, check.name)]
        verdict = check.verdict
        if fitting and fitting[-1].verdict != verdict:
            found.append(MovedVerdict(method, check.name, fitting[-1].verdict, verdict, check.why))
        if not fitting and verdict not in UNDECLARED:
            found.append(MovedVerdict(method, check.name, "", verdict, check.why))
    return tuple(found)


# -------------------------------------------------------------------------------------------------

Word = Literal[
    "good enough", "not good enough", "undecided", "not distinguishable", "differs", "no evidence",
    "nothing compared",
]  # fmt: skip
PASSES: tuple[Word, ...] = ("good enough", "not distinguishable", "no evidence")


@dataclass(frozen=True)
class Overall:
    """Overall verdict over all checks.

    Of the requirements: checks that are `failed` (not good enough), `undecided`, and `met`. Of the
    differences: `differs` after Holm's correction, and `alone` by themselves only. `absent`
    compared nothing, and `unanswered` have no bound of u_val and no requirement. `evidence` and
    `total` count comparisons; `again` are checks of further methods on the same ones.
    """

    failed: tuple[Check, ...]
    undecided: tuple[Check, ...]
    met: tuple[Check, ...]
    differs: tuple[Check, ...]
    alone: tuple[Check, ...]
    absent: tuple[Check, ...]
    unanswered: tuple[Check, ...]
    evidence: int
    total: int
    again: int

    @property
    def word(self) -> Word:
        """The verdict: acceptance where something is required and answered, else validation."""
        if not self.total or self.absent:
            return "not good enough" if self.failed else "nothing compared"
        if self.failed:
            return "not good enough"
        if self.undecided:
            return "undecided"
        if self.met:
            return "good enough"
        if self.differs:
            return "differs"
        if self.unanswered:
            return "undecided"
        return "not distinguishable" if self.evidence else "no evidence"

    @property
    def passed(self) -> bool:
        """Whether the exit code is 0."""
        return self.word in PASSES

    @property
    def counted(self) -> str:
        more = f" ({self.again} more on the same data)" if self.again else ""
        return f"evidence: {self.evidence} of {self.total} checks{more}"

    @property
    def corrections(self) -> str:
        """Number of checks in the correction, in a sentence."""
        return (
            "Each requirement must be met, so no correction is needed (intersection-union "
            f"test, Berger 1982). Corrected for {self.total} checks (Holm 1979), "
            f"{len(self.differs)} differ from zero; {len(self.alone)} more differ only without "
            "the correction."
        )


def judge_all(checks: Sequence[Check]) -> Overall:
    """Return the verdict over all checks, in their order."""
    undecided = [c for c in checks if c.acceptance == "undecided"]
    tested = [
        c for c in [*(c for c in checks if c.evidence), *undecided]
        if c.validation in ("differs", "not distinguishable")
    ]  # fmt: skip
    differing = [c for c in tested if c.validation == "differs"]
    # The level that rejects, by the name of every comparison that is rejected
    smallest: dict[str, float] = {}
    for c in tested:
        smallest[c.name] = min(c.p_value, smallest.get(c.name, 1.0))
    levels: dict[str, float] = {}
    for rank, name in enumerate(sorted(smallest, key=lambda name: smallest[name])):
        level = ALPHA / (len(smallest) - rank)
        if not smallest[name] < level:
            break
        levels[name] = level
    rejected = [c.p_value < levels.get(c.name, 0.0) for c in differing]
    total = len({c.name for c in checks})
    return Overall(
        failed=tuple(c for c in checks if c.acceptance == "not good enough"),
        undecided=tuple(undecided),
        met=tuple(c for c in checks if c.acceptance == "good enough"),
        differs=tuple(c for c, gone in zip(differing, rejected, strict=True) if gone),
        alone=tuple(c for c, gone in zip(differing, rejected, strict=True) if not gone),
        absent=tuple(c for c in checks if not c.count),
        unanswered=tuple(c for c in checks if c.verdict == "no answer"),
        evidence=len({c.name for c in checks if c.evidence}),
        total=total,
        again=len(checks) - total,
    )


def correction(checks: Iterable[Check], tested: int = 0) -> str:
    """Return the end of a sentence that calls errors not distinguishable from zero: for how many
    comparisons they are corrected, where an interval E +- 2 u_val excludes zero all the same.

    `tested`: so many checks are corrected for, too. "" where each interval answers by itself.
    """
    excluding = [c for c in checks if c.validation == "not distinguishable"
                 and abs(c.value) > 2 * c.u_val]  # fmt: skip
    number = sum(c.count for c in excluding) + tested
    return f" (corrected for {number} comparisons)" if number else ""
