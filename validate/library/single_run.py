"""One run with its report, from a command, script or notebook."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path

from validate.compare.result import Result
from validate.engine.cell import Where
from validate.engine.execution import CELLS, Report
from validate.engine.pool import Pool
from validate.errors import UsageError
from validate.library.run_result import RunResult, open_run
from validate.pipeline.calibration.calibrated import Identify, here
from validate.pipeline.experiment.declaration import completed
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options, doubtful, with_simulators
from validate.pipeline.run.cached_runs import rests_on
from validate.pipeline.run.cells import InStore
from validate.pipeline.run.job import reports_of, run_folder
from validate.pipeline.run.pipeline import compare
from validate.recording.readers import named, recognised
from validate.recording.types import Recording
from validate.report.stored.folder import STUDIES, locked, try_results
from validate.report.stored.history import replaced
from validate.report.write import kept_report, write_report

Value = str | float  # of a parameter: a text with its unit, or a number in SI


def run(
    experiment: str | Path | Experiment,
    set: Mapping[str, Value] | None = None,  # noqa: A002 (the word of `--set`)
    *,
    methods: Sequence[str] = (),
    quick: bool = False,
    case: str = "",
    simulators: Sequence[str] = (),
    anyway: bool = False,
    workers: int | None = 1,
    out: str | Path | None = None,
) -> RunResult:
    """Simulate, compare with the recording, write the report, and return what was stored.

    It does what `validate run` does, on the same stored computations: what neither code nor values
    changed is not computed again. `set` maps paths of parameters to values, as `{"material.E":
    "14 kPa"}`; a number is in SI. `methods` are names (none: all), `case` one of the experiment's
    cases, `simulators` the commands of external simulators. `anyway` predicts with parameters
    that are not identifiable. `workers` is the number of processes: 1 is this one, None one an
    idle core. `out` is the folder of all reports.

    Raises children of `ValidateError`: `UsageError` for unknown names and values and for a folder
    that cannot be written, `RecordingError`, `SceneError`, `RegistrationError` or
    `ComparisonError` for an experiment that cannot be run.
    """
    if isinstance(methods, str) or not isinstance(set or {}, Mapping):
        raise UsageError(
            f"methods={methods!r}, set={set!r}: expected a list of names, and values by path as "
            'set={"material.E": "14 kPa"}'
        )
    texts = as_texts(set)
    options = Options(texts, tuple(methods), quick, anyway, tuple(simulators), case)
    command = (
        "run", str(experiment.name if isinstance(experiment, Experiment) else experiment),
        *["--quick"] * quick, *set_words(texts),
        *(["--methods", ",".join(methods)] if methods else []), *(["--case", case] if case else []),
        *(word for one in simulators for word in ("--external", one)), *["--anyway"] * anyway,
        *([] if out is None else ["--out", str(out)]),
    )  # fmt: skip
    folder = None if out is None else Path(out)
    with Pool(Where(workers), ("validate.pipeline.run.cells",), shares=True) as pool:
        page = reported_run(load(experiment), options, pool, folder, command=command).page
    return open_run(page.parent)


def as_texts(values: Mapping[str, Value] | None) -> dict[str, str]:
    """Values by path as `--set` takes them: numbers in full precision."""
    given = values or {}
    return {path: str(v) for path, v in given.items()}


def set_words(texts: Mapping[str, str]) -> tuple[str, ...]:
    """Return the words of a command that sets these values."""
    return tuple(word for path, v in texts.items() for word in ("--set", f"{path}={v}"))


# --- one run with its report: common part of `validate run` and the function `run` ---------------

LOG = logging.getLogger(__name__)
Progress = Callable[[str], AbstractContextManager[Report]]  # of a title: what work reports to


@contextmanager
def no_progress(title: str) -> Iterator[Report]:
    """Yield a callback that ignores all progress."""
    yield lambda done, total, what: None


@dataclass(frozen=True)
class ReportedRun:
    """A result, the path of its report.html, and what was taken from earlier runs, for the end of a
    sentence."""

    result: Result
    page: Path
    words: str


def reported_run(
    plain: Experiment,
    options: Options,
    pool: Pool,
    out: Path | None = None,
    *,
    command: tuple[str, ...] = (),
    progress: Progress = no_progress,
    vtu: bool = False,
) -> ReportedRun:
    """Run an experiment on the cells that are stored, and write its report below `out`.

    A report that would be the same is kept. `command` is recorded as what made it. A value that
    looks as if its unit was forgotten is a warning. Raises children of `ValidateError` for bad
    input, and `UsageError` for a folder that cannot be written, before anything runs.
    """
    experiment = with_simulators(plain, options.simulators)
    require_accepted(experiment)
    folder = run_folder(experiment, options, out)
    made_by = rests_on(experiment, options, command)
    warn_of_units(experiment, options)
    with locked(folder), progress(experiment.name) as report:
        try_results(folder, (STUDIES, CELLS))
        store = reports_of(experiment.path, out) / experiment.name
        if not options.quick and not any((store / CELLS).glob("*")):
            pool.begin()  # much is left to do: workers start while this process loads
            import_module("validate.report.page.html")
        by = InStore(plain, options, store, pool)
        identify = by_cells(experiment, options, out, report, pool)
        result = compare(experiment, options, report, identify, by)
        if before := kept_report(result, folder, made_by, vtu=vtu):
            words = f"{by.words}, the report of {before} is unchanged"
            return ReportedRun(result, folder.resolve() / "report.html", words)
        created = datetime.now(UTC).isoformat(timespec="seconds")
        page = write_report(
            result, folder, created=created, made=made_by, vtu=vtu, beside=pool.beside,
            progress=lambda part: report(1, 1, f"writes the report: {part}"),
        )  # fmt: skip
    if old := replaced(page.parent, created):
        LOG.warning(
            "%s held a run of %s with other settings; its history line is kept: see `validate "
            "history %s`", page.parent.name, old["created"], experiment.name,
        )  # fmt: skip
    return ReportedRun(result, page, by.words)


def require_accepted(experiment: Experiment) -> None:
    """Raise `UsageError` where no method is accepted, so that no check could ever be made."""
    if not experiment.accepted:
        some = next(iter(experiment.methods), "fem")
        raise UsageError(
            f"{experiment.name} accepts none of its methods, so nothing would be compared; name "
            f'those that count, as Experiment(..., accepted=("{some}",))'
        )


def warn_of_units(experiment: Experiment, options: Options) -> None:
    """Warn of each value that probably lacks a unit."""
    for line in doubtful(experiment, options.values):
        LOG.warning(line)


def by_cells(
    experiment: Experiment, options: Options, out: Path | None, report: Report, pool: Pool
) -> Identify:
    """Return what identifies as `validate identify` does, on the same stored cells below `out`."""
    if not experiment.calibrations:
        return here
    from validate.study.identify.study import beside

    return beside(experiment, options, out, report, pool)


# --- experiments and recordings by name or file, for scripts -------------------------------------


def load(experiment: str | Path | Experiment) -> Experiment:
    """Return the experiment of a name, of a file (.py or .json), or the one that is given.

    An experiment that was declared in a script or notebook has no file: its recordings are found
    from the current folder. A file with the suffix .py is code and is executed.

    Raises `UsageError` for an unknown name, with the nearest ones, and for a file that declares no
    experiment.
    """
    if not isinstance(experiment, Experiment):
        return find(str(experiment), Path.cwd())
    if experiment.path is not None:
        return experiment
    return completed(experiment, Path.cwd() / f"{experiment.name}.py")


def open_recording(
    path: str | Path, options: Mapping[str, str] | None = None, *, kind: str = ""
) -> Recording:
    """Return the recording in a file or folder of any format that `validate inspect` reads.

    `options` says what the file does not, as `--map` does (`{"force": "Load:N"}`); `kind` names
    the format where the file does not show it. Times are in s from the first sample, positions in
    m; every stream has its unit, its frame and a standard deviation.

    Raises `UsageError` for a file that no reader recognises, an unknown option and what must be
    said first, `RecordingError` for a damaged file.
    """
    file = Path(path)
    reader = named(kind) if kind else recognised(file)
    return reader.read(file, dict(options or {}))
