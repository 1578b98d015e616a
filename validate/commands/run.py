"""`validate run`: run experiments and write their reports."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from validate.catalogue import experiment_files
from validate.commands.arguments import BAD_INPUT, FAILED, OK, Detail, command_line, complain, pairs
from validate.commands.display import say
from validate.commands.progress import progress
from validate.commands.run_screen import called, show_run
from validate.engine.pool import Pool
from validate.errors import UsageError, ValidateError
from validate.library.single_run import reported_run
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find, load_file
from validate.pipeline.experiment.options import Options, configure, doubtful, folder_of
from validate.report.scenes import gl

# --- Experiments of a command, each of which ends for itself, and what is odd about their
# values.

Failed = Callable[[str, str], None]  # an experiment's name, and why it could not be done


def each(
    names: tuple[str, ...],
    named: tuple[Path, ...],
    do: Callable[[Experiment], bool],
    failed: Failed | None = None,
) -> int:
    """Return the exit code of what is done to the experiments of these names, or to all without
    names.

    Names are looked up before anything is done. Of several, one that cannot be done is one line and
    exit code 2, and hides no other; `failed` is told of it.
    """
    start = Path.cwd()
    chosen: Iterable[Experiment | Path] = [find(n, start, named) for n in names]
    every = chosen or experiment_files(start, named).values()
    return max(_code(do, e, failed) for e in every)


def ask_about(experiment: Experiment, values: Mapping[str, str]) -> None:
    """A line on standard error for each value that looks like one whose unit was forgotten."""
    for line in doubtful(experiment, values):
        complain(line)


def _code(do: Callable[[Experiment], bool], one: Experiment | Path, failed: Failed | None) -> int:
    try:
        return OK if do(load_file(one) if isinstance(one, Path) else one) else FAILED
    except ValidateError as error:
        complain(str(error))
        if failed:
            failed(one.stem if isinstance(one, Path) else one.name, " ".join(str(error).split()))
        return BAD_INPUT


# -------------------------------------------------------------------------------------------------


def run(
    names: tuple[str, ...],
    *,
    named: tuple[Path, ...],
    pool: Pool,
    quick: bool,
    out: Path | None,
    values: tuple[str, ...],
    methods: str,
    simulators: tuple[str, ...] = (),
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
    options = Options(pairs(values, "--set"), wanted, quick, anyway, simulators, case)
    found: list[str] = []  # results.json of each, or why there is none

    def one(experiment: Experiment) -> bool:
        start = perf_counter()
        used = _refined(experiment, options) if refine else options
        run = reported_run(
            experiment, used, pool, out, command=command_line(), progress=progress, vtu=vtu
        )
        result, page = run.result, run.page
        if as_json:
            found.append((page.parent / "results.json").read_text(encoding="utf-8").strip())
        else:
            show_run(result, called(experiment), page, perf_counter() - start, detail, run.words)
        return result.passed if names else result.as_expected

    def failed(name: str, why: str) -> None:
        found.append(json.dumps({"experiment": name, "error": why}, ensure_ascii=False))

    try:
        code = each(names, named, one, failed)
    except KeyboardInterrupt:
        say("what was computed is kept; the same command goes on from there", error=True)
        raise
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
