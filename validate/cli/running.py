"""`validate run`."""

import json
import math
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from validate.cli.arguments import BAD_INPUT, command_line, complain, pairs
from validate.cli.chosen import ask_about, each
from validate.cli.display import (
    error_shown,
    figures_table,
    fits,
    relative,
    say,
    shown,
    table,
    warn,
)
from validate.cli.progress import progress
from validate.compare.overall import PASSES
from validate.compare.result import KINDS, MethodResult, Result
from validate.compare.verdict import Check
from validate.replay.calibrated import Identify, here
from validate.replay.experiment import Experiment
from validate.replay.fitted_moduli import sentence
from validate.replay.guests import with_guests
from validate.replay.named_run import run_folder
from validate.replay.options import Options, Report
from validate.replay.reused import rests_on
from validate.replay.road import compare
from validate.report import gl
from validate.report.folder import STUDIES, locked, try_results
from validate.report.history import replaced
from validate.report.store import check_members, figure_members
from validate.report.write import write_report


def run(
    names: tuple[str, ...],
    *,
    named: tuple[Path, ...],
    quick: bool,
    out: Path | None,
    values: tuple[str, ...],
    methods: str,
    guests: tuple[str, ...] = (),
    case: str = "",
    anyway: bool,
    as_json: bool,
    vtu: bool = False,
) -> int:
    """Runs experiments and writes their reports; 0 when all requirements are met.

    Without names all are run, and each passes when its verdicts are those that it declares.
    """
    gl.ask()
    wanted = tuple(m.strip() for m in methods.split(",") if m.strip())
    options = Options(pairs(values, "--set"), wanted, quick, anyway, guests, case)
    found: list[str] = []  # results.json of each, or why there is none

    def one(experiment: Experiment) -> bool:
        start = perf_counter()
        result, page = _reported(with_guests(experiment, guests), options, out, vtu=vtu)
        if as_json:
            found.append((page.parent / "results.json").read_text(encoding="utf-8").strip())
        else:
            _summary(result, page, perf_counter() - start)
        return result.passed if names else result.as_expected

    def failed(name: str, why: str) -> None:
        found.append(json.dumps({"experiment": name, "error": why}, ensure_ascii=False))

    code = each(names, named, one, failed)
    if as_json and len(names) != 1:
        print("[" + ",\n".join(found) + "]")
    elif as_json and code != BAD_INPUT:
        print(found[0])
    return code


def _reported(
    experiment: Experiment, options: Options, out: Path | None, *, vtu: bool
) -> tuple[Result, Path]:
    folder = run_folder(experiment, options, out)
    by = rests_on(experiment, options, command_line())
    ask_about(experiment, options.values)
    with locked(folder), progress(experiment.name) as report:
        try_results(folder, (STUDIES,))
        result = compare(experiment, options, report, _identify(experiment, options, out, report))
        created = datetime.now(UTC).isoformat(timespec="seconds")
        page = write_report(
            result, folder, created=created, made=by, vtu=vtu,
            progress=lambda part: report(1, 1, f"writes the report: {part}"),
        )  # fmt: skip
    if old := replaced(page.parent, created):
        complain(
            f"{relative(page.parent)} held a run of {old['created']}, made otherwise; its line is "
            f"kept, see `validate history {experiment.name}`"
        )
    return result, page


def _identify(
    experiment: Experiment, options: Options, out: Path | None, report: Report
) -> Identify:
    """What stands open is identified as `validate identify` does, on the same kept cells."""
    if not experiment.calibrations:
        return here
    from validate.study.identify import beside

    return beside(experiment, options, out, report)


def _summary(result: Result, page: Path, seconds: float) -> None:
    found = result.overall
    doubt = ", in doubt" if result.warnings and found.passed else ""
    say(f"{result.name}: {found.word}{doubt}; {found.counted}; {KINDS[result.kind]}", indent="  ")
    for warning in (*result.warnings, *result.locking):
        warn(warning)
    say(result.title)
    for one in result.moved if result.expected else ():
        warn(f"the verdict moved: {one.words}")
    for method in result.methods:
        if method.checks:
            _checks(method)
        if ended := next((r.outcome for r in method.runs if not r.finished), None):
            say(f"{method.name}: {ended.state} at step {ended.step}: {ended.why}", indent="  ")
        for words in dict.fromkeys(w for r in method.runs for w in r.said):
            say(f"{method.name}: {words}", indent="  ")
    for value in result.identified_values:
        say(f"{sentence(value)}.", indent="  ")
        if value.finding:
            warn(f"{value.name} by {value.by}: {value.finding}")
    if result.published:
        figures_table([figure_members(p) for p in result.published])
    say(f"\n{result.sentence}")
    say(f"{seconds:.1f} s wall time; report: {relative(page)}")


def _checks(method: MethodResult) -> None:
    """A line a check; where there is no room beside, why stands below those that are not met, and
    what was chosen on the judging twin below all."""
    head = ["check", "error E", "2 u_val", "limit", "margin", "n", "acceptance", "validation",
            "why"]  # fmt: skip
    rows = [_row(c, method.why(c)) for c in method.checks]
    if not fits(head, rows):
        rows = [
            _row(c, method.chosen if c.verdict in PASSES else method.why(c)) for c in method.checks
        ]
    table(f"Checks of {method.name}", head, rows)


def _row(check: Check, why: str) -> list[str]:
    bounded = math.isfinite(check.u_val)
    error = error_shown(check_members(check))
    doubt = shown(2 * check.u_val, check.unit) if bounded else "no bound"
    limit, margin = shown(check.limit, check.unit), shown(check.margin, check.unit)
    answers = [check.acceptance, check.validation]
    return [check.name, error, doubt, limit, margin, str(check.count), *answers, why]
