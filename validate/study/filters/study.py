"""Filter study: every method and setting over common seeds, ranked with intervals.

from validate.study.filters.study import study
result = study("kf_cube", ["methods.kf_printed.Q=log:1e-12:1e-6:7"], methods=("kf_printed",))
print(result.best[0].line)
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.engine.cell import Plan, Record, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.errors import ComparisonError, UsageError
from validate.parameters import nearest_names
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.job import study_folder
from validate.study.filters.cell import run_cell
from validate.study.filters.plan import (
    CASE,
    EACH,
    METHODS,
    FilterCell,
    FilterPlan,
    open_bench,
    plan,
)
from validate.study.filters.ranking import Ranked, Ranking, TruthPick, picks, rankings, tied
from validate.study.filters.score import (
    AHEAD,
    HELD_OUT,
    LOG_LOSS,
    POOLED,
    WITHHELD,
    Blocks,
    FilterScores,
    blocks_of,
    score_difference,
)
from validate.study.filters.withheld_errors import Innovations, PredictionErrors
from validate.study.sweep import axes

KIND = "filters"


@dataclass(frozen=True)
class Best:
    """The best filter of one condition and the command that runs it; `ties` counts the cells of
    filters that are not distinguishable from it. `edges` are the swept paths whose first or last
    value it has; `better` names what is first where that is no filter."""

    ranked: Ranked
    line: str
    ties: int
    edges: tuple[str, ...]
    better: str = ""

    @property
    def doubts(self) -> str:
        """Reasons not to take it as it is; "" for none."""
        reasons = [f"place {self.ranked.place}: {self.better} is first"] if self.better else []
        if self.ranked.score.half is None:
            reasons.append("without an interval, settings cannot be distinguished")
        elif self.ties:
            others = "1 other" if self.ties == 1 else f"{self.ties} others"
            reasons.append(f"{others} not distinguishable from it")
        if self.edges:
            reasons.append(
                f"the best value lies at the end of the sweep of {', '.join(self.edges)}: widen it"
            )
        consistency = self.ranked.result.consistency
        if consistency is not None and not consistency.band_95.holds(consistency.mean):
            reasons.append(
                f"NIS {consistency.mean:.3g} is outside its 95 % band: its claimed interval is "
                "not used"
            )
        return "; ".join(reasons)


@dataclass(frozen=True)
class FilterStudy:
    """All cells with their records, and the rankings by the score `by`, one a condition."""

    plan: FilterPlan
    by: str
    done: Finished[FilterScores]
    rankings: tuple[Ranking, ...]

    @property
    def unit(self) -> str:
        """Of the score that ranks."""
        return self.rankings[0].rows[0].result.units[self.by]

    @property
    def picks(self) -> tuple[TruthPick, ...]:
        """What a ranking without truth picks where the truth is known."""
        records = self.done.records
        values = {c: v for c in self.plan.cells if (v := records[c.key].value) is not None}
        return picks(values)

    @property
    def best(self) -> tuple[Best, ...]:
        return tuple(_best(self.plan, r, self.by) for r in self.rankings if r.rows)

    @property
    def failed(self) -> int:
        return sum(len(r.failed) for r in self.rankings)


def study(
    experiment: str | Experiment,
    sweeps: Sequence[str] = (),
    *,
    methods: tuple[str, ...] = (),
    values: Mapping[str, str] | None = None,
    seeds: int | tuple[int, ...] | None = None,
    by: str = "",
    hold_out: tuple[str, ...] = (),
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> FilterStudy:
    """Runs what is not finished yet in `out`/<name>/study-filters/cells, and ranks everything.

    `sweeps` as for `--sweep`, `values` as for `--set`; `out` is the folder of the reports. `by` is
    a score of `validate.study.filters.score` (empty: the truth's, where it is known, else that of
    what was withheld); `hold_out` as for `--hold-out`. Raises `UsageError` for bad names and values
    before anything runs, `ComparisonError` when no cell has a score.
    """
    declared = find(experiment, Path.cwd()) if isinstance(experiment, str) else experiment
    options = Options(dict(values or {}), methods, quick)
    # The sweeps that the experiment declares, of the chosen methods, where none is given.
    chosen = methods or tuple(declared.methods)
    own = [
        s.text for s in declared.sweeps
        if not s.path.startswith("methods.") or s.path.split(".")[1] in chosen
    ]  # fmt: skip
    planned = plan(declared, options, axes(sweeps or own), seeds, hold_out)
    work = Plan(planned.job, planned.cells, open_bench, run_cell, FilterScores)
    done = finish(work, study_folder(declared, KIND, out) / CELLS, where, report)
    # Where every filter failed, nothing is compared
    known = planned.experiment.methods
    cells = [c for c in planned.cells if known[c.method].markers and not c.baseline]
    failed = [c for c in cells if done.records[c.key].value is None]
    if cells and len(failed) == len(cells):
        first = done.records[failed[0].key].why
        raise ComparisonError(
            f"all {len(cells)} settings of filters failed; the first, {failed[0].label}: {first}"
        )
    done = replace(done, records=with_likelihoods(planned.cells, done.records))
    by = by or usual_score(done, in_turn=hold_out == EACH)
    _require_score(done, by)
    return FilterStudy(planned, by, done, rankings(planned.cells, done.records, by))


def _require_score(done: Finished[FilterScores], by: str) -> None:
    good = [r.value for r in done.records.values() if r.value is not None]
    if not good:
        why = next(iter(done.records.values())).why
        raise ComparisonError(f"all {len(done.records)} cells failed, 0 compared; the first: {why}")
    names = {name for value in good for name in value.scores}
    if by not in names:
        raise UsageError(f"no score '{by}' to rank by; {nearest_names(by, names)}")


def usual_score(done: Finished[FilterScores], *, in_turn: bool) -> str:
    """Return the first of the usual scores that every filter has; else the first of a filter."""
    filters = [v for r in done.records.values() if (v := r.value) is not None and v.nis is not None]
    usual = (POOLED, HELD_OUT if in_turn else WITHHELD, AHEAD)
    names = (*usual, *(filters[0].scores if filters else ()))
    return next((n for n in names if all(n in v.scores for v in filters)), POOLED)


def _best(planned: FilterPlan, ranking: Ranking, by: str) -> Best:
    """The first filter (what has innovations); the first of all where there is none."""
    filters = [r for r in ranking.rows if r.result.nis is not None and not r.cell.baseline]
    rows = filters or list(ranking.rows)
    differences = [score_difference(r.result, rows[0].result, by, ranking.blocks) for r in rows[1:]]
    ties, cell = sum(tied(d) for d in differences if d.half is not None), rows[0].cell
    first = ranking.rows[0]
    better = "" if first is rows[0] else first.cell.name
    return Best(rows[0], run_line(planned, cell), ties, _edges(planned, cell), better)


def _edges(planned: FilterPlan, cell: FilterCell) -> tuple[str, ...]:
    """Swept settings of three and more numbers of which the cell has the least or the largest."""
    edges = []
    for axis in planned.axes:
        numbers = axis.numbers
        if axis.path in dict(cell.settings) and numbers is not None and len(numbers) > 2:
            value = numbers[axis.values.index(cell.values[axis.path])]
            if value in (min(numbers), max(numbers)):
                edges.append(axis.path)
    return tuple(edges)


def run_line(planned: FilterPlan, cell: FilterCell) -> str:
    """Return the `validate run` command of a cell, with the methods it is judged beside: the
    reference that speeds are compared with and those whose checks decide, as `cell` alone may have
    none."""
    experiment = planned.experiment
    beside = [m for m in experiment.methods if m in (*experiment.accepted, experiment.reference)]
    methods = tuple(dict.fromkeys((*beside, cell.method)))
    values = {**dict(planned.job.values), **cell.values}
    case = values.pop(CASE, "")
    prefixes = tuple(f"{METHODS}{m}." for m in methods)
    kept = {k: v for k, v in values.items() if not k.startswith(METHODS) or k.startswith(prefixes)}
    parts = ["validate", "run", experiment.name]
    for path, value in kept.items():
        parts += ["--set", f"{path}={value}"]
    parts += ["--case", case] if case else []
    return shlex.join([*parts, "--methods", ",".join(methods)])


# --- Predictive likelihood of methods without one: plain FEM and the last measurement.
#
# A Gaussian about the prediction, of variance R + q per measured component: R is the noise of one
# measurement, q >= 0 the variance of the model. Its maximum-likelihood estimate over errors e is
# q = max(0, mean(e^2) - R). It is taken on all blocks of time but the one that it scores, so a
# baseline is shown at its best and never sees the block that is reported.

Records = Mapping[str, Record[FilterScores]]


def with_likelihoods(cells: Sequence[FilterCell], records: Records) -> Records:
    """Return the records, with a likelihood for the methods without innovations of every
    condition."""
    scored = dict(records)
    for condition in dict.fromkeys(c.condition for c in cells):
        values = {
            c.key: value
            for c in cells
            if c.condition == condition and (value := records[c.key].value) is not None
        }
        blocks = blocks_of(values)
        for key, value in values.items():
            scored[key] = replace(records[key], value=with_likelihood(value, blocks))
    return scored


def with_likelihood(value: FilterScores, blocks: Blocks | None) -> FilterScores:
    """The same, with the log loss of its predictive Gaussian where it has no innovations."""
    if value.predictions is None or value.innovations is not None or blocks is None:
        return value
    likelihood = predictive_likelihood(value.predictions, blocks)
    if likelihood is None:
        return value
    loss = -likelihood.log_likelihood.sum(axis=1) / likelihood.dof.sum(axis=1)
    return replace(
        value,
        innovations=likelihood,
        scores={**value.scores, LOG_LOSS: tuple(loss.tolist())},
        units={**value.units, LOG_LOSS: "1"},
    )


def predictive_likelihood(errors: PredictionErrors, blocks: Blocks) -> Innovations | None:
    """Log-likelihood by segment, each block under the variance that all others give; None where a
    component has no sample outside of a block that has some, or none at all."""
    counts, squares = blocks.sums(errors.counts), blocks.sums(errors.squares)
    others = counts.sum(axis=-1, keepdims=True) - counts
    if not (counts.sum(axis=(1, 2)) > 0).all() or ((counts > 0) & (others == 0)).any():
        return None
    outside = squares.sum(axis=-1, keepdims=True) - squares
    mean = np.divide(outside, others, out=np.zeros_like(outside), where=others > 0)
    block = np.searchsorted(blocks.starts, np.arange(errors.counts.shape[-1]), side="right") - 1
    variance = np.maximum(np.asarray(mean[..., block]), errors.noise)
    density = errors.counts * np.log(2 * np.pi * variance) + errors.squares / variance
    return Innovations(-0.5 * density.sum(axis=1), errors.counts.sum(axis=1), None, None)
