"""Run a study from a script or notebook."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack

from validate.engine.cell import Where
from validate.errors import UsageError
from validate.library.single_run import Value, as_texts, load, set_words
from validate.library.studies import (
    Studied,
    StudySettings,
    choice,
    coverage_of_verdicts,
    filters,
    identified,
    stability_map,
    tradeoff,
)
from validate.library.study_result import StudyResult, stored_study
from validate.parameters import nearest_names
from validate.pipeline.experiment.experiment import Experiment

StudyKind = Literal["filters", "stability", "tradeoff", "choose", "coverage", "identify"]


class StudyArguments(TypedDict, total=False):
    """Options of the kinds of studies; each is explained at `study`."""

    methods: Sequence[str]
    sweep: Sequence[str]
    seeds: int | Sequence[int]
    by: str
    hold_out: Sequence[str]
    simulators: Sequence[str]
    error: str
    rate: str
    declared_law: bool
    draws: int
    noise: float
    parameters: Sequence[str]
    starts: int


_SET = "set"
_TAKES: Mapping[str, tuple[Callable[..., Studied[Any]], tuple[str, ...]]] = {
    "filters": (filters, (_SET, "methods", "sweep", "seeds", "by", "hold_out")),
    "stability": (stability_map, ()),
    "tradeoff": (tradeoff, ("simulators",)),
    "choose": (choice, ("error", "rate", "declared_law")),
    "coverage": (coverage_of_verdicts, (_SET, "draws", "noise")),
    "identify": (identified, (_SET, "parameters", "starts")),
}
_NAMES = {"sweep": "sweeps", _SET: "values"}  # as the studies call them
_WORDS = {"hold_out": "--hold-out", "simulators": "--external", "declared_law": "--declared-law",
          "starts": "--seeds"}  # fmt: skip
_EACH = ("sweep", "simulators")  # repeated on a command line; others are joined by commas


def study(
    kind: StudyKind,
    experiment: str | Path | Experiment,
    set: Mapping[str, Value] | None = None,  # noqa: A002 (the word of `--set`)
    *,
    quick: bool = False,
    workers: int | None = 1,
    scheduler: str = "",
    out: str | Path | None = None,
    **options: Unpack[StudyArguments],
) -> StudyResult:
    """Run many variations of an experiment, write the report, and return what was stored.

    It does what the command of that kind does, on the same stored cells: a stopped study resumes.

    - "filters" (`set`, `methods`, `sweep`, `seeds`, `by`, `hold_out`) ranks filter settings;
      a sweep is "methods.kf_load.settings.Q=log:1e-12:1e-8:3".
    - "stability" maps where time-stepping schemes are stable.
    - "tradeoff" (`simulators`) measures error against time per step.
    - "choose" (`error` as "0.5mm", `rate` as "100Hz", `declared_law`) finds the cheapest method.
    - "coverage" (`set`, `draws`, `noise`) measures how often verdicts are right.
    - "identify" (`set`, `parameters` as "material.E=1kPa:100kPa", `starts`) identifies parameters.

    `workers` is the number of processes: 1 is this one, None one an idle core; `scheduler` is the
    address of a Dask scheduler. `out` is the folder of all reports. Raises `UsageError` for
    an unknown kind, option, name or value, `ComparisonError` where nothing can be compared.
    """
    if kind not in _TAKES:
        raise UsageError(f"unknown study '{kind}'; {nearest_names(kind, {*_TAKES})}")
    run, takes = _TAKES[kind]
    given: dict[str, Any] = {**options, **({_SET: as_texts(set)} if set else {})}
    for name in given:
        if name not in takes:
            known = ", ".join(takes) or "none"
            raise UsageError(f"study '{kind}' has no option '{name}'; its options: {known}")
    if kind == "choose" and not {"error", "rate"} <= given.keys():
        raise UsageError('study "choose": give error, as "0.5mm", and rate, as "100Hz"')
    where = Where(0 if workers == 1 and not scheduler else workers, scheduler)
    # The words of the same command
    name = str(experiment.name if isinstance(experiment, Experiment) else experiment)
    words = [*(() if kind == "identify" else ("study",)), kind, name, *["--quick"] * quick]
    for key, value in given.items():
        option, plain = _WORDS.get(key, f"--{key}"), _plain(key, value)
        if key == _SET:
            words += set_words(plain)
        elif key in _EACH:
            words += [word for one in plain for word in (option, one)]
        elif isinstance(plain, bool):
            words += [option] * plain
        else:
            words += [option, ",".join(plain) if isinstance(plain, tuple) else str(plain)]
    command = tuple(words)
    command += () if out is None else ("--out", str(out))
    settings = StudySettings(None if out is None else Path(out), quick, where, command)
    found = run(load(experiment), settings, **{_NAMES.get(k, k): _plain(k, v)
                                               for k, v in given.items()})  # fmt: skip
    return stored_study(found.page)


def _plain(name: str, value: Any) -> Any:
    """Lists as tuples, seeds as the text of `--seeds`."""
    if name == "seeds":
        return str(value) if isinstance(value, int) else ",".join(map(str, value))
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(value)
    return value
