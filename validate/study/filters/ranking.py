"""Ranking of cells within a condition of the twin, and robustness far from the design settings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.exhibit import Exhibit
from validate.engine.cell import Plan, Record, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.engine.store import key_of
from validate.estimate.gating import NoiseSettings
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.case_solution import KeptFields
from validate.pipeline.run.job import study_folder
from validate.register.markers.markers import MarkerObservation
from validate.report.views.view_filling import Shown, objects, table
from validate.study.filters.plan import Bench, FilterCell, open_bench, plan
from validate.study.filters.score import (
    LOG_LOSS,
    POOLED,
    WITHHELD,
    Blocks,
    FilterScores,
    Nested,
    SeedInterval,
    blocks_of,
    interval,
    nested,
    of_score,
    score_difference,
    score_interval,
)
from validate.study.study_page import Findings
from validate.study.sweep import named

# --- What a ranking without truth picks, where the truth is known: its true error against the
# best.

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


# -------------------------------------------------------------------------------------------------

# Ratio of median step times below which they are equal: noise of a shared machine.
SAME_TIME = 1.25
SAME_ERROR = 1 + 1e-6

Condition = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Ranked:
    """A cell's place by one score; `overlaps` are the places whose intervals overlap its interval.

    `from_best` is its score less the best one's over common seeds, or blocks of one recording;
    `tied` when that interval holds zero, or there are too few to say. `dominated_by` is the place
    of a cell with less error and less time a step (see `SAME_TIME`); None on the Pareto front.
    """

    place: int
    cell: FilterCell
    result: FilterScores
    score: SeedInterval
    overlaps: tuple[int, ...]
    from_best: SeedInterval
    tied: bool
    dominated_by: int | None


@dataclass(frozen=True)
class Ranking:
    """All cells of one condition, best first, and those that failed; `blocks` of one recording,
    and what a choice on some of its data is worth on the rest."""

    condition: Condition
    rows: tuple[Ranked, ...]
    failed: tuple[tuple[FilterCell, str], ...]
    blocks: Blocks | None = None
    nested: Nested | None = None

    @property
    def front(self) -> tuple[Ranked, ...]:
        """The Pareto front, fastest first; what has no time is not on it."""
        timed = [r for r in self.rows if r.result.step_s is not None]
        free = [r for r in timed if r.dominated_by is None]
        return tuple(sorted(free, key=lambda r: (_time(r.result), r.place)))


def _time(scores: FilterScores) -> float:
    """Seconds of a step; infinite for what is not timed."""
    return math.inf if scores.step_s is None else scores.step_s


def rankings(
    cells: Sequence[FilterCell], records: Mapping[str, Record[FilterScores]], by: str
) -> tuple[Ranking, ...]:
    """One ranking per condition, in the order of the grid."""
    conditions = dict.fromkeys(c.condition for c in cells)
    return tuple(
        _ranking(condition, [c for c in cells if c.condition == condition], records, by)
        for condition in conditions
    )


def _ranking(
    condition: Condition,
    cells: Sequence[FilterCell],
    records: Mapping[str, Record[FilterScores]],
    by: str,
) -> Ranking:
    scored = [(c, value) for c in cells if (value := records[c.key].value) is not None]
    failed = [(c, records[c.key].why) for c in cells if records[c.key].value is None]
    # Those scored on the most markers, and the others with the reason: fewer are another score
    on = {c.key: frozenset(w.name for w in of_score(v.withheld, by)) for c, v in scored}
    most = max(on.values(), key=len, default=frozenset())
    kept = [(c, v) for c, v in scored if by in v.scores and (on[c.key] == most or by == LOG_LOSS)]
    rest = [(c, v) for c, v in scored if c.key not in {k.key for k, _ in kept}]
    other = [(c, _why_not(v, by, on[c.key], most)) for c, v in rest]
    order = sorted(kept, key=lambda one: interval(one[1].scores[by]).mean)
    values = {c.key: value for c, value in order}
    names = {c.key: f"{c.name} ({named(c.settings)})" if c.settings else c.name for c, _ in order}
    blocks = blocks_of({names[key]: v for key, v in values.items()})
    means = [score_interval(value, by, blocks) for _, value in order]
    times = [_time(value) for _, value in order]
    rows = []
    for i, (cell, value) in enumerate(order):
        better = dominator(i, [m.mean for m in means], times)
        difference = score_difference(value, order[0][1], by, blocks)
        overlaps = tuple(j + 1 for j, s in enumerate(means) if j != i and means[i].overlaps(s))
        rows.append(
            Ranked(
                i + 1,
                cell,
                value,
                means[i],
                overlaps,
                difference,
                tied(difference),
                None if better is None else better + 1,
            )
        )
    of_filters = {names[c.key]: v for c, v in order if v.nis is not None and not c.baseline}
    others = {names[c.key]: v for c, v in order if v.nis is None or c.baseline}
    chosen = nested(
        of_filters,
        others,
        by if values and any(v.sums(by) is not None for _, v in order) else WITHHELD,
        blocks,
    )
    return Ranking(condition, tuple(rows), (*failed, *other), blocks, chosen)


ScoredCells = list[tuple[FilterCell, FilterScores]]


def _why_not(value: FilterScores, by: str, names: frozenset[str], most: frozenset[str]) -> str:
    if by == LOG_LOSS and value.predictions is not None:
        return f"no {by}: its variance needs samples in two blocks of time"
    if by == LOG_LOSS or (by not in value.scores and not most):
        return f"no innovations, so no {by}"
    return (
        f"scored on {', '.join(sorted(names)) or 'nothing'}, other cells on "
        f"{', '.join(sorted(most))}: give it two markers or more, or name --hold-out"
    )


def tied(difference: SeedInterval) -> bool:
    """Return whether the interval of a difference holds zero, or there is none (one sample)."""
    return difference.half is None or abs(difference.mean) <= difference.half


def dominator(i: int, errors: Sequence[float], times: Sequence[float]) -> int | None:
    """Return the first that has less error than i in at most its time, or no more error in less
    time; times within `SAME_TIME` are equal, and so are errors within `SAME_ERROR`: two solvers of
    one system differ by rounding. None on the Pareto front."""
    for j, (error, time) in enumerate(zip(errors, times, strict=True)):
        better = SAME_ERROR * error < errors[i] and time <= SAME_TIME * times[i]
        faster = error <= SAME_ERROR * errors[i] and SAME_TIME * time < times[i]
        if j != i and (better or faster):
            return j
    return None


# --- robustness of filters far from their design settings: finished, diverged or refused ---------

STEPS = 200  # of a run: growth shows within them
_VARIANCE, _SD = (1e-6, 1e6), (1e-3, 1e3)  # factors of noise settings
_STEPS = (0.25, 0.5, 2.0, 4.0)
_DROPPED = (0.5, 0.9)
_SEED = 1  # of the samples that are dropped


@dataclass(frozen=True)
class FilterChange:
    """A filter with one thing changed: `what` by `factor`, or that share of the samples dropped;
    `setting` is the field's name, "" for none."""

    cell: FilterCell
    what: str
    setting: str = ""
    factor: float = 1.0
    key: str = ""
    timed: bool = False

    @property
    def label(self) -> str:
        return f"{self.cell.method}, {self.what} x {self.factor:g}"


