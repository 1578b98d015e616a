"""Stored runs two by two, as a terminal has room for: the first run against each other one."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from validate.study.stored import Row, SideBySide, StoredRun

MOST = 2  # pairs of methods shown where no method is shared: there are as many as m1 * m2


@dataclass(frozen=True)
class Pair:
    """Two columns of a comparison, with the rows (two values each) that both have."""

    one: str
    other: str
    rows: tuple[Row, ...]


def pairs(found: SideBySide) -> tuple[tuple[Pair, ...], int, int]:
    """The pairs to show, how many more there are, and how many rows of `found` none of them has.

    Runs that share methods: the first against every other. Else their methods: accepted ones first,
    the first of one run against the first of the other, at most `MOST`.
    """
    every = [(one, other, _rows(found, one, other)) for one, other in _columns(found)]
    kept = [pair for pair in every if pair[2]]
    shown = kept[:MOST] if found.by_score else kept
    names = found.columns
    seen = {(r.method, r.score) for _, _, rows in shown for r in rows}
    made = tuple(Pair(names[i], names[j], rows) for i, j, rows in shown)
    return made, len(kept) - len(shown), len(found.rows) - len(seen)


def _rows(found: SideBySide, one: int, other: int) -> tuple[Row, ...]:
    rows = [(r, (r.values[one], r.values[other])) for r in found.rows]
    return tuple(Row(r.method, r.score, r.unit, pair) for r, pair in rows if None not in pair)


def _columns(found: SideBySide) -> Iterator[tuple[int, int]]:
    """Indices of two columns each, of the first run and of a later one."""
    if not found.by_score:
        yield from ((0, j) for j in range(1, len(found.runs)))
        return
    starts = [sum(len(r.methods) for r in found.runs[:i]) for i in range(len(found.runs))]
    first, *others = (_ranked(r) for r in found.runs)
    for start, other in zip(starts[1:], others, strict=True):
        ranks = product(range(len(first)), range(len(other)))
        for i, j in sorted(ranks, key=lambda ij: (abs(ij[0] - ij[1]), ij)):
            yield first[i], start + other[j]


def _ranked(run: StoredRun) -> list[int]:
    """Places of the methods, accepted ones first."""
    return sorted(range(len(run.methods)), key=lambda i: run.methods[i] not in run.accepted)
