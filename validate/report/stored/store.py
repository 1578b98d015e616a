"""results.json with its report items, and the arrays of runs: SI with units, no NaN, no path.

results.json is to be read whole: traces of long runs over time stand in it at the output frames
only, charts thinned, both rounded to seven digits; runs/ and tables/ hold every number.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise

import numpy as np

from validate.arrays import Floats, Ints, rms
from validate.compare.exhibit import Chart, Exhibit, NodeMap, NumberTable, Series, plain
from validate.compare.overall_verdict import Overall
from validate.compare.published import Published
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result, domains
from validate.compare.row import CHART, TABLE, LongRow
from validate.compare.score import Score
from validate.compare.verdict import Check
from validate.identify.budget import IdentifiedValue
from validate.report.sections.observations import timed
from validate.report.stored.environment import Made, environment, file_name
from validate.report.stored.folder import Json, members, recorded
from validate.solve.types import Run
from validate.units import si_of

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
        "made": _made(made or Made()),
        "environment": environment(),
        "methods": [_method(m, result, share) for m in result.methods],
        "domain": recorded(domains(method, names, result.specimens) if method else ()),
        "effects": recorded(result.effects),
        "rest": [_rest(r) for r in result.rest],
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


def _made(made: Made) -> Json:
    ours, theirs = made.commit, made.project
    return {
        "command": made.command,
        "commit": ours and ours.sha,
        "dirty": ours and ours.dirty,
        "project_commit": theirs and theirs.sha,
        "project_dirty": theirs and theirs.dirty,
        "code_sha256": made.code_sha256,
        "files": [members(f) for f in made.files],
        "plug_ins": list(made.plug_ins),
    }


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
    """Return a check that compared nothing has no error and no uncertainty. `verdict` is the answer
    that decides."""
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


def _rest(r: Residual) -> Json:
    return {
        "name": r.name, "unit": r.unit, "sd": recorded(r.sd), "count": r.count,
        "rms": recorded(rms(r.values)),
    }  # fmt: skip


# --- report items in results.json: tables in full, charts thinned, maps by extremes --------------

#: Condition on `part` for all rows but those of tables and charts.
NOT_SHOWN = (f"!{TABLE}", f"!{CHART}")
_POINTS = 2000  # of one series, at most
_ALL_POINTS = 30_000  # of all series together: about 600 kB
_FEWEST = 20  # points that a series keeps however many there are
_DIGITS = 7  # significant, of numbers whose full precision is in another file


def stored_exhibits(content: Json) -> tuple[Exhibit, ...]:
    """Words, tables and charts of the exhibits in results.json; charts as thinned there."""
    return tuple(
        Exhibit(
            str(e["anchor"]), str(e["title"]), tuple(e["words"]),
            tuple(_read_table(t) for t in e["tables"]), tuple(_read_chart(c) for c in e["charts"]),
        )
        for e in content.get("exhibits", ())
    )  # fmt: skip


def _read_table(t: Json) -> NumberTable:
    rows = tuple(tuple(row) for row in t["rows"])
    return NumberTable(t["name"], t["title"], tuple(t["headings"]), rows, t["note"])


def _read_chart(c: Json) -> Chart:
    series = tuple(
        Series(s["label"], np.array(s["x"], float), np.array(s["y"], float), s["style"],
               np.array(s["upper"], float) if "upper" in s else None)
        for s in c["series"]
    )  # fmt: skip
    levels = tuple((level["name"], level["y"]) for level in c["levels"])
    return Chart(c["name"], c["title"], c["x"], c["y"], series, levels, c["log"], c["caption"])


def exhibit_rows(content: Json, run: str) -> Iterator[LongRow]:
    """Every number of these tables and charts, SI.

    `quantity` is the table or chart, `statistic` the heading or axis, `variation` the texts of the
    line or the label of the series, `method` where one of them is a method; `point` counts lines.
    """
    methods = {
        str(m.get(k, "")): str(m["name"]) for m in content["methods"] for k in ("label", "name")
    }
    one = LongRow(run, str(content["experiment"]))
    for exhibit in stored_exhibits(content):
        for table in exhibit.tables:
            named = one._replace(part=TABLE, quantity=table.name or exhibit.anchor)
            yield from _rows_of_table(named, table, methods)
        for chart in exhibit.charts:
            yield from _rows_of_chart(one._replace(part=CHART, quantity=chart.name), chart, methods)


def _rows_of_table(
    one: LongRow, table: NumberTable, methods: Mapping[str, str]
) -> Iterator[LongRow]:
    axes = [_axis(heading) for heading in table.headings]
    for i, row in enumerate(table.rows):
        words = [entry for entry in row if isinstance(entry, str)]
        method = next((methods[w] for w in words if w in methods), "")
        of = one._replace(method=method, variation="; ".join(words), point=i)
        for entry, (name, unit, factor) in zip(row, axes, strict=True):
            if isinstance(entry, (int, float)):
                yield of._replace(statistic=name, value=factor * entry, unit=unit)


def _rows_of_chart(one: LongRow, chart: Chart, methods: Mapping[str, str]) -> Iterator[LongRow]:
    (name, unit, factor), (across, _, by) = _axis(chart.y), _axis(chart.x)
    of = one._replace(statistic=name, unit=unit, against=across)
    for s in chart.series:
        method = next((m for label, m in methods.items() if s.label == label), "")
        line = of._replace(method=method, variation=s.label)
        for x, y in zip(s.x.tolist(), s.y.tolist(), strict=True):
            yield line._replace(at=by * x, value=factor * y)
    for label, y in chart.levels:
        yield of._replace(variation=label, value=factor * y)


def _axis(text: str) -> tuple[str, str, float]:
    """Name, SI unit and SI units in one of a heading or an axis such as "force / mN"."""
    name, _, unit = text.rpartition(" / ")
    factor, si = si_of(unit.strip("()")) if name else (1.0, "1")
    return name or text, si, factor


# --- as results.json has them ---------------------------------------------------------------------


def exhibits(found: tuple[Exhibit, ...]) -> list[Json]:
    """Every exhibit; chart series share `_ALL_POINTS`, their whole arrays are in tables/."""
    count = sum(len(c.series) for e in found for c in e.charts)
    most = max(_FEWEST, min(_POINTS, _ALL_POINTS // max(1, count)))
    return [
        {
            "anchor": e.anchor,
            "title": e.title,
            "words": list(e.words),
            "tables": [_table(t) for t in e.tables],
            "charts": [_chart(c, most) for c in e.charts],
            "maps": [_map(m) for m in e.maps],
        }
        for e in found
    ]


def _table(table: NumberTable) -> Json:
    rows = [[recorded(plain(entry)) for entry in row] for row in table.rows]
    return members(table, "name", "title", "headings", "note") | {"rows": rows}


def _chart(chart: Chart, most: int) -> Json:
    return members(chart, "name", "title", "x", "y", "log", "caption") | {
        "levels": [{"name": name, "y": float(y)} for name, y in chart.levels],
        "series": [_series(s, most) for s in chart.series],
    }


def _series(series: Series, most: int) -> Json:
    at = thinned(series.y, most)
    arrays = {"x": rounded(series.x[at]), "y": rounded(series.y[at])}
    if series.upper is not None:
        arrays["upper"] = rounded(series.upper[at])
    return {"label": series.name, "style": series.style, "points": len(series.x), **arrays}


def _map(shown: NodeMap) -> Json:
    v = shown.values
    ends = {"nodes": len(v), "min": float(v.min()), "max": float(v.max())}
    return members(shown, "name", "title", "unit") | ends


def thinned(y: Floats, most: int) -> Ints:
    """Rising indices of at most `most` of y (k,): the smallest and largest of every stretch.

    Peaks are kept, so a thinned series still touches the extremes of the whole one.
    """
    if len(y) <= most:
        return np.arange(len(y))
    edges = np.linspace(0, len(y), most // 2 + 1).astype(np.int64)
    parts = [(a, y[a:b]) for a, b in pairwise(edges.tolist())]
    return np.unique([a + i for a, part in parts for i in (part.argmin(), part.argmax())])


def rounded(values: Floats) -> list[float]:
    """Return the numbers to seven significant digits, which a file of text writes short."""
    return [float(f"{v:.{_DIGITS}g}") for v in values.tolist()]
