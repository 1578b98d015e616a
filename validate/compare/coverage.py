"""Error rates of verdicts with intervals, and the term of u_val that causes them.

A perfect model is called different in 4.6 % of comparisons where E is normal with the standard
uncertainty u_val. More than `MOST` says that a term is too narrow, fewer than `LEAST` that one is
too wide, or that the verdict is blunt: what claims more than the draws show is a uniform range, or
mesh and step, and claims it rightly. Each term is held against what the draws show of it alone:
half of the |E| that 4.6 % of them exceed, which for a normal law is its standard deviation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import betaincinv

from validate.arrays import Floats, rms
from validate.compare.verdict import ALPHA

LEAST, MOST = 0.02, 0.07
FALSE_ACCEPTANCE = 0.05  # of models whose error is the limit, and of perfect ones
U_NUM = "u_num"
MEASUREMENT = "measurement"
_ALIKE = 0.1  # relative: how far a shown term may lie off its part before it is another one
_MUCH = 0.2  # of u_val squared: what a term claims beyond what it shows, 200 draws make it 0.14

Word = Literal["holds", "too narrow", "too wide", "blunt", "no answer", "no evidence"]


@dataclass(frozen=True)
class Share:
    """`number` of `count` with the 95 % interval of the probability (Clopper & Pearson 1934)."""

    number: int
    count: int

    @property
    def value(self) -> float:
        return self.number / self.count if self.count else 0.0

    @property
    def low(self) -> float:
        if not self.number:
            return 0.0
        return float(betaincinv(self.number, self.count - self.number + 1, 0.025))

    @property
    def high(self) -> float:
        if self.number == self.count:
            return 1.0
        return float(betaincinv(self.number + 1, self.count - self.number, 0.975))

    @property
    def inside(self) -> bool:
        return LEAST <= self.value <= MOST

    @property
    def by_chance(self) -> bool:
        """Whether the interval overlaps the allowed range."""
        return self.low <= MOST and self.high >= LEAST


@dataclass(frozen=True)
class Term:
    """A term of u_val in the residual's unit: its `part`, what the draws `shown` of it, and the
    `spread` (rms) of E by it alone. `kind` tells measurement and discretisation from inputs."""

    name: str
    part: float
    shown: float
    spread: float
    kind: Literal["measurement", "numerical", "input", "filter"] = "input"

    @property
    def ratio(self) -> float | None:
        """Shown over claimed; None where nothing is claimed."""
        return self.shown / self.part if self.part else None

    @property
    def excess(self) -> float:
        """Variance shown less variance claimed."""
        return self.shown**2 - self.part**2

    @property
    def bounded(self) -> bool:
        """Whether its spread is what is claimed, and only its ends are not those of a normal law:
        a uniform range."""
        alike = abs(self.spread - self.part) < _ALIKE * self.part
        return self.kind == "input" and self.excess < 0 and alike

    @property
    def right(self) -> bool:
        """Whether it claims no more than it should, though draws show less: a uniform range, or
        mesh and step, which a model that is judged by itself cannot show."""
        return self.bounded or self.kind == "numerical"

    @property
    def words(self) -> str:
        """What it claims and what it shows, with its numbers."""
        if self.kind == "numerical":
            return (
                f"{self.name}: {self.part:.3g} of mesh and step, which a comparison of the "
                "model with itself on the same mesh cannot observe"
            )
        seen = f"{self.name}: {self.part:.3g} claimed, {self.shown:.3g} observed"
        if self.bounded:
            return f"{seen}: its spread is right, but a uniform range ends at 1.73 u"
        return seen


def reach(errors: Floats) -> float:
    """Half of the |E| that `ALPHA` of the draws (n,) exceed."""
    return float(np.quantile(np.abs(errors), 1 - ALPHA)) / 2 if len(errors) else 0.0


def term(
    name: str, part: float, errors: Floats, kind: Literal["measurement", "input"] = "input"
) -> Term:
    """Return a term by what E (n,) of it alone was over the draws."""
    return Term(name, part, reach(errors), rms(errors) if len(errors) else 0.0, kind)


@dataclass(frozen=True)
class Finding:
    """Finding on the share of one quantity, and the term of u_val that causes it."""

    word: Word
    fault: Term | None
    words: str


def find_fault(share: Share, terms: Sequence[Term]) -> Finding:
    """Holds within `LEAST` to `MOST`; else the term whose variance is furthest off that way.

    Fewer is blunt, and no fault, where what claims too much is only what is `right`.
    """
    if share.inside:
        return Finding("holds", None, "")
    if share.value > MOST:
        worst = max(terms, key=lambda t: t.excess, default=None)
        return _named("too narrow", share, worst if worst and worst.excess > 0 else None)
    much = -_MUCH * sum(t.part**2 for t in terms)
    wrong = [t for t in terms if not t.right and t.excess < much]
    worst = min(wrong or terms, key=lambda t: t.excess, default=None)
    if worst is None or worst.excess >= 0:
        return _named("too wide", share, None)
    return _named("blunt" if worst.right else "too wide", share, worst)


def _named(word: Word, share: Share, worst: Term | None) -> Finding:
    chance = "; this may be chance; take more draws" if share.by_chance else ""
    said = worst.words if worst else "no single term: they act together"
    return Finding(word, worst, said + chance)
