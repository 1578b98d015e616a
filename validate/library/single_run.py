"""Run an experiment from a script or notebook."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from validate.engine.cell import Where
from validate.engine.pool import Pool
from validate.errors import UsageError
from validate.library.files import load
from validate.library.run_report import reported_run
from validate.library.run_result import RunResult, open_run
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options

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
