"""Tables of scores: methods side by side, every score by load, identified and printed figures."""

import re
from collections.abc import Iterable, Mapping

from validate.compare.exhibit import Emphasis, Entry, Exhibit, NumberTable, TableCell
from validate.compare.published import Published
from validate.compare.residual import Residual
from validate.compare.result import MethodResult, Result
from validate.compare.score import Score
from validate.identify.budget import IdentifiedValue
from validate.report.numbers import at_load, duration, rate, shown_unit, spaced, with_unit
from validate.report.observed import timed
from validate.report.tables import unit_cell

_COSTS = ("setup", "step.p50", "step.p99", "updates.max")
_COLUMNS = 12  # errors side by side that a page shows without scrolling far
_OVER_TIME = re.compile(r"^[^@]*\.n?rmse$").match
_PRINTED: dict[str, Emphasis] = {
    "reproduced": "good",
    "not reproduced": "bad",
    "not reproducible as printed": "open",
    "not comparable": "open",
    "moved": "bad",
    "not computed": "bad",
    "other data": "open",
}
_SCORE = ("name", "value", "unit", "count", "against", "definition")
_RESIDUAL = ("method", "quantity", "load", "point", "a", "b", "c", "length", "sd", "unit")
_PUBLISHED = (
    "figure", "ours", "expected", "theirs", "tolerance", "unit", "verdict", "reason", "source",
)  # fmt: skip
Found = Mapping[str, Mapping[str, Score]]  # by row, then by column


# --- methods side by side ------------------------------------------------------------------------


def methods(result: Result) -> Exhibit:
    """How each method ended, what it cost and its errors, at the last load or over time."""
    cost = NumberTable(
        "",
        "How each method ended, and its cost. Rate: 1 over the median time of one step; set-up: "
        "done once (mesh, assembly, factorisation). Times hold for this machine.",
        ("method", "name", "ended", "rate", "p99 of a step", "updates", "set-up"),
        tuple(_cost_row(m) for m in result.methods),
    )
    tables = (cost, *_at_last(result), *_tracked(result))
    return Exhibit("methods", "Models side by side", (), tables)


def _cost_row(method: MethodResult) -> tuple[Entry | TableCell, ...]:
    times, setup = timed(method.run), method.run.setup_s
    steps, slow = (times.rate_hz, times.p99) if times else (None, None)
    updates = next((s.value for s in method.scores if s.name == "updates.max"), None)
    end = next((r.outcome for r in method.runs if not r.finished), method.run.outcome)
    ended = "finished" if end.state == "finished" else f"{end.state} at step {end.step}: {end.why}"
    return (
        TableCell(method.called + (" (checked)" if method.accepted else ""), emphasis="strong"),
        method.name,
        ended,
        TableCell(steps, text=rate(steps)),
        TableCell(slow, text=duration(slow)),
        TableCell(updates, "1"),
        TableCell(setup, text=duration(setup)),
    )


def _at_last(result: Result) -> tuple[NumberTable, ...]:
    """Rms and scalar errors against the recording at the last load of any method."""
    found: dict[str, str] = {}
    for method in result.methods:
        last = {r.quantity: r for r in method.residuals.values()}
        found |= {_error_name(r): r.unit for r in last.values()}
    loads = dict.fromkeys(name.partition("@")[2] for name in found)
    held = ", ".join(spaced(load) for load in loads if load != "all")
    where = [f"at the last load ({held})"] if held else []
    where += [at_load("all")] if "all" in loads else []
    return _errors(result, found, f"against the recording {' and '.join(where)}")


def _error_name(residual: Residual) -> str:
    statistic = "" if residual.values.shape == (1, 1) else ".rms"
    return f"{residual.quantity}{statistic}@{residual.load}"


def _tracked(result: Result) -> tuple[NumberTable, ...]:
    """Errors over time at named points against what their scores name."""
    scores = [s for m in result.methods for s in m.scores if _OVER_TIME(s.name)]
    against = " and ".join(dict.fromkeys(s.against for s in scores))
    names = {s.name: s.unit for s in scores}
    return _errors(result, names, f"against the {against} {at_load('all')}")


def _errors(result: Result, found: dict[str, str], where: str) -> tuple[NumberTable, ...]:
    """One row per method, one column per score of that name and SI unit; none without any."""
    if not found:
        return ()
    shown = list(found)[:_COLUMNS]
    left = len(found) - _COLUMNS
    more = f" All scores lists {left} more." if left > 0 else ""
    heads = (f"{n.partition('@')[0]} / {shown_unit(found[n])}".removesuffix(" / ") for n in shown)
    rows = tuple(_error_row(m, shown) for m in result.methods)
    return (NumberTable("", f"Errors {where}.{more}", ("method", *heads), rows),)


def _error_row(method: MethodResult, names: list[str]) -> tuple[TableCell | None, ...]:
    values = {s.name: s for s in method.scores}
    return TableCell(method.label, emphasis="strong"), *(_value(values.get(n)) for n in names)


def _value(score: Score | None) -> TableCell | None:
    return TableCell(float(score.value), score.unit) if score else None


# --- every score ---------------------------------------------------------------------------------


def scores(result: Result) -> Exhibit:
    """Every score of every method, rows quantity and statistic, columns loads; those over time."""
    tables = (*_over_time(result), *(t for m in result.methods for t in _of_method(m)))
    return Exhibit("scores", "All scores", (), tables, data=(_scores(result), _residuals(result)))


