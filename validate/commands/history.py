"""`validate history`: past runs of an experiment and the changes between them."""

import json
import math
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

from validate.catalogue import experiment_files, reports_of
from validate.commands.display import relative, say, shown
from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.report.stored.run_changes import (
    PastCheck,
    Since,
    history,
    since,
    with_unit,
)

_FIGURES = 3  # headline figures of a run
_CHANGED, _MOVED = 8, 5  # parameters and checks that changed, of a run
_DIGITS = 10  # of a hash


def show(name: str, named: tuple[Path, ...], out: Path | None, as_json: bool) -> None:
    """Print every run of an experiment below its reports; raises `UsageError` for none.

    No experiment is executed: one whose file is gone has its history all the same.
    """
    name = Path(name).stem if name.endswith(".py") else name
    files = experiment_files(Path.cwd(), named)
    reports = reports_of(files.get(name.partition("+")[0]), out)
    runs = history(reports, name)
    if not runs:
        first = f"start one with `validate run {name}`"
        hint = first if name in files else nearest_names(name, {*files})
        raise UsageError(f"no run of '{name}' below {reports}; {hint}")
    changes = [since(*pair) for pair in pairwise(runs)]
    if as_json:
        # One JSON document, SI; a change of code is one of commits.
        document = {
            "experiment": name,
            "runs": [{"folder": run.folder, **run.line} for run in runs],
            "changes": [{"from": i, "to": i + 1, **asdict(c)} for i, c in enumerate(changes, 1)],
        }
        print(json.dumps(document, ensure_ascii=False, indent=1))
        return
    count = "1 run" if len(runs) == 1 else f"{len(runs)} runs"
    say(f"{name}: {count} below {relative(reports)}")
    for i, run in enumerate(runs):
        when = run.created[:16].replace("T", " ")
        gone = ", replaced" if "replaced" in run.line else ""
        say(f"\n{(i + 1)}. {when} UTC, {run.folder}{gone}: {run.verdict}", "bold", "   ")
        words = run.folder.rpartition("-")[0].split("+")  # a run with fewer methods is called so
        differs = ["quick"] if run.line.get("quick") else []
        differs += [f"methods {', '.join(run.methods)}"] if "methods" in words else []
        differs += [
            f"{c['path']} {with_unit(c['default'], '1')} -> {with_unit(c['value'], c['unit'])}"
            for c in run.line.get("changed", [])
        ]
        say(f"   differs: {', '.join(differs) or 'nothing'}; commit {run.commit}", indent="     ")
        # The identified value that comes first, and the checks nearest to their limits
        figures = [
            f"{s['name']} {shown(s['value'], s['unit'])}"
            for s in run.line.get("identified", [])[:1]
            if s["value"] is not None
        ]
        judged = [c for c in run.checks if c.value is not None]
        judged.sort(key=lambda c: -abs(c.value or 0) / (c.limit or math.inf))
        figures += map(_figure, judged[:_FIGURES])
        say(f"   figures: {'; '.join(figures) or 'no check has a number'}", indent="     ")
        if i:
            _since(i, changes[i - 1])


def _figure(c: PastCheck) -> str:
    error = "below noise" if c.within_noise else shown(c.value or 0, c.unit)
    return f"{c.method}: {c.name} {error} (2 u_val {shown(2 * c.u_val, c.unit)})"


def _since(before: int, found: Since) -> None:
    changed = [f"parameter {k}: {a} -> {b}" for k, (a, b) in found.parameters.items()]
    lines = _first(changed, _CHANGED, "parameters")
    lines += [f"methods added: {', '.join(found.added)}"] if found.added else []
    lines += [f"methods left out: {', '.join(found.left_out)}"] if found.left_out else []
    lines += [f"file {k}: {_hash(a)} -> {_hash(b)}" for k, (a, b) in found.files.items()]
    if found.code:
        lines.append(f"code: commit {found.code[0]} -> {found.code[1]}")
    if found.verdict:
        lines.append(f"verdict: {found.verdict[0]} -> {found.verdict[1]}")
    moved = []
    for m in found.moved:
        by = (
            "the uncertainty of the numbers is not known" if m.ratio is None else f"{m.ratio:.3g} u"
        )
        one, other = shown(m.one, m.unit), shown(m.other, m.unit)
        moved.append(f"moved: {m.method}: {m.name} {one} -> {other} ({by})")
    lines += _first(moved, _MOVED, "moved checks")
    if found.within:
        most = f", by at most {found.most:.2g} u" if found.most else ""
        lines.append(f"not moved beyond 2 u: {found.within} checks{most}")
    say(f"   since {before}:")
    for line in lines or ["nothing changed"]:
        say(f"     {line}", indent="       ")


def _first(lines: list[str], most: int, what: str) -> list[str]:
    more = len(lines) - most
    return [*lines[:most], f"{more} more {what}: see --json"] if more > 0 else lines


def _hash(text: str) -> str:
    return text[:_DIGITS] or "none"
