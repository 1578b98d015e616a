"""Experiments by name or file, for scripts."""

from pathlib import Path

from validate.pipeline.experiment.declaration import completed
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find


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
