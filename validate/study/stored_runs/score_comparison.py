"""Comparison of stored runs by the scores in their long tables, and its page."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from validate.checksums import read_sealed
from validate.compare.exhibit import Exhibit, NumberTable, Picture
from validate.compare.row import LongRow
from validate.errors import ComparisonError, RecordingError, UsageError
from validate.parameters import nearest_names
from validate.report.export.table_file import stored_table
from validate.report.long_table import LongTable, long_table
from validate.report.stored.folder import MARK
from validate.report.stored.store import SCHEMA_VERSION
from validate.report.views.view_filling import table
from validate.study.loose_page import write_loose

T = TypeVar("T")


@dataclass(frozen=True)
class StoredRun:
    """A run read back: scores by (method, score), parameters (value, unit), recordings' sha256."""

    name: str
    experiment: str
    created: str
    methods: tuple[str, ...]
    scores: Mapping[tuple[str, str], LongRow]
    parameters: Mapping[str, tuple[Any, str]]
    recordings: tuple[str, ...]
    quick: bool
    accepted: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """One score in every column, None where it has none; `changes` are relative to the first."""

    method: str
    score: str
    unit: str
    values: tuple[float | None, ...]

    @property
    def differences(self) -> tuple[float | None, ...]:
        """Less the first value there is."""
        first = next(v for v in self.values if v is not None)
        return tuple(None if v is None else v - first for v in self.values)

    @property
    def changes(self) -> tuple[float | None, ...]:
        """The differences over the first value; None where that is zero."""
        first = next(v for v in self.values if v is not None)
        return tuple(None if d is None or first == 0 else d / abs(first) for d in self.differences)


@dataclass(frozen=True)
class SideBySide:
    """`columns` name what each value is of: runs, or with `by_score` every method of every run.

    `parameters` that differ, of the experiments and of shared methods, by path with a text per run.
    """

    runs: tuple[StoredRun, ...]
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    parameters: Mapping[str, tuple[str, ...]]
    warnings: tuple[str, ...]
    by_score: bool = False


def read_run(path: Path) -> StoredRun:
    """Return a report folder, or its results.json; raises `UsageError` for anything else."""
    return _read(path, _run, "score")


def read_table(path: Path, *parts: str) -> LongTable:
    """Return the table of a run with these parts, or all that is stored; raises as `read_run`."""
    return _read(path, lambda table: table, *parts)


def _read(path: Path, make: Callable[[LongTable], T], *parts: str) -> T:
    file = path / MARK if path.is_dir() else path
    if not file.exists():
        raise UsageError(f"no stored run at {path}; name a report folder or its results.json")
    try:
        if file.name == MARK:
            table = stored_table(file.parent, **({"part": parts} if parts else {}))
        else:
            table = long_table(read_sealed(file), file.parent.resolve().name)
        version = table.head.get("schema_version", SCHEMA_VERSION)
        if version != SCHEMA_VERSION:
            raise RecordingError(
                f"{file}: stored with schema version {version}, today's is {SCHEMA_VERSION} (two "
                "answers a check)"
            )
        return make(table)
    except RecordingError as error:
        from validate.recording.readers import told_apart  # all formats: only where needed

        raise UsageError(told_apart(file) or f"{error}; run it again") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(f"{file} is not a results.json of validate: {error!r:.80}") from error


def side_by_side(runs: Sequence[StoredRun]) -> SideBySide:
    """Scores of methods that share a name; where no method does, of scores that do.

    Raises `UsageError` for fewer than two runs, `ComparisonError` when no score is shared.
    """
    if len(runs) < 2:
        raise UsageError(f"{len(runs)} run to compare; give two or more report folders")
    runs = tuple(runs)
    # The names, numbered where two folders share one
    folders = [r.name for r in runs]
    names = tuple(
        name if folders.count(name) == 1 else f"{name} ({folders[: i + 1].count(name)})"
        for i, name in enumerate(folders)
    )
    # Columns are runs
    keys = dict.fromkeys(k for r in runs for k in r.scores)
    shared = [k for k in keys if sum(k in r.scores for r in runs) >= 2]
    columns, found = names, [(k, [r.scores.get(k) for r in runs]) for k in shared]
    by_score = not found
    if by_score:
        # Columns are methods of runs; a score must be there in two of the runs
        of_runs = [(i, m) for i, r in enumerate(runs) for m in r.methods]
        of_run = [{score for _, score in r.scores} for r in runs]
        scores = dict.fromkeys(score for r in runs for _, score in r.scores)
        twice = [s for s in scores if sum(s in own for own in of_run) >= 2]
        columns = tuple(f"{names[i]}: {m}" for i, m in of_runs)
        found = [(("", s), [runs[i].scores.get((m, s)) for i, m in of_runs]) for s in twice]
    warnings = list(_warnings(runs, names))
    rows = []
    for (method, score), values in found:
        units = {v.unit for v in values if v is not None}
        if len(units) > 1:
            label = f"{method} {score}".strip()
            warnings.append(f"{label} is in {' and in '.join(sorted(units))}: not compared")
        elif sum(v is not None and v.value is not None for v in values) >= 2:
            shown = tuple(None if v is None else v.value for v in values)
            rows.append(Row(method, score, units.pop(), shown))
    if not rows:
        have = "; ".join(
            f"{n} has {len(r.scores)} scores" for n, r in zip(names, runs, strict=True)
        )
        raise ComparisonError(
            f"0 scores shared, nothing compared: {have}" + (f"; {warnings[-1]}" if warnings else "")
        )
    # Parameters whose values differ, or that a run lacks, with every run's value as text. Settings
    # of a method that only one run has are no difference: that run has the method.
    common = {m for r in runs for m in r.methods if sum(m in o.methods for o in runs) >= 2}
    every = dict.fromkeys(p for r in runs for p in r.parameters)
    paths = [p for p in every if not p.startswith("methods.") or p.split(".")[1] in common]
    texts = {p: tuple(_shown(r.parameters.get(p)) for r in runs) for p in paths}
    differing = {p: of_runs for p, of_runs in texts.items() if len(set(of_runs)) > 1}
    return SideBySide(runs, columns, tuple(rows), differing, tuple(warnings), by_score)


