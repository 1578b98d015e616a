"""`validate run`."""

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from validate.cli.arguments import BAD_INPUT, Detail, command_line, complain, pairs
from validate.cli.chosen import ask_about, each
from validate.cli.display import relative
from validate.cli.progress import progress
from validate.cli.run_screen import called, show_run
from validate.compare.result import Result
from validate.errors import UsageError
from validate.replay.calibrated import Identify, here
from validate.replay.experiment import Experiment
from validate.replay.guests import with_guests
from validate.replay.named_run import run_folder
from validate.replay.options import Options, Report, configure, folder_of
from validate.replay.reused import rests_on
from validate.replay.road import compare
from validate.report import gl
from validate.report.folder import STUDIES, locked, try_results
from validate.report.history import replaced
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
    refine: bool = False,
    anyway: bool,
    as_json: bool,
    vtu: bool = False,
    detail: Detail = "screen",
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
        used = _refined(experiment, options) if refine else options
        result, page = _reported(with_guests(experiment, guests), used, out, vtu=vtu)
        if as_json:
            found.append((page.parent / "results.json").read_text(encoding="utf-8").strip())
        else:
            show_run(result, called(experiment), page, perf_counter() - start, detail)
        return result.passed if names else result.as_expected

    def failed(name: str, why: str) -> None:
        found.append(json.dumps({"experiment": name, "error": why}, ensure_ascii=False))

    code = each(names, named, one, failed)
    if as_json and len(names) != 1:
        print("[" + ",\n".join(found) + "]")
    elif as_json and code != BAD_INPUT:
        print(found[0])
    return code


def _refined(experiment: Experiment, options: Options) -> Options:
    """The options with what --refine sets; raises `UsageError` where nothing is left to refine."""
    if experiment.refine is None:
        raise UsageError(
            f"--refine: {experiment.name} runs on all its meshes already; leave --refine out"
        )
    parameters, _ = configure(experiment, options)
    finer = experiment.refine(parameters, folder_of(experiment))
    return replace(options, values={**finer, **options.values})


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
            f"{relative(page.parent)} held a run of {old['created']} with other settings; its "
            f"history line is "
            f"kept: see `validate history {experiment.name}`"
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
