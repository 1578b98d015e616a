"""The experiment's verdict over all its checks, corrected for how many there are.

Each check alone is wrong for a perfect model in 4.6 % of cases (|E| > 2 u_val of a normal error),
so twenty of them show a difference more often than not. Holm (1979), "A simple sequentially
rejective multiple test procedure", Scand. J. Stat. 6, 65-70: the i-th smallest of m p-values must
stay below alpha/(m - i + 1); whatever the checks have in common, a perfect model is then called
different in at most alpha of all experiments.

Checks of one name are one comparison: several accepted methods on the same data. It is one piece of
evidence, however many methods show it, and one of the m: its p-value is the smallest of theirs.
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
    decided; `evidence` agree or differ; the rest of `total` is fitted or repeats itself. `evidence`
    and `total` count comparisons; `again` are checks of further methods on the same ones.
    """

    differs: tuple[Check, ...]
    alone: tuple[Check, ...]
    undecided: tuple[Check, ...]
    evidence: int
    total: int
    again: int

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
        more = f" ({self.again} more on the same data)" if self.again else ""
        return f"evidence: {self.evidence} of {self.total} checks{more}"


def judge_all(checks: Sequence[Check]) -> Overall:
    """The verdict over all checks, in their order."""
    undecided = tuple(c for c in checks if c.verdict == "cannot decide")
    differing = [c for c in checks if c.verdict == "differs"]
    tested = [c for c in checks if c.evidence] + [c for c in undecided if c.count]
    levels = _holm(tested)
    rejected = [c.p_value < levels.get(c.name, 0.0) for c in differing]
    total = len({c.name for c in checks})
    return Overall(
        differs=tuple(c for c, gone in zip(differing, rejected, strict=True) if gone),
        alone=tuple(c for c, gone in zip(differing, rejected, strict=True) if not gone),
        undecided=undecided,
        evidence=len({c.name for c in checks if c.evidence}),
        total=total,
        again=len(checks) - total,
    )


def _holm(checks: Sequence[Check]) -> dict[str, float]:
    """The level that rejects, by the name of every comparison that is rejected."""
    smallest: dict[str, float] = {}
    for c in checks:
        smallest[c.name] = min(c.p_value, smallest.get(c.name, 1.0))
    levels: dict[str, float] = {}
    for rank, name in enumerate(sorted(smallest, key=lambda name: smallest[name])):
        level = ALPHA / (len(smallest) - rank)
        if not smallest[name] < level:
            break
        levels[name] = level
    return levels