Found = list[tuple[tuple[str, str], list[LongRow | None]]]


def _warnings(runs: tuple[StoredRun, ...], names: tuple[str, ...]) -> list[str]:
    found = []
    if len({r.experiment for r in runs}) > 1:
        found.append(f"different experiments: {', '.join(r.experiment for r in runs)}")
    if len({r.recordings for r in runs}) > 1:
        marks = (", ".join(s[:12] or "made in memory" for s in r.recordings) for r in runs)
        pairs = "; ".join(f"{n} {m or 'none'}" for n, m in zip(names, marks, strict=True))
        found.append(f"different recordings (sha256): {pairs}")
    quick = [n for n, r in zip(names, runs, strict=True) if r.quick]
    if quick:
        found.append(f"quick runs, not to be quoted: {', '.join(quick)}")
    for path in dict.fromkeys(p for r in runs for p in r.parameters):
        units = {r.parameters[path][1] for r in runs if path in r.parameters}
        if len(units) > 1:
            found.append(f"parameter {path} is in {' and in '.join(sorted(units))}")
    return found


def _shown(parameter: tuple[Any, str] | None) -> str:
    if parameter is None:
        return "–"
    value, unit = parameter
    text = f"{value:.10g}" if isinstance(value, float) else str(value)
    return text if unit == "1" else f"{text} {unit}"


def _run(table: LongTable) -> StoredRun:
    head, methods = table.head, table.head["methods"]
    run = table.rows[0].run if table.rows else str(head["experiment"])
    return StoredRun(
        run,
        str(head["experiment"]),
        str(head["created"]),
        tuple(str(m["name"]) for m in methods),
        {(row.method, row.name): row for row in table.where(part="score").rows},
        {k: (v["value"], v["unit"]) for k, v in head["parameters"].items()},
        tuple(str(i["sha256"]) for i in head["inputs"]),
        bool(head.get("quick", False)),
        tuple(str(m["name"]) for m in methods if m.get("accepted")),
    )


# --- two by two, as a terminal has room for ------------------------------------------------------

MOST = 2  # pairs of methods shown where no method is shared: there are as many as m1 * m2


@dataclass(frozen=True)
class Pair:
    """Two columns of a comparison, with the rows (two values each) that both have."""

    one: str
    other: str
    rows: tuple[Row, ...]


def pairs(found: SideBySide, *, every: bool = False) -> tuple[tuple[Pair, ...], int, int]:
    """Return the pairs to show, how many more there are, and how many rows of `found` none of them
    has.

    Runs that share methods: the first against every other. Else their methods: accepted ones first,
    the first of one run against the first of the other, at most `MOST` unless `every` is asked for.
    """
    rows = [(one, other, _rows(found, one, other)) for one, other in _columns(found)]
    kept = [pair for pair in rows if pair[2]]
    shown = kept[:MOST] if found.by_score and not every else kept
    names = found.columns
    seen = {(r.method, r.score) for _, _, mine in shown for r in mine}
    made = tuple(Pair(names[i], names[j], mine) for i, j, mine in shown)
    return made, len(kept) - len(shown), len(found.rows) - len(seen)


def _rows(found: SideBySide, one: int, other: int) -> tuple[Row, ...]:
    rows = [(r, (r.values[one], r.values[other])) for r in found.rows]
    return tuple(Row(r.method, r.score, r.unit, pair) for r, pair in rows if None not in pair)


def _columns(found: SideBySide) -> Iterator[tuple[int, int]]:
    """Indices of two columns each, of the first run and of a later one."""
    if not found.by_score:
        yield from ((0, j) for j in range(1, len(found.runs)))
        return
    starts = [sum(len(r.methods) for r in found.runs[:i]) for i in range(len(found.runs))]
    # Places of the methods, accepted ones first
    first, *others = (
        sorted(range(len(r.methods)), key=lambda i: r.methods[i] not in r.accepted)
        for r in found.runs
    )
    for start, other in zip(starts[1:], others, strict=True):
        ranks = product(range(len(first)), range(len(other)))
        for i, j in sorted(ranks, key=lambda ij: (abs(ij[0] - ij[1]), ij)):
            yield first[i], start + other[j]


