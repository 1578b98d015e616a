"""Tables of scores: methods side by side, every score by load, identified and printed figures."""

import re

from validate.compare.published import Published
from validate.compare.result import MethodResult, Result
from validate.compare.score import Score
from validate.report.numbers import at_load, duration, rate, shown_unit, spaced, text
from validate.report.observed import timed
from validate.report.page import Cell, Items, Mark, Section, Table, cells, section

_COSTS = ("setup", "step.p50", "step.p99", "updates.max")
_COLUMNS = 12  # errors side by side that a page shows without scrolling far
_OVER_TIME = re.compile(r"^[^@]*\.n?rmse$").match
_MARKS: dict[str, Mark] = {
    "reproduced": "good",
    "not reproduced": "bad",
    "not reproducible as printed": "open",
    "not comparable": "open",
}


def side_by_side(result: Result) -> Section | None:
    """How each method ended, what it cost and its errors, at the last load or over time."""
    cost = Table(
        "How each method ended and what it cost. Rate: 1 over the median time of one step; set-up: "
        "what is done once (mesh, assembly, factorisation). Times are of this machine.",
        ("method", "name", "ended", "rate", "p99 of a step", "updates", "set-up"),
        tuple(_cost_row(m) for m in result.methods),
        words=(0, 1, 2),
    )
    return section("methods", "Models side by side", cost, _at_last(result), _tracked(result))


def _at_last(result: Result) -> Table | None:
    """Rms and scalar errors against the recording at the last load of any method."""
    found: dict[str, str] = {}
    for method in result.methods:
        last = {r.quantity: r for r in method.residuals.values()}
        for residual in last.values():
            scalar = residual.values.shape == (1, 1)
            statistic = "" if scalar else ".rms"
            found[f"{residual.quantity}{statistic}@{residual.load}"] = residual.unit
    loads = dict.fromkeys(name.partition("@")[2] for name in found)
    held = ", ".join(spaced(load) for load in loads if load != "all")
    where = [f"at the last load ({held})"] if held else []
    where += [at_load("all")] if "all" in loads else []
    return _errors(result, found, f"against the recording {' and '.join(where)}")


def _tracked(result: Result) -> Table | None:
    """Errors over time at named points against what their scores name."""
    scores = [s for m in result.methods for s in m.scores if _OVER_TIME(s.name)]
    against = " and ".join(dict.fromkeys(s.against for s in scores))
    names = {s.name: s.unit for s in scores}
    return _errors(result, names, f"against the {against} {at_load('all')}")


def _errors(result: Result, found: dict[str, str], where: str) -> Table | None:
    """One row per method, one column per score of that name and SI unit; None without any."""
    if not found:
        return None
    shown = list(found.items())[:_COLUMNS]
    more = f" {len(found) - _COLUMNS} more stand under All scores." if len(found) > _COLUMNS else ""
    heads = (f"{name.partition('@')[0]} / {shown_unit(unit)}" for name, unit in shown)
    return Table(
        f"Errors {where}.{more}",
        ("method", *(h.removesuffix(" / ") for h in heads)),
        tuple(_error_row(m, [name for name, _ in shown]) for m in result.methods),
    )


def _cost_row(method: MethodResult) -> tuple[Cell, ...]:
    times = timed(method.run)
    updates = next((s.value for s in method.scores if s.name == "updates.max"), None)
    end = next((r.outcome for r in method.runs if not r.finished), method.run.outcome)
    ended = "finished" if end.state == "finished" else f"{end.state} at step {end.step}: {end.why}"
    return (
        Cell(method.label + (" (checked)" if method.accepted else ""), "strong"),
        *cells(
            method.name,
            ended,
            rate(times.rate_hz if times else None),
            duration(times.p99 if times else None),
            text(updates),
            duration(method.run.setup_s),
        ),
    )