@dataclass(frozen=True)
class FilterEnding:
    """Outcome of a run, with its number of steps and the reason."""

    state: str
    step: int
    steps: int
    why: str = ""


@dataclass(frozen=True)
class FilterEndings:
    """All changes with their records."""

    changes: tuple[FilterChange, ...]
    done: Finished[FilterEnding]

    @property
    def rows(self) -> tuple[tuple[FilterChange, FilterEnding], ...]:
        found = []
        for change in self.changes:
            r = self.done.records[change.key]
            ending = r.value or FilterEnding("refused" if r.refused else "error", 0, 0, r.why)
            found.append((change, ending))
        return tuple(found)

    @property
    def bugs(self) -> tuple[str, ...]:
        """Runs that ended without a reason: errors of the program."""
        records = self.done.records
        return tuple(f"{c.label}: {records[c.key].failed}" for c in self.changes
                     if records[c.key].failed)  # fmt: skip


def filter_endings(
    experiment: Experiment,
    *,
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> FilterEndings | None:
    """None for an experiment without filters. Runs what is not finished yet."""
    filters = tuple(n for n, m in experiment.methods.items() if m.markers)
    if not filters:
        return None
    whole = tuple(n for n in filters if experiment.methods[n].steps is None)
    planned = plan(experiment, Options({}, whole or filters[:1], quick), (), 1)
    cells = [c for c in planned.cells if not c.baseline]
    changes = tuple(
        replace(c, key=key_of(planned.job, cell.key, c.what, c.factor))
        for cell in cells
        for c in _changes(cell, experiment.methods[cell.method], quick=quick)
    )
    work = Plan(planned.job, changes, open_bench, run_change, FilterEnding)
    folder = study_folder(experiment, "stability", out) / CELLS
    return FilterEndings(changes, finish(work, folder, where, report))


def _changes(cell: FilterCell, method: Method, *, quick: bool) -> list[FilterChange]:
    changes = [FilterChange(cell, "as declared")]
    noise: NoiseSettings = getattr(method.settings, "noise_settings", NoiseSettings("", "", ""))
    for what in ("process", "measurement", "start"):
        name = getattr(noise, what)
        if name and getattr(method.settings, name) != 0:
            unit = type(method.settings).__dataclass_fields__[name].metadata.get("unit", "")
            changes += [
                FilterChange(cell, f"{what} noise", name, f)
                for f in (_VARIANCE if unit == "m2" else _SD)
            ]
    if quick:
        return changes
    changes += [FilterChange(cell, "step", "", f) for f in _STEPS]
    return changes + [FilterChange(cell, "dropped samples", "", share) for share in _DROPPED]


def run_change(bench: Bench, change: FilterChange) -> FilterEnding:
    """Raise what the settings or the registration refuse."""
    ready = bench.ready(change.cell, change.cell.seeds[0])[0]
    method, factor = ready.method, change.factor
    if change.what == "dropped samples":
        # That share of the samples of all markers is missing
        rng = np.random.default_rng(_SEED)

        def without(sensor: Any) -> Any:
            if not isinstance(sensor, MarkerObservation):
                return sensor
            x = sensor.x.copy()
            x[rng.random(len(x)) < factor] = np.nan
            return replace(sensor, x=x)

        observations = tuple(without(o) for o in ready.registered.observations)
        ready = replace(ready, registered=replace(ready.registered, observations=observations))
    elif change.what == "step":
        split, stride = (round(1 / factor), 1) if factor < 1 else (1, round(factor))
        ready = replace(ready, method=replace(method, split=split, stride=stride))
    elif change.setting:
        value = getattr(method.settings, change.setting)
        if value is None:  # that of the measurements
            value = float((method.offered(ready.system, ready.registered).sd ** 2).mean())
        scaled = tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
        settings = replace(method.settings, **{change.setting: scaled})
        ready = replace(ready, method=replace(method, settings=settings))
    steps = min(STEPS, len(ready.registered.t))
    ready = replace(ready, method=replace(ready.method, steps=steps))
    end = ready.run(change.cell.method, KeptFields(ready.registered.t[:1])).outcome
    return FilterEnding(end.state, end.step, steps, end.why)


# --- report -------------------------------------------------------------------------------------


def endings_exhibit(endings: FilterEndings) -> Exhibit:
    """One row a run; those that did not finish first."""
    rows = sorted(endings.rows, key=lambda row: row[1].state == "finished")
    columns: Mapping[str, Shown] = {
        "filter": "0.cell.method", "changed": "0.what",
        "setting": lambda row: row[0].setting or None, "factor or share / 1": "0.factor",
        "ended": "1.state", "at step": "1.step", "of": "1.steps", "why": "1.why",
    }  # fmt: skip
    title = f"Filters with one thing changed, {STEPS} steps at most"
    shown = table("filters", title, rows, columns, below="why")
    return Exhibit("filters", "Filters at extreme settings", (sentence(endings),), (shown,))


def sentence(endings: FilterEndings) -> str:
    """Return the number of runs by outcome, in one sentence."""
    states = [e.state for _, e in endings.rows]
    counted = ", ".join(f"{states.count(s)} {s}" for s in dict.fromkeys(sorted(states)))
    bugs = f"; {len(endings.bugs)} ended in an error: {endings.bugs[0]}" if endings.bugs else ""
    changed = [w for w in dict.fromkeys(c.what for c, _ in endings.rows) if w != "as declared"]
    return (
        f"{len(states)} runs of filters as declared, or with {', '.join(changed)} changed: "
        f"{counted}{bugs}."
    )


def endings_document(endings: FilterEndings) -> list[dict[str, Any] | None]:
    """For results.json."""
    return objects(endings.rows, {
        "filter": "0.cell.method", "changed": "0.what", "setting": "0.setting",
        "factor": "0.factor", "ended": "1.state", "step": "1.step", "steps": "1.steps",
        "why": "1.why",
    })  # fmt: skip


def with_endings(findings: Findings, endings: FilterEndings) -> Findings:
    """Return the page of a stability map with how filters end."""
    return replace(
        findings,
        exhibits=(*findings.exhibits, endings_exhibit(endings)),
        document={**findings.document, "filters": endings_document(endings)},
        passed=None if findings.passed is None else findings.passed and not endings.bugs,
    )
