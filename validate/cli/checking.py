"""`validate check`: published figures and accepted limits, today."""

import json
from pathlib import Path
from typing import Any

from validate.cli.chosen import each
from validate.cli.display import error_shown, figures_table, say, shown, table
from validate.cli.progress import progress
from validate.compare.result import KINDS, Result
from validate.replay.experiment import Experiment
from validate.replay.options import Options
from validate.replay.road import compare
from validate.report.store import check_members, figure_members


def check(names: tuple[str, ...], named: tuple[Path, ...], as_json: bool) -> int:
    """Runs the experiments and holds every figure; 0 when none failed and one was compared."""
    found: list[tuple[Result, bool]] = []
    failures: list[dict[str, Any]] = []

    def one(experiment: Experiment) -> bool:
        with progress(f"check {experiment.name}") as report:
            result = compare(experiment, Options({}), report)
        found.append((result, _holds(result, declared=bool(experiment.published))))
        return found[-1][1]

    def failed(name: str, why: str) -> None:
        failures.append({"experiment": name, "holds": False, "error": why})

    code = each(names, named, one, failed)
    if as_json:
        told = [*(_document(*pair) for pair in found), *failures]
        print(json.dumps(told, indent=1, allow_nan=False))
    else:
        for result, _ in found:
            _print(result)
    return code


def _holds(result: Result, *, declared: bool) -> bool:
    """Checks agree and figures stand; an experiment that declares figures must have held some."""
    held_some = any(not p.other for p in result.published) or not declared
    return result.passed and held_some


def _document(result: Result, holds: bool) -> dict[str, Any]:
    return {
        "experiment": result.name,
        "holds": holds,
        "published": [figure_members(p) for p in result.published],
        "checks": [{"method": m.name, **check_members(c)} for m in result.methods
                   for c in m.checks],
    }  # fmt: skip


def _print(result: Result) -> None:
    say(f"{result.name}: {KINDS[result.kind]}")
    say(result.source)
    figures_table(result.published)
    checks = [
        [c.name, error_shown(c), shown(c.limit, c.unit), str(c.count), c.verdict]
        for c in result.checks
    ]
    table("Accepted limits", ["check", "error", "limit", "n", "verdict"], checks)
    overall = result.overall
    say(
        f"\n{len(result.published)} published figures, {len(result.fallen)} no longer stand; "
        f"checks: {overall.word}, {overall.counted}\n"
    )