def _error_row(method: MethodResult, names: list[str]) -> tuple[Cell, ...]:
    values = {s.name: s for s in method.scores}
    errors = [values.get(name) for name in names]
    return Cell(method.label, "strong"), *(Cell(_value(e)) for e in errors)


def scores(result: Result) -> Section | None:
    """Every score of every method, rows quantity and statistic, columns loads; those over time."""
    return section(
        "scores",
        "All scores",
        _over_time(result),
        *(t for m in result.methods if (t := _scores_of(m)) is not None),
    )


def _over_time(result: Result) -> Table | None:
    """Scores without a load, one column per method; what a method cost stands elsewhere."""
    by_name: dict[str, dict[str, Score]] = {}
    for method in result.methods:
        for score in method.scores:
            if "@" not in score.name and score.name not in _COSTS:
                by_name.setdefault(score.name, {})[method.name] = score
    if not by_name:
        return None
    rows = tuple(
        (
            *cells(name, shown_unit(next(iter(found.values())).unit)),
            *(Cell(_value(found.get(m.name))) for m in result.methods),
            Cell(", ".join(dict.fromkeys(str(s.count) for s in found.values()))),
        )
        for name, found in by_name.items()
    )
    return Table(
        "Over the whole run, every method.",
        ("score", "unit", *(m.name for m in result.methods), "values"),
        rows,
        words=(0, 1),
    )


def _scores_of(method: MethodResult) -> Table | None:
    by_name: dict[str, dict[str, Score]] = {}
    for score in method.scores:
        name, at, load = score.name.partition("@")
        if at:
            by_name.setdefault(name, {})[load] = score
    if not by_name:
        return None
    loads = list(dict.fromkeys(load for found in by_name.values() for load in found))
    rows = tuple(
        (
            *cells(name, shown_unit(next(iter(found.values())).unit)),
            *(Cell(_value(found.get(load))) for load in loads),
            Cell(", ".join(dict.fromkeys(str(s.count) for s in found.values()))),
        )
        for name, found in sorted(by_name.items(), key=lambda item: _group(item[0]))
    )
    return Table(
        f"{method.label} ({method.name})",
        ("quantity.statistic", "unit", *(spaced(load) for load in loads), "values"),
        rows,
        words=(0, 1),
        folded=not method.accepted,
    )


def _value(score: Score | None) -> str:
    return text(score.value, score.unit) if score else "–"


def _group(name: str) -> str:
    """Statistics of one quantity stay together, in their order."""
    return re.sub(r"\.(rms|max|mean|bias|simulated|measured)$", "", name)


def identified(result: Result) -> Section | None:
    """What was identified from the recordings, and the experiment's notes."""
    rows = tuple(
        (
            *cells(s.name, text(s.value, s.unit), shown_unit(s.unit), str(s.count)),
            *cells(s.against, s.definition),
        )
        for s in result.identified
    )
    table = Table(
        "Identified from the recordings.",
        ("name", "value", "unit", "values", "against", "definition"),
        rows,
        words=(0, 2, 4, 5),
    )
    return section(
        "identified",
        "Identified parameters and notes",
        table if rows else None,
        Items(result.notes) if result.notes else None,
    )


def published(result: Result) -> Section | None:
    """Printed figures beside ours; None without any (a quick run has none)."""
    if not result.published:
        return None
    table = Table(
        f"Figures printed in {result.source}, beside ours.",
        ("figure", "ours", "theirs", "tolerance", "unit", "verdict", "reason", "place"),
        tuple(_printed(p) for p in result.published),
        words=(0, 4, 5, 6, 7),
    )
    return section("published", "Published figures", table)


def _printed(figure: Published) -> tuple[Cell, ...]:
    values = (text(v, figure.unit) for v in (figure.ours, figure.theirs, figure.tolerance))
    return (
        Cell(figure.name),
        *cells(*values, shown_unit(figure.unit)),
        Cell(figure.verdict, _MARKS[figure.verdict]),
        *cells(figure.reason, figure.source),
    )