# --- A comparison of stored runs cut down to what is asked for, and put in order.

_TIMES = ("setup", "step.")  # scores that differ from run to run whatever was changed


def narrowed(
    runs: Sequence[StoredRun], methods: Sequence[str] = (), scores: Sequence[str] = ()
) -> tuple[StoredRun, ...]:
    """Return the runs with the methods and scores that any of the patterns (`kf_*`) fits; none:
    all.

    Raises `UsageError` for a pattern that fits nothing in any run.
    """
    _require_fitting("--method", methods, {m for r in runs for m in r.methods})
    _require_fitting("--score", scores, {score for r in runs for _, score in r.scores})
    return tuple(
        replace(
            r,
            methods=tuple(m for m in r.methods if _fits(m, methods)),
            scores={k: v for k, v in r.scores.items()
                    if _fits(k[0], methods) and _fits(k[1], scores)},
        )
        for r in runs
    )  # fmt: skip


def _require_fitting(option: str, patterns: Sequence[str], names: set[str]) -> None:
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            hint = nearest_names(pattern, names)
            raise UsageError(f"{option} {pattern} matches none of {len(names)} names; {hint}")


def _fits(name: str, patterns: Sequence[str]) -> bool:
    return not patterns or any(fnmatchcase(name, p) for p in patterns)


def _largest(values: Iterable[float | None]) -> float:
    return max((abs(v) for v in values if v is not None), default=0.0)


def _by_change(row: Row) -> tuple[bool, float]:
    """The largest first, from nothing to something before all; times last."""
    apart, relative = _largest(row.differences), _largest(row.changes)
    from_nothing = apart > 0 and relative == 0
    return row.score.startswith(_TIMES), -math.inf if from_nothing else -relative


SORTS: Mapping[str, Callable[[Row], Any]] = MappingProxyType(
    {
        "change": _by_change,
        "difference": lambda row: (row.unit, -_largest(row.differences)),
        "score": lambda row: (row.score, row.method),
        "method": lambda row: (row.method, row.score),
        "stored": lambda row: 0,
    }
)


def ordered(found: SideBySide, sort: str) -> SideBySide:
    """Its rows by one of `SORTS`; equal ones stay as they were stored."""
    return replace(found, rows=tuple(sorted(found.rows, key=SORTS[sort])))


_PICTURES = 6  # pairs that are drawn
_DRAWN = 40  # scores of a picture


def write_comparison(found: SideBySide, document: dict[str, Any], folder: Path) -> Path:
    """Replace `folder`; returns the path of report.html. Raises what `replace_folder` does."""
    told = (
        " and ".join(dict.fromkeys(r.experiment for r in found.runs)),
        "Stored runs side by side",
        "; ".join(f"{r.name} ({r.created})" for r in found.runs),
        f"{len(found.rows)} scores of {len(found.runs)} runs, nothing was run again.",
    )
    exhibits = comparison_exhibits(found)
    return write_loose(told, exhibits, document, folder, "Comparison", found.warnings)


def comparison_exhibits(found: SideBySide) -> tuple[Exhibit, ...]:
    """Return pairs with their changes, the parameters that differ, and all scores as data."""
    shown, _, _ = pairs(found)
    drawn = (_pair(i, p) for i, p in enumerate(shown, 1))
    names = tuple(f"{r.name} {r.created}" for r in found.runs)
    rows = tuple((path, *values) for path, values in found.parameters.items())
    note = "" if rows else "None differs."
    differing = NumberTable(
        "parameters", "Parameters that differ, SI.", ("path", *names), rows, note
    )
    # Every score in every column, for the files
    values = {column: f"values.{i}" for i, column in enumerate(found.columns)}
    columns = {"method": "method", "score": "score", "unit": "unit", **values}
    return (
        *drawn,
        Exhibit("parameters", "Parameters", (), (differing,)),
        Exhibit("scores", "Scores", data=(table("scores", "Scores, SI.", found.rows, columns),)),
    )


_PAIR = {
    "method": "method", "score": "score", "one": "values.0", "other": "values.1",
    "difference": "differences.1", "change / %": "changes.1", "unit": "unit",
}  # fmt: skip


def _pair(number: int, pair: Pair) -> Exhibit:
    scores = table(f"pair_{number}", "Scores that both have, SI.", pair.rows, _PAIR)
    pictures: tuple[Picture, ...] = ()
    changed = [(f"{r.method}: {r.score}" if r.method else r.score, r.changes[1]) for r in pair.rows]
    drawn = [(name, c) for name, c in changed if c is not None][:_DRAWN]
    if drawn and number <= _PICTURES:
        from validate.report.charts.changes import picture

        labels, changes = zip(*drawn, strict=True)
        title = f"From {pair.one} to {pair.other}"
        pictures = (picture(f"changes_{number}", title, labels, changes),)
    return Exhibit(f"pair-{number}", f"{pair.one}, then {pair.other}", (), (scores,),
                   pictures=pictures)  # fmt: skip