def _over_time(result: Result) -> tuple[NumberTable, ...]:
    """Scores without a load, one column per method; what a method cost stands elsewhere."""
    by_name: dict[str, dict[str, Score]] = {}
    for method in result.methods:
        for score in method.scores:
            if "@" not in score.name and score.name not in _COSTS:
                by_name.setdefault(score.name, {})[method.name] = score
    columns = {m.name: m.name for m in result.methods}
    return _by_column("Over the whole run, every method.", "score", columns, by_name)


def _of_method(method: MethodResult) -> tuple[NumberTable, ...]:
    by_name: dict[str, dict[str, Score]] = {}
    for score in sorted(method.scores, key=lambda s: _group(s.name.partition("@")[0])):
        name, at, load = score.name.partition("@")
        if at:
            by_name.setdefault(name, {})[load] = score
    loads = dict.fromkeys(s.name.partition("@")[2] for s in method.scores if "@" in s.name)
    columns = {load: spaced(load) for load in loads}
    title = f"{method.label} ({method.name})"
    return _by_column(title, "quantity.statistic", columns, by_name, folded=not method.accepted)


def _by_column(
    title: str, head: str, columns: Mapping[str, str], found: Found, *, folded: bool = False
) -> tuple[NumberTable, ...]:
    """One row a name with its unit, its values under the columns' texts, and counts."""
    rows = tuple(
        (name, shown_unit(next(iter(own.values())).unit), *(_value(own.get(c)) for c in columns),
         _counts(own.values()))
        for name, own in found.items()
    )  # fmt: skip
    heads = (head, "unit", *columns.values(), "values")
    return (NumberTable("", title, heads, rows, folded=folded),) if rows else ()


def _counts(found: Iterable[Score]) -> TableCell:
    counts = list(dict.fromkeys(s.count for s in found))
    return TableCell(counts[0], text=", ".join(map(str, counts)))


def _group(name: str) -> str:
    """Statistics of one quantity stay together, in their order."""
    return re.sub(r"\.(rms|max|mean|bias|simulated|measured)$", "", name)


def _scores(result: Result) -> NumberTable:
    rows = tuple((m.name, *_score_row(s)) for m in result.methods for s in m.scores)
    return NumberTable("scores", "Scores", ("method", "score", *_SCORE[1:]), rows)


def _score_row(s: Score) -> tuple[Entry | TableCell, ...]:
    return s.name, TableCell(s.value, s.unit), unit_cell(s.unit), s.count, s.against, s.definition


def _residuals(result: Result) -> NumberTable:
    """Every compared point: its components and their length."""
    rows = tuple(
        (m.name, r.quantity, r.load, i, *(*point, None, None)[:3], sum(v * v for v in point) ** 0.5,
         TableCell(r.sd), r.unit)
        for m in result.methods
        for r in m.residuals.values()
        for i, point in enumerate(r.values.tolist())
    )  # fmt: skip
    return NumberTable("residuals", "Residuals", _RESIDUAL, rows)


# --- identified and printed figures --------------------------------------------------------------


def identified(result: Result) -> Exhibit:
    """What was identified from the recordings, and the experiment's notes."""
    named = {v.name for v in result.identified_values}
    rows = tuple(_score_row(s) for s in result.identified if s.name not in named)
    table = NumberTable("identified", "Identified from the recordings.", _SCORE, rows)
    title = "Identified parameters and notes"
    budgets = (_budget(result.identified_values),) if result.identified_values else ()
    words = tuple(
        f"{v.name} by {v.by}: {v.finding}." for v in result.identified_values if v.finding
    )
    return Exhibit(
        "identified", title, (*words, *result.notes), (*budgets, *((table,) if rows else ()))
    )


def _budget(values: tuple[IdentifiedValue, ...]) -> NumberTable:
    """One row a value: value, 95 % interval, and its standard uncertainties, one column a term."""
    terms = tuple(dict.fromkeys(name for v in values for name in v.parts))
    head = ("parameter", "identified by", "value", "95 % from", "to", "u", *terms, "n")
    rows = []
    for v in values:
        numbers = (v.value, *v.interval, v.u)
        parts = tuple(TableCell(v.parts[n], v.unit) if n in v.parts else None for n in terms)
        cells = (TableCell(x, v.unit, with_unit(x, v.unit, 4)) for x in numbers)
        rows.append((v.name, v.by, *cells, *parts, v.count))
    words = "Identified values and their uncertainty budgets: standard uncertainties, one per term."
    return NumberTable("identified_values", words, head, tuple(rows))


def published(result: Result) -> Exhibit | None:
    """Printed results beside ours, settings and pictures folded below; None without any (a quick
    run has none)."""
    if not result.published:
        return None
    groups = [
        (NumberTable("published", f"Results printed in {result.source}, and ours.", _PUBLISHED,
                     tuple(_printed(p) for p in result.published if p.result))),
        (NumberTable("published_settings", "Settings, sketches and citations of the source. They "
                                           "are not results and are not counted as "
                                           "figures.", _PUBLISHED,
                     tuple(_printed(p) for p in result.published if not p.result), folded=True)),
    ]  # fmt: skip
    tables = tuple(table for table in groups if table.rows)
    return Exhibit("published", "Published figures", (), tables)


def _printed(figure: Published) -> tuple[Entry | TableCell, ...]:
    return (
        figure.name,
        *(
            TableCell(v, figure.unit)
            for v in (figure.ours, figure.expected, figure.theirs, figure.tolerance)
        ),
        unit_cell(figure.unit),
        TableCell(figure.line, emphasis="bad" if figure.fault else _PRINTED[figure.verdict]),
        figure.why,
        figure.source,
    )
