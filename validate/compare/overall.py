"""The experiment's verdict over all its checks, corrected for how many there are.

Each check alone is wrong for a perfect model in 4.6 % of cases (|E| > 2 u_val of a normal error),
so twenty of them show a difference more often than not. Holm (1979), "A simple sequentially
rejective multiple test procedure", Scand. J. Stat. 6, 65-70: the i-th smallest of m p-values must
stay below alpha/(m - i + 1); whatever the checks have in common, a perfect model is then called
different in at most alpha of all experiments.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.special import ndtr

from validate.compare.verdict import Check

ALPHA = 2 * float(ndtr(-2.0))  # one check alone: |E| > 2 u_val


@dataclass(frozen=True)
class Overall:
    """What all checks say together.

    `differs` after Holm's correction; `alone` differ by themselves only; `undecided` cannot be
    decided; `evidence` agree or differ; the rest of `total` is fitted or repeats itself.
    """

    differs: tuple[Check, ...]
    alone: tuple[Check, ...]
    undecided: tuple[Check, ...]
    evidence: int
    total: int

    @property
    def passed(self) -> bool:
        """Nothing differs, nothing is undecided, and something was checked."""
        return self.total > 0 and not self.differs and not self.undecided

    @property
    def word(self) -> str:
        """The verdict in a word or two."""
        if self.differs:
            return "differs"
        if self.undecided or not self.total:
            return "undecided"
        return "agrees" if self.evidence else "no evidence"

    @property
    def counted(self) -> str:
        return f"evidence: {self.evidence} of {self.total} checks"


def judge_all(checks: Sequence[Check]) -> Overall:
    """The verdict over all checks, in their order."""
    undecided = tuple(c for c in checks if c.verdict == "cannot decide")
    differing = [c for c in checks if c.verdict == "differs"]
    tested = [c for c in checks if c.evidence] + [c for c in undecided if c.count]
    kept = _holm([c.p_value for c in tested])
    rejected = [c for c, gone in zip(tested, kept, strict=True) if gone]
    return Overall(
        differs=tuple(c for c in differing if any(c is r for r in rejected)),
        alone=tuple(c for c in differing if not any(c is r for r in rejected)),
        undecided=undecided,
        evidence=sum(c.evidence for c in checks),
        total=len(checks),
    )


def _holm(p_values: Sequence[float]) -> list[bool]:
    """Which hypotheses are rejected."""
    m, rejected = len(p_values), [False] * len(p_values)
    for rank, i in enumerate(sorted(range(m), key=lambda i: p_values[i])):
        if not p_values[i] < ALPHA / (m - rank):
            break
        rejected[i] = True
    return rejected
