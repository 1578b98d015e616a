"""Experiments by name or by file: the one that is asked for is run, and only that."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

from validate.catalogue import experiment_files
from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.replay.experiment import Experiment


def find(name: str, start: Path) -> Experiment:
    """The experiment of that name, or of that file when it ends in .py.

    Raises `UsageError` naming the nearest ones when there is none.
    """
    if name.endswith(".py"):
        return load_file(Path(name))
    files = experiment_files(start)
    if name not in files:
        raise UsageError(f"unknown experiment '{name}'; {nearest_names(name, set(files))}")
    return load_file(files[name])


def load_file(path: Path) -> Experiment:
    """Runs an experiment file (it is code) and returns its EXPERIMENT, which knows its path."""
    if not path.is_file():
        raise UsageError(f"no experiment file {path}")
    spec = importlib.util.spec_from_file_location(path.stem, path.resolve())
    if spec is None or spec.loader is None:
        raise UsageError(f"{path} cannot be loaded as Python")
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up by name while they are made.
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    experiment = getattr(module, "EXPERIMENT", None)
    if not isinstance(experiment, Experiment):
        raise UsageError(f"{path} defines no EXPERIMENT of type Experiment")
    if experiment.name != path.stem:
        raise UsageError(f"{path}: EXPERIMENT.name is '{experiment.name}', not the file's name")
    return replace(experiment, path=path.resolve())


def root_of(experiment: Experiment, start: Path) -> Path:
    """The clone an experiment belongs to, else the folder the command was called from."""
    path = experiment.path
    return path.parents[1] if path is not None and path.parent.name == "experiments" else start
