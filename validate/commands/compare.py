"""`validate compare`: stored runs side by side."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from validate.commands.arguments import complain
from validate.commands.display import relative, say
from validate.commands.screen import LINES, sentences
from validate.errors import UsageError
from validate.library.comparison import scores_of_runs
from validate.numbers import shown_unit, significant, text
from validate.report.stored.folder import try_results
from validate.report.stored.tables import stored_folder
from validate.report.views.layout import laid, width, wrapped
from validate.study.stored_runs.score_comparison import (
    Pair,
    SideBySide,
    pairs,
    write_comparison,
)

_LEAST = 3  # rows of a pair: fewer pairs are shown rather than shorter ones
_ROUNDING = 1e-9  # relative: the same computation in another order
_PARAMETERS = 8  # rows of parameters that differ


@dataclass(frozen=True)
class Shown:
    """Settings of a comparison's output: patterns of methods and scores, order, full tables."""

    methods: tuple[str, ...] = ()
    scores: tuple[str, ...] = ()
    sort: str = "change"
    everything: bool = False


def compare(names: tuple[str, ...], wanted: Shown, out: Path | None, *, as_json: bool) -> None:
    """Prints stored runs side by side and draws a page; raises when nothing can be compared."""
    paths = tuple(stored_folder(name) for name in names)
    found = scores_of_runs(paths, wanted.methods, wanted.scores, wanted.sort)
    if as_json:
        print(json.dumps(document(found), allow_nan=False, ensure_ascii=False, indent=1))
    else:
        # The largest change first, then pairs of methods and parameters, on one screen
        everything = wanted.everything
        columns = width(sys.stdout)
        warnings = sentences(f"warning: {w}" for w in found.warnings).laid(whole=everything)
        headline = f"{len(found.rows)} scores of {len(found.runs)} runs compared"
        errors = [r for r in found.rows if r.unit != "s"]  # times change with every run
        changed = [(abs(c), c, r) for r in errors for c in r.changes if c]
        if changed:
            _, change, row = max(changed, key=lambda c: c[0])
            name = f"{row.method}: {row.score}" if row.method else row.score
            headline += f"; largest change: {name}, {100 * change:+.3g} %."
        else:
            headline += "; no error changed."
        head = [*sentences([headline]).laid(whole=True).lines, *warnings.lines]
        parameters = _parameters(found, columns, everything=everything)
        shown, more, unseen = pairs(found, every=everything)
        room = None if everything else max(6, LINES - len(head) - len(parameters) - 4)
        lines, rows, drawn = _pairs(shown, columns, room)
        for line in (*head, *lines, *parameters):
            say(line)
        more += len(shown) - drawn
        left = sum(len(p.rows) for p in shown) - rows
        counts = {"scores": left, "pairs of methods": more, "scores without a pair": unseen}
        if what := ", ".join(f"{n} {word}" for word, n in counts.items() if n):
            say(f"left out: {what}; --all, --method, --score or --json show them")
    if out or not as_json:
        # A page below `out`, else beside the first run: one folder for one comparison, which is of
        # these runs, filtered and sorted so
        beside = paths[0].resolve()
        beside = (beside if beside.is_dir() else beside.parent).parent
        first = found.runs[0].name.partition("+")[0]
        settings = [[str(p.resolve()) for p in paths], wanted.methods, wanted.scores, wanted.sort]
        mark = sha256(json.dumps(settings).encode()).hexdigest()[:6]
        folder = (out or beside) / f"compare-{first[:60]}-{mark}"
        try:
            try_results(folder, ())
        except UsageError as error:
            if out:
                raise
            complain(f"no charts: {error}")
        else:
            page = write_comparison(found, document(found), folder)
            if not as_json:
                say(f"charts and all scores: {relative(page)}")


def _pairs(shown: Sequence[Pair], columns: int, most: int | None) -> tuple[list[str], int, int]:
    """Lines of the pairs, at most so many; how many rows and pairs they hold."""
    count = len(shown) if most is None else min(len(shown), max(1, most // (_LEAST + 3)))
    lines: list[str] = []
    rows = 0
    for i, pair in enumerate(shown[:count]):
        title = wrapped(f"One: {pair.one}; other: {pair.other}", columns, "  ")
        room = None if most is None else (most - len(lines)) // (count - i) - len(title) - 1
        # The first rows of the pair that have room, at least one
        head, cells = ["score", "one", "other", "change", "unit"], []
        for row in pair.rows:
            difference, change = row.differences[1] or 0.0, row.changes[1]
            by = f"{significant(100 * change)} %" if change else text(difference, row.unit)
            by = f"+{by}" if difference > 0 else by
            by = "rounding" if change and abs(change) < _ROUNDING else by
            one, other = (text(value, row.unit) for value in row.values)
            cells.append([row.score, one, other, by, shown_unit(row.unit)])
        if any(r.method for r in pair.rows):
            head = ["method", *head]
            cells = [[r.method, *cell] for r, cell in zip(pair.rows, cells, strict=True)]
        fitting = len(cells) if room is None else min(len(cells), max(1, room - 1))
        table = laid(head, cells[:fitting], columns)
        while room is not None and len(table) > room and fitting > 1:
            fitting -= 1
            table = laid(head, cells[:fitting], columns)
        lines += [*title, *table, ""]
        rows += fitting
    return lines, rows, count


def _parameters(found: SideBySide, columns: int, *, everything: bool) -> list[str]:
    if not found.parameters:
        return ["No parameter differs."]
    rows = [[path, *values] for path, values in found.parameters.items()]
    names = [f"{r.name} {r.created}" for r in found.runs]
    count = len(rows) if everything else _PARAMETERS
    lines = laid(["path", *names], rows[:count], columns)
    if not everything:
        while len(lines) > 2 * _PARAMETERS and count > 1:
            count -= 1
            lines = laid(["path", *names], rows[:count], columns)
    more = [f"{len(rows) - count} more: see --all"] if len(rows) > count else []
    return ["Parameters that differ", *lines, *more]


def document(found: SideBySide) -> dict[str, Any]:
    """Return the comparison as one JSON document, SI."""
    return {
        "runs": [
            {"name": r.name, "experiment": r.experiment, "created": r.created,
             "recordings": list(r.recordings), "quick": r.quick}
            for r in found.runs
        ],
        "columns": list(found.columns),
        "scores": [
            {"method": r.method or None, "score": r.score, "unit": r.unit,
             "values": list(r.values), "differences": list(r.differences),
             "changes": list(r.changes)}
            for r in found.rows
        ],
        "parameters": {path: list(values) for path, values in found.parameters.items()},
        "warnings": list(found.warnings),
    }  # fmt: skip
