"""results.json and the runs' arrays: SI with units, no NaN, no infinity, no absolute path.

results.json is to be read whole: traces of long runs over time stand in it at the output frames
only, charts thinned, both rounded to seven digits; runs/ and tables/ hold every number.
"""

import json
import math
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.overall_verdict import Overall
from validate.compare.published import Published
from validate.compare.result import MethodResult, Result, domains
from validate.compare.score import Score
from validate.compare.verdict import Check
from validate.identify.budget import IdentifiedValue
from validate.report.sections.observations import timed
from validate.report.stored.environment import Made, environment, file_name
from validate.report.stored.exhibit_rows import exhibits, rounded
from validate.report.stored.json_values import Json, members, recorded
from validate.solve.types import Run

SCHEMA_VERSION = 2
_STEPS = 1000  # a run over time with more of them gives its traces at the output frames only
_FRAMES = 100  # fewer frames than these are loads, which traces are not thinned to
_VALUES = 60_000  # of all traces together: about 800 kB


@dataclass(frozen=True)
class _Share:
    """How much of its traces a run over time gives: output frames only, one in `every`."""

    frames_only: bool
    every: int


def schema() -> Json:
    """Return the JSON Schema of results.json that ships with the package."""
    text = files("validate.report").joinpath("results.schema.json").read_text(encoding="utf-8")
    loaded: Json = json.loads(text)
    return loaded


