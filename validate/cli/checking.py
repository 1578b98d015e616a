"""`validate check`: published figures and accepted limits, today."""

import json
from pathlib import Path
from typing import Any

from validate.catalogue import experiment_files
from validate.cli.arguments import FAILED
from validate.cli.display import console, error_shown, progress, shown, table
from validate.compare.published import Published
from validate.compare.result import KINDS, Result
from validate.replay.find import find
from validate.replay.options import Options
from validate.replay.road import compare


def check(names: tuple[str, ...], as_json: bool) -> int:
    """Runs the experiments and holds every figure; 0 when none failed and one was compared."""
    start = Path.cwd()
    found = []
    for name in names or tuple(experiment_files(start)):
        experiment = find(name, start)
        with progress(f"check {name}") as report:
            result = compare(experiment, Options({}), report)
        found.append((result, _holds(result, declared=bool(experiment.published))))
    if as_json:
        print(json.dumps([_document(*pair) for pair in found], indent=1, allow_nan=False))
    else:
        for result, _ in found:
            _print(result)
    return 0 if all(holds for _, holds in found) else FAILED


def _holds(result: Result, *, declared: bool) -> bool:
    """Checks agree and figures stand; an experiment that declares figures must have shown some."""
    shown_some = bool(result.published) or not declared
    return result.passed and shown_some and not any(p.fault for p in result.published)


def _document(result: Result, holds: bool) -> dict[str, Any]:
    return {
        "experiment": result.name,
        "holds": holds,
        "published": [
            {"name": p.name, "ours": p.ours, "theirs": p.theirs, "unit": p.unit,
             "verdict": p.verdict, "fault": p.fault, "reason": p.reason, "source": p.source}
            for p in result.published
        ],
        "checks": [
            {"name": c.name, "value": c.value, "limit": c.limit, "unit": c.unit, "count": c.count,
             "verdict": c.verdict, "why": c.why}
            for c in result.checks
        ],
    }  # fmt: skip


def _print(result: Result) -> None:
    screen = console()
    screen.print(f"{result.name}: {KINDS[result.kind]}", soft_wrap=True)
    screen.print(f"{result.source}\n", soft_wrap=True)
    rows = [
        [p.name, _value(p.ours, p), _value(p.theirs, p), p.fault or p.verdict, p.reason]
        for p in result.published
    ]
    screen.print(table("Published figures", ["figure", "ours", "theirs", "verdict", "why"], rows))
    checks = [
        [c.name, error_shown(c), shown(c.limit, c.unit), str(c.count), c.verdict]
        for c in result.checks
    ]
    screen.print(table("\nAccepted limits", ["check", "error", "limit", "n", "verdict"], checks))
    faults = sum(bool(p.fault) for p in result.published)
    overall = result.overall
    screen.print(
        f"\n{len(result.published)} published figures, {faults} no longer stand; "
        f"checks: {overall.word}, {overall.counted}\n"
    )


def _value(value: float | None, figure: Published) -> str:
    return "-" if value is None else shown(value, figure.unit)
