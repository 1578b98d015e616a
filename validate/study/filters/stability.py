"""Robustness of filters far from their design settings: finished, diverged or refused."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.compare.exhibit import Exhibit
from validate.engine.cell import Plan, Where
from validate.engine.execution import CELLS, Finished, Report, finish
from validate.engine.store import key_of
from validate.estimate.gating import NoiseSettings
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.case_solution import KeptFields
from validate.pipeline.run.named_run import study_folder
from validate.register.markers.markers import MarkerObservation
from validate.report.views.view_filling import Shown, objects, table
from validate.study.filters.bench import Bench, Ready, open_bench
from validate.study.filters.plan import FilterCell, plan
from validate.study.study_page import Findings

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
    ready = _changed(bench.ready(change.cell, change.cell.seeds[0])[0], change)
    steps = min(STEPS, len(ready.registered.t))
    ready = replace(ready, method=replace(ready.method, steps=steps))
    end = ready.run(change.cell.method, KeptFields(ready.registered.t[:1])).outcome
    return FilterEnding(end.state, end.step, steps, end.why)


def _changed(ready: Ready, change: FilterChange) -> Ready:
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
        return replace(ready, registered=replace(ready.registered, observations=observations))
    if change.what == "step":
        split, stride = (round(1 / factor), 1) if factor < 1 else (1, round(factor))
        return replace(ready, method=replace(method, split=split, stride=stride))
    if not change.setting:
        return ready
    value = getattr(method.settings, change.setting)
    if value is None:  # that of the measurements
        value = float((method.offered(ready.system, ready.registered).sd ** 2).mean())
    scaled = tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
    return replace(
        ready, method=replace(method, settings=replace(method.settings, **{change.setting: scaled}))
    )


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
