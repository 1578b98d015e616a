"""Experiments of a command, each of which ends for itself, and what is odd about their values."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from validate.catalogue import experiment_files
from validate.cli.arguments import BAD_INPUT, FAILED, OK, complain
from validate.errors import ValidateError
from validate.replay.experiment import Experiment
from validate.replay.find import find, load_file
from validate.replay.options import doubtful

Failed = Callable[[str, str], None]  # an experiment's name, and why it could not be done


def each(
    names: tuple[str, ...],
    named: tuple[Path, ...],
    do: Callable[[Experiment], bool],
    failed: Failed | None = None,
) -> int:
    """The exit code of what is done to the experiments of these names, or to all without names.

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