def document(result: Result, created: str, made: Made | None = None) -> Json:
    """Return the content of results.json. Numbers that are not finite become null with a `why`."""
    # What keeps all traces together at about `_VALUES`
    runs = [r for m in result.methods for r in m.runs]
    whole = sum(len(r.traces) * len(r.t) for r in runs)
    framed = sum(len(r.traces) * len(r.at) for r in runs)
    share = _Share(whole > _VALUES, max(1, -(-framed // _VALUES)))
    # What the first accepted method covered, else the first one
    method = next((m for m in result.methods if m.accepted), next(iter(result.methods), None))
    names = tuple(r.name for r in result.recordings)
    by = made or Made()
    return {
        "schema_version": SCHEMA_VERSION,
        "experiment": result.name,
        "title": result.title,
        "source": result.source,
        "created": created,
        "sentence": result.sentence,
        "passed": result.passed,
        "quick": result.quick,
        "kind": result.kind,
        "overall": overall_members(result.overall),
        "expected": [members(e) for e in result.expected],
        "moved": [members(m) for m in result.moved] if result.expected else [],
        "twin_notice": result.twin_notice,
        "seed": result.seed,
        "notes": list(result.notes),
        "warnings": list(result.warnings),
        "inputs": [members(r.source) | {"path": file_name(r.source.path)}
                   for r in result.recordings],
        "streams": [members(s) | {"topic": s.topic} for s in result.streams],  # no path: "/a/b"
        "parameters": {
            p.path: {"value": recorded(p.default), "unit": p.unit, "origin": p.origin}
            for p in result.parameters
        },
        "changed": [members(c) for c in result.changed],
        "made": {
            "command": by.command,
            "commit": by.commit and by.commit.sha,
            "dirty": by.commit and by.commit.dirty,
            "project_commit": by.project and by.project.sha,
            "project_dirty": by.project and by.project.dirty,
            "code_sha256": by.code_sha256,
            "files": [members(f) for f in by.files],
            "plug_ins": list(by.plug_ins),
        },
        "environment": environment(),
        "methods": [_method(m, result, share) for m in result.methods],
        "domain": recorded(domains(method, names, result.specimens) if method else ()),
        "effects": recorded(result.effects),
        "rest": [
            {"name": r.name, "unit": r.unit, "sd": recorded(r.sd), "count": r.count,
             "rms": recorded(rms(r.values))}
            for r in result.rest
        ],
        "identified": identified_members(result),
        "published": [figure_members(p) for p in result.published],
        "uncertain_inputs": [members(i) for i in result.inputs],
        "joint_inputs": [members(j) | {"percent": recorded(j.percent)} for j in result.joint],
        "exhibits": exhibits(result.exhibits),
        "views": [v.to_json() for v in result.views],
    }  # fmt: skip


def identified_members(result: Result) -> list[Json]:
    """Identified values with interval and budget, then scores; a score of the same name as a value
    is the same number."""
    values = [_value(v) for v in result.identified_values]
    named = {v.name for v in result.identified_values}
    return [*values, *(_score(s) for s in result.identified if s.name not in named)]


def _value(one: IdentifiedValue) -> Json:
    low, high = one.interval
    return {
        "name": one.name, "value": recorded(one.value), "unit": one.unit, "count": one.count,
        "against": "what calibrates", "definition": f"identified by {one.by} on {one.on}",
        "interval": recorded((low, high)), "u": recorded(one.u),
        "parts": {name: recorded(u) for name, u in one.parts.items()},
        "by": one.by, "on": one.on, "correlation": one.correlation, "finding": one.finding,
    }  # fmt: skip


def _method(method: MethodResult, result: Result, share: _Share) -> Json:
    first, times = method.run, timed(method.run)
    end = next((r.outcome for r in method.runs if not r.finished), first.outcome)
    names = [r.name for r in result.recordings]
    return {
        "name": method.name,
        "label": method.label,
        "chosen": method.chosen,
        "accepted": method.accepted,
        "outcome": recorded(end),
        "setup_s": recorded(first.setup_s),
        "step_s": recorded(times),
        "rate_hz": recorded(times.rate_hz) if times else None,
        **_traced(first, share),
        "further_runs": [
            {"recording": name, "outcome": run.outcome.state, **_traced(run, share)}
            for name, run in zip(names[1:], method.runs[1:], strict=False)
        ],
        "scores": [_score(s) for s in method.scores],
        "checks": [check_members(c) for c in method.checks],
        "published": [
            figure_members(p) for p in result.published if p.name.startswith(f"{method.name}: ")
        ],
    }  # fmt: skip


def _traced(run: Run, share: _Share) -> Json:
    """Times and traces, at every step or at the output frames that the share leaves."""
    thin = len(run.at) >= _FRAMES and (len(run.t) > _STEPS or share.frames_only)
    at = run.at[:: share.every] if thin else np.arange(len(run.t))

    def numbers(values: Floats) -> list[float]:
        return rounded(values[at]) if thin else values.tolist()

    return {
        "traces_at": "output frames" if thin else "every step",
        "t": numbers(run.t),
        "traces": {k: {"unit": t.unit, "y": numbers(t.y)} for k, t in run.traces.items()},
    }


def _score(score: Score) -> Json:
    why = {} if math.isfinite(score.value) else {"why": f"not finite ({score.value})"}
    return members(score) | why


def overall_members(found: Overall) -> Json:
    """Return the verdict over all checks; names of those that decide it."""
    return {
        "verdict": found.word,
        "evidence": found.evidence,
        "checks": found.total,
        "acceptance_correction": "none: intersection-union test",
        "good_enough": [c.name for c in found.met],
        "not_good_enough": [c.name for c in found.failed],
        "correction": "Holm",
        "differs": [c.name for c in found.differs],
        "differs_alone": [c.name for c in found.alone],
        "undecided": [c.name for c in found.undecided],
    }


def check_members(check: Check) -> Json:
    """Return the members of a check; one that compared nothing has no error and no uncertainty.
    `verdict` is the answer that decides."""
    parts = ("value", "raw", "noise", "u_val", "u_D", "u_num", "u_input")
    found = {k: v for k, v in members(check).items() if k != "ratio"}
    found |= {"verdict": check.verdict, "margin": check.margin}
    return found | ({} if check.count else dict.fromkeys(parts))


def figure_members(figure: Published) -> Json:
    """Return a printed figure with its verdict of today, and why the claim does not stand, if
    so."""
    judged = {
        "verdict": figure.verdict, "reason": figure.why, "fault": figure.fault,
        "result": figure.result,
    }  # fmt: skip
    return members(figure) | judged
