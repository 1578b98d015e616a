"""Comparison of stored runs, score by score."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from validate.compare.exhibit import Exhibit
from validate.display import Screen
from validate.library.plots import Plots, exhibit_plots
from validate.library.run_result import RunResult
from validate.numbers import shown_unit, significant, text
from validate.report.long_table import frame
from validate.report.stored.tables import stored_folder
from validate.study.stored_runs.score_comparison import (
    SideBySide,
    comparison_exhibits,
    narrowed,
    ordered,
    read_run,
    side_by_side,
)

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, repr=False)
class RunComparison:
    """Scores of stored runs next to each other, in SI; nothing is run."""

    scores: SideBySide

    @property
    def runs(self) -> tuple[str, ...]:
        """What the columns are: names of runs, or "run: method" where no method is shared."""
        return self.scores.columns

    @property
    def parameters(self) -> Mapping[str, tuple[str, ...]]:
        """The parameters that differ, by path, with the value of each run as text."""
        return self.scores.parameters

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the runs hard to compare: other recordings, quick runs."""
        return self.scores.warnings

    @property
    def plot(self) -> Plots:
        """Tables and figures by name: `pair_1`, `changes_1`, `parameters`."""
        return exhibit_plots(self._exhibits)

    def _exhibits(self) -> dict[str, Exhibit]:
        """Each table and each picture of the page alone, by its name."""
        found: dict[str, Exhibit] = {}
        for exhibit in comparison_exhibits(self.scores):
            one = Exhibit(exhibit.anchor, exhibit.title)
            found |= {t.name: replace(one, tables=(t,)) for t in exhibit.tables}
            found |= {p.name: replace(one, pictures=(p,)) for p in exhibit.pictures}
        return found

    def to_pandas(self) -> "DataFrame":
        """Return one row a score: method, score, unit, one column a run, SI.

        Raises `UsageError` where pandas is not installed.
        """
        rows = [(r.method, r.score, r.unit, *r.values) for r in self.scores.rows]
        return frame(rows, ("method", "score", "unit", *self.runs))

    @property
    def _screen(self) -> Screen:
        rows = tuple(
            (r.method, r.score, *(text(v, r.unit) for v in r.values), shown_unit(r.unit),
             *("–" if c is None else f"{significant(100 * c)} %" for c in r.changes[1:]))
            for r in self.scores.rows
        )  # fmt: skip
        changes = ["change"] * (len(self.runs) - 1)
        columns = [chr(ord("A") + i) for i in range(len(self.runs))]
        words = "; ".join(f"{c}: {run}" for c, run in zip(columns, self.runs, strict=True))
        differing = [f"{path}: {' | '.join(v)}" for path, v in self.parameters.items()]
        more = [f"and {len(differing) - 3} more parameters"] if len(differing) > 3 else []
        return Screen(
            f"{len(self.scores.rows)} scores of {len(self.scores.runs)} runs",
            (words, *self.warnings[:2]), ("method", "score", *columns, "unit", *changes), rows,
            (*differing[:3], *more),
        )  # fmt: skip

    def __repr__(self) -> str:
        return self._screen.text

    def _repr_html_(self) -> str:
        return self._screen.html


def compare(
    *runs: RunResult | str | Path,
    methods: Sequence[str] = (),
    scores: Sequence[str] = (),
    sort: str = "change",
) -> RunComparison:
    """Return the scores of two or more stored runs next to each other; nothing is run.

    `methods` and `scores` are patterns, as `["kf_*"]` and `["*.rms@9mm"]`. `sort` is "change",
    "difference", "score", "method" or "stored". To simulate and compare with a recording use
    `validate.run`; to compare fields of two meshes, `validate.compare.FieldScores`.

    Raises `UsageError` for fewer than two runs and for a folder without a run, `ComparisonError`
    where no score is shared.
    """
    folders = [r.folder if isinstance(r, RunResult) else stored_folder(r) for r in runs]
    return RunComparison(scores_of_runs(folders, methods, scores, sort))


def scores_of_runs(
    folders: Sequence[Path], methods: Sequence[str], scores: Sequence[str], sort: str
) -> SideBySide:
    """Read runs from their folders and align their scores. Raises as `compare`."""
    runs = narrowed([read_run(f) for f in folders], tuple(methods), tuple(scores))
    return ordered(side_by_side(runs), sort)
