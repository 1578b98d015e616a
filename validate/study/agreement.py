"""What a ranking without truth picks, where the truth is known: its true error against the best."""

from collections.abc import Mapping
from dataclasses import dataclass

from validate.study.filter_plan import FilterCell
from validate.study.score import POOLED, WITHHELD, FilterScores

NEAR = 1.1  # times the best true error: as good


@dataclass(frozen=True)
class TruthPick:
    """On one recording: the setting of least error at what was withheld, its true error m, and the
    setting of the least true error."""

    condition: tuple[tuple[str, str], ...]
    seed: int
    cell: FilterCell
    error: float
    best: FilterCell
    least: float

    @property
    def ratio(self) -> float:
        if self.error == self.least:
            return 1.0
        return self.error / self.least if self.least > 0 else float("inf")

    @property
    def near(self) -> bool:
        return self.ratio <= NEAR


def picks(values: Mapping[FilterCell, FilterScores]) -> tuple[TruthPick, ...]:
    """One for every condition and seed, among filters; none where no truth is known."""
    filters = {
        c: v for c, v in values.items()
        if v.nis is not None and not c.baseline and POOLED in v.scores and WITHHELD in v.scores
    }  # fmt: skip
    picked = []
    for condition in dict.fromkeys(c.condition for c in filters):
        same = {c: v for c, v in filters.items() if c.condition == condition}
        if len(same) < 2:
            continue
        for i, seed in enumerate(next(iter(same)).seeds):
            true = {c: v.scores[POOLED][i] for c, v in same.items()}
            pick = min(same, key=lambda c: same[c].scores[WITHHELD][i])
            best = min(true, key=lambda c: true[c])
            picked.append(TruthPick(condition, seed, pick, true[pick], best, true[best]))
    return tuple(picked)
