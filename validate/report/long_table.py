"""Long table of a run: every number of its results as one labelled row.

1. A run is one document (the content of results.json) and its residuals, point by point.
2. `long_table` alone makes rows of them: results.json and the table never disagree.
3. A row is a number with its labels: what it is of, where, by which method, against what.
4. `part` says what a row is: score, check (with check.u_D, check.limit, ...), point, effect, ...
5. Texts that are no numbers (sentence, parameters, files) are the table's `head`.
6. `results.parquet`, or `results.csv.gz` without pyarrow, holds both under one checksum.
7. Points and samples come last: a query without them stops before them.
8. A run stored before there was a table gets the same rows from its results.json.
9. `StoredTables.where` only adds conditions; runs are read one at a time when rows are asked for.
10. compare, history and summary are such queries; scores.csv, residuals.csv, effects.csv are gone.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from validate.compare.bias import kind_of
from validate.compare.residual import Residual
from validate.compare.row import (
    POINT,
    SAMPLE,
    TRACE,
    LongRow,
    RowBlock,
    Wanted,
    at_of,
    named,
    require_columns,
    selects,
)
from validate.errors import UsageError
from validate.installation import install_command
from validate.report.stored.json_values import Json

if TYPE_CHECKING:
    from pandas import DataFrame

_CHECK = ("u_D", "u_num", "u_input", "limit", "margin", "raw", "noise")  # rows "check.u_D", ...
_TEXTS = {"limit": "requirement", "u_num": "numerical"}  # notes of these
_PRINTED = ("ours", "theirs", "tolerance", "expected", "drift")
_HEAD = (
    "schema_version", "experiment", "title", "source", "created", "sentence", "passed", "quick",
    "kind", "overall", "expected", "moved", "seed", "warnings", "inputs", "parameters", "changed",
    "made", "domain", "environment", "views",
)  # fmt: skip
_METHOD = ("name", "label", "chosen", "accepted", "outcome")
Points = Mapping[str, Mapping[str, Residual]]  # residuals by method and name


class MethodHead(NamedTuple):
    """A method of a run: its name, what figures call it, and whether it is checked."""

    name: str
    label: str
    accepted: bool


@dataclass(frozen=True)
class LongTable:
    """The rows of one run, and its `head`: what results.json says besides numbers."""

    head: Json
    rows: tuple[LongRow, ...]

    @property
    def of_run(self) -> bool:
        """Whether it is of a run: a study, a comparison or a summary has no kind of truth."""
        return "kind" in self.head and bool(self.head["methods"])

    @cached_property
    def methods(self) -> tuple[MethodHead, ...]:
        """The methods of the run, in its order."""
        found = (m for m in self.head.get("methods", ()))
        return tuple(
            MethodHead(m["name"], str(m.get("label", m["name"])), bool(m.get("accepted", False)))
            for m in found
        )

    def where(self, **labels: Wanted) -> "LongTable":
        """Return the rows whose columns fit: a text (with * and ?, behind ! refused), a number, or
        several of them.

        Raises `UsageError` for an unknown column.
        """
        require_columns(labels, LongRow._fields)
        of_part = selects(labels.get("part", "*"))
        places = sorted(i for part, own in self._places.items() if of_part(part) for i in own)
        fits = [(LongRow._fields.index(name), selects(wanted))
                for name, wanted in labels.items() if name != "part"]  # fmt: skip
        found = (self.rows[i] for i in places)
        return replace(self, rows=tuple(r for r in found if all(fit(r[i]) for i, fit in fits)))

    @cached_property
    def _places(self) -> dict[str, list[int]]:
        """Where the rows of each part are: most queries want few of many parts."""
        found: dict[str, list[int]] = {}
        for i, row in enumerate(self.rows):
            found.setdefault(row.part, []).append(i)
        return found

    def to_pandas(self) -> "DataFrame":
        """Return the rows as a DataFrame; raises `UsageError` where pandas is not installed."""
        return frame(self.rows)


def frame(rows: Iterable[tuple[Any, ...]], columns: Sequence[str] = LongRow._fields) -> "DataFrame":
    """Return rows as a DataFrame with these columns; raises as `LongTable.to_pandas`."""
    try:
        from pandas import DataFrame
    except ImportError:
        raise UsageError(
            f"a DataFrame needs pandas, which is not installed: {install_command('tables')}"
        ) from None
    return DataFrame.from_records(list(rows), columns=columns)


# --- rows of a run --------------------------------------------------------------------------------


def long_table(
    content: Json, run: str, residuals: Points | None = None, blocks: Iterable[RowBlock] = ()
) -> LongTable:
    """Return the table of a run from the content of its results.json, its residuals and `blocks`
    of further rows, which get its labels.

    Raises `KeyError` or `TypeError` for what is no results.json of a run.
    """
    found = residuals or {}
    names = dict.fromkeys(str(d["recording"]) for d in content.get("domain", ()))
    experiment, recording = (
        str(content["experiment"]),
        ("all" if len(names) > 1 else next(iter(names), "")),
    )
    one = LongRow(run, experiment, recording, variation=_variation(content))
    rows: list[LongRow] = []
    for method in content["methods"]:
        name = str(method["name"])
        of = one._replace(method=name)
        roles = {key: r.role for key, r in found.get(name, {}).items()}
        rows += [row for s in method.get("scores", ()) for row in _score(of, s, roles)]
        rows += [row for c in method.get("checks", ()) for row in _check(of, c)]
        rows += _ended(of, method)
    noisy = {r.name for own in found.values() for r in own.values() if r.sd > 0}
    rows += _others(one, content, noisy)
    for name, by_name in found.items():
        for residual in by_name.values():
            rows += _points(one._replace(method=name), residual)
    for block in blocks:
        own = block.row._replace(
            run=run, experiment=experiment, recording=block.row.recording or recording,
            part=block.row.part or SAMPLE,
        )  # fmt: skip
        rows += replace(block, row=own).rows()
    methods = [{k: m[k] for k in _METHOD if k in m} for m in content["methods"]]
    figures = [{k: v for k, v in p.items() if k not in _PRINTED}
               for p in content.get("published", ())]  # fmt: skip
    head = {k: content[k] for k in _HEAD if k in content}
    return LongTable({**head, "methods": methods, "published": figures}, tuple(rows))


def traces_of(content: Json, run: str) -> Iterator[LongRow]:
    """Each trace of every method over time, as results.json has it; runs/ has every step.

    Raises as `long_table`.
    """
    one = LongRow(run, str(content["experiment"]), part=TRACE, variation=_variation(content))
    first = next((str(d["recording"]) for d in content.get("domain", ())), "")
    for method in content["methods"]:
        for made in (method, *method.get("further_runs", ())):
            of = one._replace(method=str(method["name"]), recording=made.get("recording", first))
            for name, trace in made.get("traces", {}).items():
                row = named(of, name, trace["unit"])
                block = (a for a in zip(made["t"], trace["y"], strict=True) if None not in a)
                yield from (row._replace(at=at, value=value) for at, value in block)


def _variation(content: Json) -> str:
    return "; ".join(f"{c['path']}={c['value']}" for c in content.get("changed", ()))


def _score(one: LongRow, s: Json, roles: Mapping[str, str]) -> Iterator[LongRow]:
    row = named(one._replace(part="score"), str(s["name"]), str(s["unit"]))
    yield row._replace(
        value=s["value"], n=s["count"], against=s.get("against", ""),
        role=roles.get(f"{row.quantity}@{row.condition}", ""), note=s.get("definition", ""),
    )  # fmt: skip
    if "why" in s:
        yield row._replace(part="score.why", note=s["why"])


def _check(one: LongRow, c: Json) -> Iterator[LongRow]:
    """E with u_val and both answers; its other numbers as rows of the same labels."""
    row = named(one, str(c["name"]), str(c["unit"]))
    row = row._replace(kind=c.get("kind", row.kind), n=c["count"])
    yield row._replace(
        part="check", value=c["value"], sd=c["u_val"], validation=c.get("validation", ""),
        acceptance=str(c.get("acceptance", c["verdict"])), note=c.get("why", ""),
    )  # fmt: skip
    size = {f"size.{key}": value for key, value in (c.get("size") or {}).items()}
    for key, value in ({key: c.get(key) for key in _CHECK} | size).items():
        note = c.get(_TEXTS.get(key, ""), "")
        if value is not None or note:
            yield row._replace(part=f"check.{key}", value=value, note=note)


def _ended(one: LongRow, method: Json) -> Iterator[LongRow]:
    """How a method ended, at which step, and its rate."""
    end = method.get("outcome")
    if end:
        state, step = end["state"], end["step"]
        ended = state if state == "finished" else f"{state} at step {step}: {end['why']}"
        role = "checked" if method.get("accepted") else "candidate"
        yield one._replace(part="outcome", quantity="outcome", n=step, role=role, note=ended)
    if method.get("chosen"):
        yield one._replace(part="chosen", quantity="outcome", note=method["chosen"])
    if method.get("rate_hz") is not None:
        yield one._replace(part="rate", quantity="rate", value=method["rate_hz"], unit="Hz")


def _others(one: LongRow, content: Json, noisy: set[str]) -> Iterator[LongRow]:
    """Identified values, effects, printed figures, and errors of the undeformed state; `noisy` are
    the residuals of what a sensor measured."""
    for i in content.get("identified", ()):
        row = named(one._replace(part="identified"), i["name"], i["unit"])
        row = row._replace(n=i["count"], against=i["against"], note=i["definition"])
        yield row._replace(value=i["value"], sd=i.get("u"))
        ends = dict(zip(("low", "high"), i.get("interval", ()), strict=False))
        for key, value in (ends | {f"u.{k}": u for k, u in i.get("parts", {}).items()}).items():
            yield row._replace(part=f"identified.{key}", value=value)
    for e in content.get("effects", ()):
        of = one._replace(part="effect", variation=str(e["name"]), note=e["doc"])
        for c in e["changes"]:
            row = named(of, c["name"], c["unit"])
            row = row._replace(role="measured" if c["name"] in noisy else "")
            for key, unit in (("rms", c["unit"]), ("max", c["unit"]), ("separation", "1")):
                yield row._replace(statistic=key, value=c[key], unit=unit)
    for i, p in enumerate(content.get("published", ())):
        of = one._replace(
            quantity=p["name"], unit=p["unit"], against=p["source"], point=i,
            role="result" if p.get("result", True) else "setting",
        )  # fmt: skip
        window = f" (within {p['window']})" if p.get("window") else ""
        yield of._replace(part="published", value=p["ours"], note=p["verdict"] + window)
        yield of._replace(part="published.reason", note=p.get("reason", ""))
        for key in _PRINTED[1:]:
            if p[key] is not None:
                yield of._replace(part=f"published.{key}", value=p[key])
    for r in content.get("rest", ()):
        row = named(one._replace(part="rest"), r["name"], r["unit"])
        yield row._replace(statistic="rms", value=r["rms"], sd=r["sd"], n=r["count"])


def _points(one: LongRow, residual: Residual) -> Iterator[LongRow]:
    """Simulated less measured, every component of every compared point."""
    row = one._replace(
        part=POINT, quantity=residual.quantity, condition=residual.load, at=at_of(residual.load),
        unit=residual.unit, kind=kind_of(residual.quantity, residual.unit),
        sd=float(residual.sd) if math.isfinite(residual.sd) else None, role=residual.role,
    )  # fmt: skip
    count = residual.values.shape[1]
    names = residual.axes or [str(i) for i in range(1, count + 1)]
    axes = [row._replace(axis=name) for name in names]
    times = [row.at] * residual.count if residual.t is None else residual.t.tolist()
    for point, (at, values) in enumerate(zip(times, residual.values.tolist(), strict=True)):
        for of, value in zip(axes, values, strict=True):
            yield of._replace(point=point, at=at, value=value)


# --- results.json from the rows -------------------------------------------------------------------


def content_of(table: LongTable) -> Json:
    """Return scores, checks, printed figures and the head of a table as results.json has them.

    What `where` left out is missing. Raises `KeyError` for a folder of something else.
    """
    checks = list(checks_of(table.rows))
    scores = list(_scores_of(table.rows))
    methods = [
        {**m, "scores": [_without(s) for s in scores if s["method"] == m["name"]],
         "checks": [_without(c) for c in checks if c["method"] == m["name"]]}
        for m in table.head["methods"]
    ]  # fmt: skip
    figures: list[Json] = [p | dict.fromkeys(_PRINTED) for p in table.head.get("published", ())]
    for row in table.where(part="published*").rows:
        key = row.part.removeprefix("published").removeprefix(".") or "ours"
        if key in _PRINTED:
            figures[row.point or 0][key] = row.value
    return {**table.head, "methods": methods, "published": figures}


def _without(member: Json) -> Json:
    return {key: value for key, value in member.items() if key != "method"}


def checks_of(rows: Iterable[LongRow]) -> Iterator[Json]:
    """Every check of a table, with its method, as results.json has it."""
    check: dict[str, Any] = {}
    for row in rows:
        key = row.part.removeprefix("check.")
        if row.part == "check":
            if check:
                yield _completed(check)
            check = {
                "method": row.method, "name": row.name, "value": row.value, "u_val": row.sd,
                "unit": row.unit, "count": row.n, "kind": row.kind, "why": row.note,
                "validation": row.validation, "acceptance": row.acceptance, "size": {},
                **dict.fromkeys(_CHECK), **dict.fromkeys(_TEXTS.values(), ""),
            }  # fmt: skip
        elif key.startswith("size."):
            check["size"][key.removeprefix("size.")] = row.value
        elif row.part.startswith("check."):
            check[key] = row.value
            check |= {_TEXTS[key]: row.note} if key in _TEXTS else {}
    if check:
        yield _completed(check)


def _completed(check: Json) -> Json:
    """The check with what follows from its numbers and answers."""
    decides = "validation" if check["acceptance"] == "no requirement" else "acceptance"
    return check | {"verdict": check[decides], "size": check["size"] or None}


def _scores_of(rows: Iterable[LongRow]) -> Iterator[Json]:
    score: Json = {}
    for row in rows:
        if row.part == "score.why":
            score["why"] = row.note
        elif row.part == "score":
            if score:
                yield score
            score = {
                "method": row.method, "name": row.name, "value": row.value, "unit": row.unit,
                "count": row.n, "against": row.against, "definition": row.note,
            }  # fmt: skip
    if score:
        yield score
