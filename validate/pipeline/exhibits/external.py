"""Table of external simulators and internal methods: error, verdict, rate and memory."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from validate.compare.exhibit import Exhibit, NumberTable, TableCell
from validate.pipeline.checks.checks import Terms, terms_of
from validate.pipeline.experiment.options import external_methods
from validate.pipeline.run.method_run import MethodRun
from validate.pipeline.run.runs import ExperimentRuns
from validate.solve.external.scheme import ExternalSimulator, changes

_HEAD = ("method", "program", "check", "error E", "2 u_val", "margin", "acceptance",
         "validation", "rate / Hz", "memory / MB", "ended")  # fmt: skip
_NAME = "external_simulators"
_OURS = "this one"
_MB = 1e-6
_WORDS = (
    "All use the u_val of the accepted method: its measurement, inputs and mesh error. The "
    "mesh error of an external simulator is part of its E. Only accepted methods set the exit "
    "code. A rate is that of one step (statics: one equilibrium) on one thread. Memory is the "
    "peak of the external simulator's largest process; for our methods it is the peak of the "
    "whole process until then."
)


def external_exhibits(runs: ExperimentRuns, main: Mapping[str, MethodRun]) -> tuple[Exhibit, ...]:
    """Return the table and the deviations; empty if no external simulator ran."""
    simulators = external_methods({n: m for n, m in runs.methods.items() if n in main})
    if not simulators:
        return ()
    accepted = [n for n in runs.experiment.accepted if n in main][:1]
    terms = {k: t for n in accepted for _, one in terms_of(runs, main[n]) for k, t in one.items()}
    made = {n: _rows(f, runs.methods[n].settings, terms) for n, f in main.items()}
    checks = {row[2] for n in simulators for row in made[n]}  # ours are shown beside theirs alone
    rows = [row for own in made.values() for row in own if row[2] in checks]
    said = []
    for name in simulators:
        lines = dict.fromkeys(line for run in main[name].runs for line in run.said)
        said += [(main[name].label, s) for s in lines if not s.startswith("external: ")]
    tables = [NumberTable(_NAME, "External simulators and our methods", _HEAD, tuple(rows))]
    if said:
        head = ("simulator", "deviations and failures")
        tables.append(NumberTable("external_findings", "Findings", head, tuple(said)))
    return (Exhibit(_NAME, "External simulators", (_WORDS,), tables=tuple(tables)),)


def _rows(
    f: MethodRun, settings: Any, terms: Mapping[str, Terms]
) -> list[tuple[TableCell | float | str | None, ...]]:
    """A row a check; one alone where an external one was not run, or has nothing checked."""
    run, external = f.run, isinstance(settings, ExternalSimulator)
    named = [line.removeprefix("external: ") for line in run.said if line.startswith("external: ")]
    program = next(iter(named), "-") if external else _OURS
    rate = _rate(f, settings)
    memory = _MB * run.memory or None
    end = run.outcome.state + (f": {run.outcome.why}" if run.outcome.why else "")
    cost = (rate, memory, end)
    judged = [t.judge(f.residuals[k]) for k, t in terms.items() if k in f.residuals]
    if not judged and not external:
        return []
    if not judged or not run.finished:
        return [(f.label, program, "-", None, None, None, "-", "-", *cost)]
    return [
        (f.label, program, c.name,
         *(TableCell(number, c.unit) for number in (c.value, 2 * c.u_val, c.margin)),
         c.acceptance, c.validation, *cost)
        for c in judged
    ]  # fmt: skip


def _rate(f: MethodRun, settings: Any) -> float | None:
    """Steps a second; of statics only those whose inputs are new count: others are answered by
    what is there."""
    run, handles = f.run, getattr(settings, "handles", None)
    if run.step_s is None:
        return None
    still = handles is not None and not handles.inertia
    if not still or run.seconds is None or f.seen.inputs.shape[0] < len(run.seconds):
        return run.step_s.rate_hz
    new = changes(f.seen.t[: len(run.seconds)], f.seen.inputs[: len(run.seconds)])
    at = np.searchsorted(f.seen.t, new.t)
    return 1 / float(np.median(run.seconds[at]))
